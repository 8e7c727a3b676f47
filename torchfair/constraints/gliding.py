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
        self._answer: tuple[Tensor, int, SplineFeet] | None = None

    def __call__(self, state: State) -> SplineFeet:
        """Feet (n, ...) for the vertices of the state."""
        points = state[self.block]
        # The same tensor, not equal ones: to compare values would make the host wait for a device.
        if self._answer is None or self._answer[0] is not points or self._answer[1] != points._version:
            self._answer = points, points._version, self.curves.closest(points[self.vertices], self.curve_of_vertex)
        return self._answer[2]


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
