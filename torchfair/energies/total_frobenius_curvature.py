"""Total Frobenius curvature: the sum of sqrt(k1^2 + k2^2) over vertex stars."""

from __future__ import annotations

from torch import Tensor

from .._loading import safe_to_load
from ..geometry import frobenius_norms
from ..geometry.tangential_shape_operator import Estimator
from ..topology import Topology
from .boundary_extrapolation import BoundaryExtrapolation
from .star_energy import Boundary, StarEnergy, star_terms


def total_frobenius_curvature_per_vertex(
    vertices: Tensor,
    topology: Topology,
    *,
    sine: bool = True,
    estimator: Estimator = "normal_cycle",
    boundary: Boundary | BoundaryExtrapolation = "open",
) -> Tensor:
    """``sqrt(k1^2 + k2^2)`` of every star, integrated over it: (*batch, V).

    Arguments, degenerate cases and errors as for :func:`total_frobenius_curvature`.

    Example:
        >>> from torchfair.energies import total_frobenius_curvature_per_vertex
        >>> from torchfair.shapes import Catenoid, principal_quads
        >>> mesh = principal_quads(Catenoid(), 8, 16)
        >>> total_frobenius_curvature_per_vertex(mesh.vertices, mesh.topology).shape
        torch.Size([144])
    """
    return star_terms(frobenius_norms, vertices, topology, sine=sine, estimator=estimator, boundary=boundary)


def total_frobenius_curvature(
    vertices: Tensor,
    topology: Topology,
    *,
    sine: bool = True,
    estimator: Estimator = "normal_cycle",
    boundary: Boundary | BoundaryExtrapolation = "open",
) -> Tensor:
    """Total Frobenius curvature ``C2 = sum_v sqrt(k1^2 + k2^2)``, integrated over the star of ``v``.

    It discretises the integral of the Frobenius norm of the shape operator, the total variation of the normal of
    Bergmann et al. 2019, which the paper compares with C in section 4. Always ``C2 <= C <= sqrt(2) C2``: equal to
    C on developable surfaces, ``C / sqrt(2)`` on spheres and minimal surfaces.

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity; any polygons, mixed.
        sine: see :func:`total_absolute_curvature`, also for accuracy.
        estimator: see there.
        boundary: see there.

    Returns:
        (*batch,) >= 0, same unit as the vertices; scales with them, unchanged by rigid motions and by turning
        all faces round. Smooth but for flat stars, where the derivative given is zero (a subgradient);
        degenerate input as for :func:`total_absolute_curvature`.

    Raises:
        ShapeError: if ``vertices`` is not a floating tensor (*batch, V, 3).
        TorchfairError: for an unknown estimator or treatment of the boundary.

    Example:
        >>> from torchfair.energies import total_frobenius_curvature
        >>> from torchfair.shapes import Catenoid, principal_quads
        >>> mesh = principal_quads(Catenoid(), 8, 16)
        >>> total_frobenius_curvature(mesh.vertices, mesh.topology)
        tensor(16.3287, dtype=torch.float64)
    """
    terms = total_frobenius_curvature_per_vertex(vertices, topology, sine=sine, estimator=estimator, boundary=boundary)
    return topology.sum_per_mesh(terms, "vertices")


@safe_to_load
class TotalFrobeniusCurvature(StarEnergy):
    """Module form of :func:`total_frobenius_curvature`: ``forward(vertices)`` (*batch, V, 3) -> (*batch,).

    Example:
        >>> from torchfair.energies import TotalFrobeniusCurvature
        >>> from torchfair.shapes import Catenoid, principal_quads
        >>> mesh = principal_quads(Catenoid(), 8, 16)
        >>> energy = TotalFrobeniusCurvature(mesh.topology)
        >>> energy(mesh.vertices)
        tensor(16.3287, dtype=torch.float64)
        >>> batch = mesh.vertices.expand(3, -1, -1)
        >>> energy(batch).shape
        torch.Size([3])
    """

    norms = staticmethod(frobenius_norms)
