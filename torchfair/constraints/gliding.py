"""Boundary vertices glide along smooth boundary curves."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor, nn

from ..geometry.spline_curves import SplineCurves, SplineFeet
from ..projection import ElementTerm
from ..projection.layout import State
from ._indexed import IndexedModule
from .base import Constraint

_KEPT = 3  # queries: a step looks at where it is and where it leads in turns


class CurveFeet(IndexedModule):
    """Closest points on their own curves of some vertices of a state.

    They are constant for derivatives. The last three queries are kept, since several terms and guards ask for the same
    states; not those for tensors that require gradients, which would keep their graphs.

    Args:
        curves: Reference curves.
        vertices: (n,) vertices that glide.
        curve_of_vertex: (n,) on which of the curves.
        block: Name of the vertex block.
    """

    def __init__(
        self, curves: SplineCurves, vertices: Tensor, curve_of_vertex: Tensor, *, block: str = "vertices"
    ) -> None:
        super().__init__(vertices, curve_of_vertex)
        self.curves, self.block = curves, block
        self._kept: list[tuple[Tensor, int, SplineFeet]] = []

    @property
    def vertices(self) -> Tensor:
        """(n,) vertices that glide."""
        return self.indices[0]

    @property
    def curve_of_vertex(self) -> Tensor:
        """(n,) on which of the curves."""
        return self.indices[1]

    def _apply(self, fn: Callable[[Tensor], Tensor], recurse: bool = True) -> CurveFeet:
        super()._apply(fn, recurse)
        self.curves = self.curves.to(self.vertices.device)
        return self

    def __call__(self, state: State) -> SplineFeet:
        """Feet (n, ...) for the vertices of the state."""
        feet: SplineFeet = super().__call__(state)
        return feet

    def forward(self, state: State) -> SplineFeet:
        """Feet (n, ...) for the vertices of the state."""
        points = state[self.block]
        if points.is_inference() or points.requires_grad:
            return self._found(points)
        others, answer = [], None
        for kept in self._kept:  # comparing values would wait for other devices
            if kept[0] is not points:
                others.append(kept)
            elif kept[1] == points._version:
                answer = kept[2]
        answer = answer or self._found(points)
        self._kept = [(points, points._version, answer), *others[: _KEPT - 1]]
        return answer

    def _found(self, points: Tensor) -> SplineFeet:
        return self.curves.closest(points[self.vertices], self.curve_of_vertex)


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
    return [
        ElementTerm(
            "boundary gliding",
            offset_from_curve,
            [(feet.block, feet.vertices[:, None])],
            weight=weight,
            refresh=_Tangents(feet),
            jacobian=offset_jacobian,
            batched=True,
        )
    ]


class _Tangents(nn.Module):
    """Feet and what is free there."""

    def __init__(self, feet: CurveFeet) -> None:
        super().__init__()
        self.feet = feet

    def forward(self, state: State) -> tuple[Tensor, Tensor]:
        found = self.feet(state)
        return found.positions, torch.where(found.beyond_end[:, None], 0.0, found.tangents)


class Gliding(Constraint):
    """Module form of :func:`gliding_terms`: half the sum of squared distances from curves, in length squared.

    Exact are value and gradient, which is the offset from the closest point: closest points are found for every member
    of a batch and are constant for derivatives, and so are tangents. Second derivatives are those of straight lines.
    Nothing flows to the curves. ``torch.compile`` breaks its graph at the search.

    Args:
        curves: Reference curves; part of the module, not of its ``state_dict``.
        vertices: (n,) numbers of the vertices.
        curve_of_vertex: (n,) on which of the curves each is to be.

    Example:
        >>> import torch
        >>> from torchfair.constraints import Gliding
        >>> from torchfair.geometry import SplineCurves
        >>> from torchfair.shapes import Catenoid, principal_quads
        >>> mesh = principal_quads(Catenoid(), 8, 16)
        >>> loop = mesh.topology.loop_vertices[: mesh.topology.loop_offsets[1]]
        >>> rim = SplineCurves([mesh.vertices[loop]], [True])
        >>> moved = mesh.vertices + 0.01 * torch.sin(40 * mesh.vertices)
        >>> constraint = Gliding(rim, loop, torch.zeros(len(loop), dtype=torch.int64))
        >>> constraint(moved)
        tensor(0.0006, dtype=torch.float64)
    """

    def __init__(self, curves: SplineCurves, vertices: Tensor, curve_of_vertex: Tensor) -> None:
        super().__init__(gliding_terms(CurveFeet(curves, vertices, curve_of_vertex), weight=1.0))
