"""Face areas and area vectors."""

from __future__ import annotations

from torch import Tensor

from .._precision import in_single_at_least
from .._remembered import remembered
from ..topology import Topology
from ._any_size import of_any_size
from ._ops import cross, map_faces, norm


@in_single_at_least
def face_area_vectors(vertices: Tensor, topology: Topology) -> Tensor:
    r"""Area vector of every face: normal to the face, as long as its area.

    ``A_f = 1/2 sum_i v_i x v_(i+1)`` over the corners in order, for polygons of any size. It points to the
    side from which the corners run counterclockwise. A polygon that is not planar has the area vector of
    all surfaces that fill its boundary; its direction is the best-fit normal in the sense that the
    projection along it has the largest area.

    Corners are taken relative to one corner of the face, so that faces far from the origin keep their
    digits.

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity; any polygons, mixed.

    Returns:
        (*batch, F, 3), unit length^2. Smooth (a polynomial) everywhere, zero-area faces included.

    Raises:
        ShapeError: if ``vertices`` is not a floating tensor (*batch, V, 3).

    Example:
        >>> import torch
        >>> from torchfair import Topology
        >>> from torchfair.geometry import face_area_vectors
        >>> vertices = torch.tensor([[0.0, 0, 0], [2, 0, 0], [2, 2, 1], [0, 2, 1], [0, 4, 0], [2, 4, 0]])
        >>> topology = Topology.from_faces([[0, 1, 2, 3], [3, 2, 5, 4]])  # a ridge
        >>> face_area_vectors(vertices, topology)
        tensor([[ 0., -2.,  4.],
                [ 0.,  2.,  4.]])
    """
    topology.check_vertices(vertices)
    return map_faces(vertices, topology, area_vector)


@remembered
@of_any_size(2)
def face_areas(vertices: Tensor, topology: Topology) -> Tensor:
    """Area of every face: the length of its area vector.

    For a polygon that is not planar this is the area of its largest planar projection, a lower bound of
    the area of any surface spanned by it.

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity; any polygons, mixed.

    Returns:
        (*batch, F), unit length^2, >= 0. Where the area is zero, so are all derivatives (a subgradient).

    Raises:
        ShapeError: if ``vertices`` is not a floating tensor (*batch, V, 3).

    Example:
        >>> import torch
        >>> from torchfair import Topology
        >>> from torchfair.geometry import face_areas
        >>> vertices = torch.tensor([[0.0, 0, 0], [2, 0, 0], [2, 2, 1], [0, 2, 1], [0, 4, 0], [2, 4, 0]])
        >>> topology = Topology.from_faces([[0, 1, 2, 3], [3, 2, 5, 4]])  # a ridge
        >>> face_areas(vertices, topology)
        tensor([4.4721, 4.4721])
    """
    return norm(face_area_vectors(vertices, topology))


def area_vector(corners: Tensor) -> Tensor:
    """Area vectors of polygons given by their corners (*batch, n, k, 3): (*batch, n, 3)."""
    size = corners.shape[-2]
    if size == 4:  # half the cross product of the diagonals
        p0, p1, p2, p3 = corners.unbind(-2)
        return cross(p2 - p0, p3 - p1) / 2
    spokes = corners[..., 1:, :] - corners[..., :1, :]
    return cross(spokes[..., :-1, :], spokes[..., 1:, :]).sum(-2) / 2
