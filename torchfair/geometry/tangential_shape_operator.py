"""Shape operators of vertex stars as symmetric 2x2 matrices in tangent planes."""

from __future__ import annotations

from typing import Literal, get_args

from torch import Tensor

from .._remembered import remembered
from ..errors import TorchfairError
from ..topology import Topology
from ._any_size import of_any_size
from .corrected_shape_operator import corrected_shape_operators
from .shape_operator import shape_operators
from .star_normals import star_normals
from .tangent_basis import tangent_bases

Estimator = Literal["normal_cycle", "corrected"]


@remembered
@of_any_size(1)
def tangential_shape_operators(
    vertices: Tensor, topology: Topology, *, estimator: Estimator = "normal_cycle", sine: bool = True
) -> Tensor:
    """Shape operator of every star in the tangent plane, a symmetric 2x2 matrix, integrated over the star.

    The plane is orthogonal to the sum of the face normals (:func:`star_normals`, paper section 5.3, item 6), its
    basis is :func:`tangent_bases` of that normal. Restricting makes sharp corners well defined, where the
    3x3 matrix has three eigenvalues that are not zero.

    As in :func:`shape_operators` the eigenvector of one curvature is the *other* principal direction:
    take directions from :func:`principal_directions`.

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity; any polygons, mixed.
        estimator: ``"normal_cycle"`` for :func:`shape_operators` (the paper's) or ``"corrected"`` for
            :func:`corrected_shape_operators`.
        sine: whether the normal cycle uses ``sin a`` (the paper's) or ``a``; of no consequence for
            the other estimator.

    Returns:
        (*batch, V, 2, 2), same unit as the vertices: curvature times area, positive where convex. Zero, with
        zero derivatives, where the star has no normal (isolated vertices, normals that cancel).

    Raises:
        ShapeError: if ``vertices`` is not a floating tensor (*batch, V, 3).
        TorchfairError: for an unknown estimator.

    Example:
        >>> from torchfair.geometry import tangential_shape_operators
        >>> from torchfair.shapes import icosphere
        >>> ball = icosphere(2, radius=2.0)
        >>> tangential_shape_operators(ball.vertices, ball.topology).shape
        torch.Size([162, 2, 2])
    """
    operators = star_operators(vertices, topology, estimator, sine)
    return restrict(operators, tangent_bases(star_normals(vertices, topology)))


def star_operators(vertices: Tensor, topology: Topology, estimator: Estimator, sine: bool) -> Tensor:
    """The 3x3 operators (*batch, V, 3, 3) by either estimator. Errors as in :func:`tangential_shape_operators`."""
    check_estimator(estimator)
    if estimator == "corrected":
        return corrected_shape_operators(vertices, topology)
    return shape_operators(vertices, topology, sine=sine)


def check_estimator(estimator: str) -> None:
    """Raises TorchfairError unless the name is one of the estimators."""
    if estimator not in get_args(Estimator):
        raise TorchfairError(f'estimator must be "normal_cycle" or "corrected", got {estimator!r}')


def restrict(operators: Tensor, bases: Tensor) -> Tensor:
    """The symmetric part of ``operators`` (..., 3, 3) in the planes of ``bases`` (..., 2, 3): (..., 2, 2)."""
    plane = bases @ operators @ bases.mT
    return (plane + plane.mT) / 2
