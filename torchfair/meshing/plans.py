"""What is tried for a mesh, one plan after the other, and what can be left out."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from ..settings.meshing_settings import MeshingSettings
from .plan import Plan

_SMOOTHER = (1.0, 4.0, 16.0, 64.0)  # times the smoothing length
_ROWS = ((1.0, 0.0), (1.0, 0.3), (1.0, 10.0), (4.0, 0.0), (1.0, 0.3), (1.0, 10.0), (4.0, 3.0), (16.0, 0.0), (64.0, 0.0))
"""The same for lattices with rows, and how crosses are made even; at first where the plan before failed by far."""

SCALES = (1.0, 0.967, 1.037, 0.934, 1.08)
"""Of spacings: counts up and down by 7 and 15 %."""

Kind = tuple[float, bool, bool, float]


class Rung(NamedTuple):
    """A plan, how in words it differs from what was asked for, and by which factors.

    Attributes:
        early: whether it is for surfaces on which the same without even crosses failed by far.
    """

    plan: Plan
    words: str
    scale: float
    smoother: float
    early: bool

    @property
    def kind(self) -> Kind:
        """What it has in common with plans of a spacing a little different."""
        return self.smoother, self.plan.align, self.plan.creases, self.plan.even

    def is_worth_it(self, hopeless: set[Kind]) -> bool:
        """Whether to try it when plans of some kinds failed by far."""
        return self.kind not in hopeless and (not self.early or (*self.kind[:3], 0.0) in hopeless)


def plans(
    spacing: float,
    smoothing: float,
    settings: MeshingSettings,
    creased: bool = False,
    rows: bool = False,
    bounded: bool = True,
) -> Iterator[Rung]:
    """What is tried, one after the other; without the creases at last, where there are any.

    Args:
        spacing: length of edges.
        smoothing: of directions, over the spacing.
        settings: of the mesh.
        creased: whether there are creases.
        rows: whether the lattice has rows, which may follow either of two principal directions.
        bounded: whether there is a boundary; without one there is nothing to align to but creases.
    """
    for kept in (True, False) if creased else (False,):
        can_align = (settings.align_boundary and bounded) or kept
        curves = "boundary and creases" if kept else "boundary"
        for scale in SCALES:
            for number, (smoother, even) in enumerate(_ROWS if rows else [(of, 0.0) for of in _SMOOTHER]):
                for align in (True, False) if can_align else (False,):
                    words = [
                        "creases not kept" if creased and not kept else "",
                        f"directions smoothed over {smoothing * smoother:g} edges" if smoother != 1 else "",
                        "rows not along the same principal curvature everywhere" if even else "",
                        f"{curves} not aligned" if can_align and not align else "",
                        scaled_words(scale) if scale != 1 else "",
                    ]
                    plan = Plan(spacing * scale, spacing * smoothing * smoother, align, kept, even)
                    yield Rung(plan, ", ".join(filter(None, words)), scale, smoother, even > 0 and number < 3)


def scaled_words(scale: float) -> str:
    """How many more or fewer faces there are with spacings scaled by a factor."""
    return f"{abs(scale**-2 - 1):.0%} {'more' if scale < 1 else 'fewer'} faces"
