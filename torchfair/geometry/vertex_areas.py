"""Areas that vertices stand for."""

from __future__ import annotations

from torch import Tensor

from .._remembered import remembered
from ..topology import Topology
from ._any_size import of_any_size
from ._ops import gather, scatter_sum
from .areas import face_areas


@remembered
@of_any_size(2)
def vertex_areas(vertices: Tensor, topology: Topology) -> Tensor:
    """Area of every vertex: equal shares of the faces around it, one third of every triangle.

    Integrated curvatures divided by it are curvatures.

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity; any polygons, mixed.

    Returns:
        (*batch, V), unit length^2, >= 0; they sum to the total area. Zero at isolated vertices; derivatives
        as for :func:`face_areas`.

    Raises:
        ShapeError: if ``vertices`` is not a floating tensor (*batch, V, 3).

    Example:
        >>> from torchfair.geometry import vertex_areas
        >>> from torchfair.shapes import icosphere
        >>> ball = icosphere(2, radius=2.0)
        >>> vertex_areas(ball.vertices, ball.topology).sum()  # of the sphere 16 pi = 50.27
        tensor(49.3194, dtype=torch.float64)
    """
    shares = face_areas(vertices, topology) / topology.face_sizes
    corners = gather(shares[..., None], topology.corner_faces)
    return scatter_sum(corners, topology.corners, topology.num_vertices).squeeze(-1)
