"""Principal curvatures, integrated over vertex stars, and their directions."""

from __future__ import annotations

import torch
from torch import Tensor

from ..topology import Topology
from ._ops import norm
from .curvature_norms import eigenvalues
from .star_normals import star_normals
from .tangent_basis import tangent_bases
from .tangential_shape_operator import Estimator, restrict, star_operators, tangential_shape_operators


def principal_values(
    vertices: Tensor, topology: Topology, *, estimator: Estimator = "normal_cycle", sine: bool = True
) -> Tensor:
    """Both principal curvatures of every star times its area, the larger first (paper section 5.3).

    The eigenvalues of :func:`tangential_shape_operators`. Divide by :func:`vertex_areas` for curvatures.

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity; any polygons, mixed.
        estimator: see :func:`tangential_shape_operators`.
        sine: see :func:`tangential_shape_operators`.

    Returns:
        (*batch, V, 2), same unit as the vertices, positive where convex. Stars on the boundary are incomplete
        in the normal cycle. Zero at isolated vertices and flat stars; where both agree (umbilics) the
        derivative of either is that of their mean.

    Raises:
        ShapeError: if ``vertices`` is not a floating tensor (*batch, V, 3).
        TorchfairError: for an unknown estimator.
    """
    return eigenvalues(tangential_shape_operators(vertices, topology, estimator=estimator, sine=sine))


def principal_directions(
    vertices: Tensor, topology: Topology, *, estimator: Estimator = "normal_cycle", sine: bool = True
) -> Tensor:
    """Unit principal directions ``d1, d2`` of every star, in the order of :func:`principal_values`.

    Along ``d1`` the surface bends by the larger curvature: round a tube, not along it. (In the operators it is
    the other way round, which has been undone.)

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity; any polygons, mixed.
        estimator: see :func:`tangential_shape_operators`.
        sine: see :func:`tangential_shape_operators`.

    Returns:
        (*batch, V, 2, 3). ``d1, d2`` and the star normal are orthonormal and right-handed; the common sign
        of ``d1, d2`` has no meaning and need not agree between neighbours. Where the curvatures agree up to
        rounding (umbilics, flat stars) every direction is principal, and the tangent basis itself is
        returned (:func:`tangent_bases`) with no derivative but its own; just beside it derivatives are large.
        Zero vectors at isolated vertices and where the star has no normal.

    Raises:
        ShapeError: if ``vertices`` is not a floating tensor (*batch, V, 3).
        TorchfairError: for an unknown estimator.
    """
    bases = tangent_bases(star_normals(vertices, topology))
    plane = restrict(star_operators(vertices, topology, estimator, sine), bases)
    angle = _eigen_angle(plane)[..., None]
    cosine, sine_of = angle.cos(), angle.sin()
    first, second = bases.unbind(-2)
    # The eigenvector of the larger value is d2, which with d1 = d2 x n makes a right-handed frame.
    return torch.stack([sine_of * first - cosine * second, cosine * first + sine_of * second], dim=-2)


def _eigen_angle(plane: Tensor) -> Tensor:
    """Angle from the first basis vector to the eigenvector of the larger eigenvalue, pi/2 if they agree: (...)."""
    size = plane.detach().abs().amax((-2, -1))
    scaled = plane / torch.where(size > 0, size, 1.0)[..., None, None]  # squares of tiny entries would underflow
    x, y = (scaled[..., 0, 0] - scaled[..., 1, 1]) / 2, scaled[..., 0, 1]
    agree = norm(torch.stack([x, y], dim=-1).detach()) <= 64 * torch.finfo(plane.dtype).eps
    return torch.atan2(torch.where(agree, 0.0, y), torch.where(agree, -1.0, x)) / 2
