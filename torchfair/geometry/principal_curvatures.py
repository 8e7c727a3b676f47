"""Principal curvatures, integrated over vertex stars, and their directions."""

from __future__ import annotations

from typing import Literal, get_args

from torch import Tensor

from .._precision import in_single_at_least
from ..errors import TorchfairError
from ..topology import Topology
from ._principal_frames import principal_frames
from .curvature_norms import eigenvalues
from .fitted_curvature import fitted_curvature
from .patches import Patches
from .star_normals import star_normals
from .tangent_basis import tangent_bases
from .tangential_shape_operator import Estimator, restrict, star_operators, tangential_shape_operators
from .vertex_areas import vertex_areas

CurvatureEstimator = Literal["fitted"] | Estimator


@in_single_at_least
def principal_values(
    vertices: Tensor,
    topology: Topology,
    *,
    estimator: CurvatureEstimator = "fitted",
    sine: bool = True,
    rings: int | Patches | None = None,
) -> Tensor:
    """Both principal curvatures of every star times its area, the larger first (paper section 5.3).

    Divide by :func:`vertex_areas` for curvatures.

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity; any polygons, mixed.
        estimator: ``"fitted"`` for :func:`fitted_curvature`, by polynomials over rings of vertices; or one that
            looks at a single star, of :func:`tangential_shape_operators`, whose eigenvalues these are.
        sine: see :func:`tangential_shape_operators`.
        rings: see :func:`fitted_curvature`; of no consequence for the other estimators.

    Returns:
        (*batch, V, 2), same unit as the vertices, positive where convex. Stars on the boundary are incomplete
        in the normal cycle. Zero at isolated vertices and flat stars; where both agree (umbilics) the
        derivative of either is that of their mean.

    Raises:
        ShapeError: if ``vertices`` is not a floating tensor (*batch, V, 3).
        TorchfairError: for an unknown estimator, and for ``rings`` as in :func:`fitted_curvature`.

    Example:
        >>> from torchfair.geometry import principal_values, vertex_areas
        >>> from torchfair.shapes import icosphere
        >>> ball = icosphere(2, radius=2.0)
        >>> values = principal_values(ball.vertices, ball.topology)
        >>> areas = vertex_areas(ball.vertices, ball.topology)
        >>> (values / areas[:, None]).mean(0)  # nearly 1 / 2 twice
        tensor([0.4985, 0.4977], dtype=torch.float64)
    """
    _check(estimator)
    if estimator == "fitted":
        fit = fitted_curvature(vertices, topology, rings=rings)
        return fit.curvatures * vertex_areas(vertices, topology)[..., None]
    return eigenvalues(tangential_shape_operators(vertices, topology, estimator=estimator, sine=sine))


@in_single_at_least
def principal_directions(
    vertices: Tensor,
    topology: Topology,
    *,
    estimator: CurvatureEstimator = "fitted",
    sine: bool = True,
    rings: int | Patches | None = None,
) -> Tensor:
    """Unit principal directions ``d1, d2`` at every vertex, in the order of :func:`principal_values`.

    Along ``d1`` the surface bends by the larger curvature: round a tube, not along it. (In star operators it is
    the other way round, which has been undone.) How far they can be trusted says
    :attr:`FittedCurvature.confidence` of :func:`fitted_curvature`.

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity; any polygons, mixed.
        estimator: see :func:`principal_values`.
        sine: see :func:`tangential_shape_operators`.
        rings: see :func:`fitted_curvature`; of no consequence for the other estimators.

    Returns:
        (*batch, V, 2, 3). ``d1, d2`` and the normal, fitted or :func:`star_normals`, are orthonormal and
        right-handed; the common sign of ``d1, d2`` has no meaning and need not agree between neighbours. Where
        the curvatures agree up to rounding (umbilics, flat stars) every direction is principal, and the tangent
        basis itself is returned (:func:`tangent_bases`) with no derivative but its own; just beside it derivatives
        are large. Zero vectors at isolated vertices and where there is no normal.

    Raises:
        ShapeError: if ``vertices`` is not a floating tensor (*batch, V, 3).
        TorchfairError: for an unknown estimator, and for ``rings`` as in :func:`fitted_curvature`.

    Example:
        >>> from torchfair.geometry import principal_directions
        >>> from torchfair.shapes import Catenoid, principal_quads
        >>> mesh = principal_quads(Catenoid(), 8, 16)
        >>> principal_directions(mesh.vertices, mesh.topology).shape
        torch.Size([144, 2, 3])
    """
    _check(estimator)
    if estimator == "fitted":
        return fitted_curvature(vertices, topology, rings=rings).directions
    bases = tangent_bases(star_normals(vertices, topology))
    return principal_frames(restrict(star_operators(vertices, topology, estimator, sine), bases), bases)


def _check(estimator: str) -> None:
    """Raises TorchfairError unless the name is one of the estimators."""
    if estimator != "fitted" and estimator not in get_args(Estimator):
        raise TorchfairError(f'estimator must be "fitted", "normal_cycle" or "corrected", got {estimator!r}')
