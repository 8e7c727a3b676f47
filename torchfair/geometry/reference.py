"""What counts as a reference surface: a mesh, or any function that gives closest points and normals."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor

from ..errors import MeshError, ShapeError
from .closest_point import ReferenceSurface

ReferenceFunction = Callable[[Tensor], tuple[Tensor, Tensor]]
"""For points (N, 3) the closest points (N, 3) of a surface and its unit normals (N, 3) there."""

Reference = ReferenceSurface | ReferenceFunction


def closest_on(reference: Reference) -> ReferenceFunction:
    """The function that finds closest points on ``reference``, for the same points again and again while they move.

    A :class:`ReferenceSurface` is followed by its tracker and has interpolated vertex normals; a function is called
    with detached points, and what it returns is checked.

    Args:
        reference: a mesh as a :class:`ReferenceSurface`, or a function ``points -> (positions, normals)``, such as
            :class:`torchfair.shapes.ClosestOnSurface` or :class:`torchfair.shapes.ClosestOnLevelSet`. The normals may
            point to either side.

    Returns:
        A function from points (N, 3), anywhere, to positions (N, 3) and unit normals (N, 3) in their dtype and on their
        device, without gradients. It raises ShapeError and MeshError if the reference returns something else or
        numbers that are not finite.

    Example:
        >>> from torchfair.geometry import closest_on
        >>> import torch
        >>> def unit_sphere(points):
        ...     normals = points / points.norm(dim=1, keepdim=True)
        ...     return normals, normals
        >>> positions, normals = closest_on(unit_sphere)(torch.tensor([[0.0, 0.0, 3.0]]))
        >>> positions
        tensor([[0., 0., 1.]])
    """
    if isinstance(reference, ReferenceSurface):
        return _OnMesh(reference)
    if not callable(reference):
        raise ShapeError("reference", "a ReferenceSurface, or a function of points (N, 3)", type(reference).__name__)
    return _OnFunction(reference)


class _OnMesh:
    """Follows points on a mesh."""

    def __init__(self, surface: ReferenceSurface) -> None:
        self._tracker = surface.tracker()

    def __call__(self, points: Tensor) -> tuple[Tensor, Tensor]:
        closest = self._tracker.closest(points)
        return closest.positions, closest.smooth_normals


class _OnFunction:
    """Asks a function and checks what it says."""

    def __init__(self, function: ReferenceFunction) -> None:
        self._function = function

    def __call__(self, points: Tensor) -> tuple[Tensor, Tensor]:
        points = points.detach()
        with torch.no_grad():
            found = self._function(points)
        if not isinstance(found, tuple) or len(found) != 2:
            raise ShapeError("reference(points)", "two tensors, positions and normals", type(found).__name__)
        return _checked(found[0], points, "positions"), _checked(found[1], points, "normals")


def _checked(part: object, points: Tensor, word: str) -> Tensor:
    if not isinstance(part, Tensor) or part.shape != points.shape or not part.is_floating_point():
        actual = tuple(part.shape) if isinstance(part, Tensor) else type(part).__name__
        raise ShapeError(f"{word} of reference(points)", f"a floating tensor {tuple(points.shape)}", actual)
    bad = torch.nonzero(~part.isfinite().all(1)).squeeze(1).tolist()
    if bad:
        raise MeshError(
            f"the reference gives {word} that are not finite for {len(bad)} points, first {bad[:5]}: "
            "make the function total, or start nearer to the surface"
        )
    return part.to(points)
