"""Boundary vertices glide along smooth boundary curves."""

from __future__ import annotations

import torch
from torch import Tensor

from ..geometry.spline_curves import SplineCurves, SplineFeet
from ..projection import ElementTerm
from ..projection.layout import State


class CurveFeet:
    """Closest points on their own curves of some vertices of a state.

    The last query is kept, since several terms ask for the same state.

    Args:
        curves: Reference curves.
        vertices: (n,) vertices that glide.
        curve_of_vertex: (n,) on which of the curves.
        block: Name of the vertex block.
    """

    def __init__(
        self, curves: SplineCurves, vertices: Tensor, curve_of_vertex: Tensor, *, block: str = "vertices"
    ) -> None:
        self.curves, self.vertices, self.curve_of_vertex, self.block = curves, vertices, curve_of_vertex, block
        self._asked: tuple[Tensor, int] | None = None
        self._answer: SplineFeet | None = None

    def __call__(self, state: State) -> SplineFeet:
        """Feet (n, ...) for the vertices of the state."""
        points = state[self.block]
        if self._answer is None or not self._is_last(points):
            self._answer = self.curves.closest(points[self.vertices], self.curve_of_vertex)
            self._asked = None if points.is_inference() else (points, points._version)
        return self._answer

    def _is_last(self, points: Tensor) -> bool:
        """Whether these are the very points asked for last; comparing their values would wait for other devices."""
        return self._asked is not None and points is self._asked[0] and points._version == self._asked[1]


def offset_from_curve(x: Tensor, foot: Tensor, tangent: Tensor) -> Tensor:
    """Offsets (n, 3) of the vertices ``x`` (n, 1, 3) from the lines through ``foot``; parts along ``tangent`` are free.

    A zero tangent (the foot is an end of the curve) leaves nothing free.
    """
    offset = x[:, 0] - foot
    return offset - (offset * tangent).sum(1, keepdim=True) * tangent


def offset_jacobian(x: Tensor, foot: Tensor, tangent: Tensor) -> Tensor:
    """Derivatives (n, 3, 3) of :func:`offset_from_curve`: the projection along the tangent."""
    return torch.eye(3, dtype=x.dtype, device=x.device) - tangent[:, :, None] * tangent[:, None]


def gliding_terms(feet: CurveFeet, *, weight: float) -> list[ElementTerm]:
    """Distance of vertices from their own curves, in the unit of the vertices.

    The merit is half the weight times the squared distance. The model has its gradient and, where a vertex lies on its
    curve, its second derivatives. At a distance d towards the centre of curvature feet move 1 / (1 - curvature d) times
    as far as vertices, which the model leaves out.
    """
    if not feet.vertices.numel():
        return []

    def refresh(state: State) -> tuple[Tensor, Tensor]:
        found = feet(state)
        return found.positions, torch.where(found.beyond_end[:, None], 0.0, found.tangents)

    return [
        ElementTerm(
            "boundary gliding",
            offset_from_curve,
            [(feet.block, feet.vertices[:, None])],
            weight=weight,
            refresh=refresh,
            jacobian=offset_jacobian,
            batched=True,
        )
    ]
