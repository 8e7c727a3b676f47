"""The spacing that gives about as many faces as are asked for."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

from ..settings.meshing_settings import MeshingSettings
from .components import Pieces, ReadSurface, mesh_components
from .ladder import Again
from .lattice import Lattice
from .no_mesh import NoMeshError

_CORRECTIONS = 4
_SHARE = 1 / 6  # of the time limit, for a correction; all of them may take twice as long
_ENOUGH = 0.08  # by which the count may differ, relative, so that no other spacing is tried
_FAR = 0.25  # beyond that other settings are taken for the sake of the count
_FINEST = 0.5  # of the first spacing: triangles are cut so fine where the count is off by more than is said below
_SAID = 0.15  # by which it may differ without a word
_INSIDE = 0.2  # of the logarithms between two spacings: a third one keeps so far from both
_FINER = 0.7  # of the first spacing, below which triangles are cut finer than for it
_SAME = 0.01  # by which spacings differ, relative: what failed with one will fail with the other
_ROUNDING = 1e-9


def mesh_to_count(
    surface: ReadSurface,
    lattices: list[Lattice],
    spacing: float,
    settings: MeshingSettings,
    count: int | None,
    faces_of: Callable[[Pieces], int],
) -> tuple[Pieces, float]:
    """Meshes with a spacing, then with others until the count is about that asked for; and the spacing taken.

    Directions that turn make lines diverge, so that cells are larger or smaller than the spacing says, and cells that
    the boundary clips are joined. Spacings that are not much smaller than the first are laid on the same triangles:
    finer ones would have other counts. Where none of them comes within 15 %, all is done once more on finer triangles.
    What comes nearest is taken; where it is off by more than 15 % still, a note says so.

    Args:
        surface: with its directions.
        lattices: of the components.
        spacing: to start with.
        settings: of the meshes.
        count: None where the spacing is what was asked for.
        faces_of: how many faces pieces have.

    Raises:
        NoMeshError: if the first spacing gives no valid mesh.
    """
    best = mesh_components(surface, lattices, spacing, settings)
    if count is None:
        return best, spacing
    search = _Search(surface, lattices, settings, count, faces_of, time.process_time())
    best, taken = search.corrected(best, spacing, spacing)
    if search.off(best) > _SAID and (finer := search.laid_again(best, spacing)) is not None:
        other, at = search.corrected(finer, spacing, _FINEST * spacing)
        if search.off(other) <= _SAID:
            best, taken = other, at
    return _told(best, faces_of(best), count), taken


@dataclass(frozen=True)
class _Search:
    """What corrections of the spacing have in common.

    Attributes:
        surface, lattices, settings, count, faces_of: of :func:`mesh_to_count`.
        began: processor time.
    """

    surface: ReadSurface
    lattices: list[Lattice]
    settings: MeshingSettings
    count: int
    faces_of: Callable[[Pieces], int]
    began: float

    def off(self, pieces: Pieces) -> float:
        """By how much the count differs, relative."""
        return abs(self.faces_of(pieces) / self.count - 1)

    @property
    def is_late(self) -> bool:
        """Whether corrections have taken their share of the time."""
        return time.process_time() - self.began > 2 * _SHARE * self.settings.time_limit

    def corrected(self, best: Pieces, spacing: float, resolution: float) -> tuple[Pieces, float]:
        """What comes nearest to the count, and its spacing, from a mesh with a spacing on triangles of a resolution."""
        first, tried, failed, step = resolution, [(spacing, self.faces_of(best))], list[float](), 1.0
        for _ in range(_CORRECTIONS):
            off = self.off(best)
            if off <= _ENOUGH or self.is_late:
                break
            other = spacing * (next_spacing(tried, self.count) / spacing) ** step
            if any(abs(other / before - 1) < _SAME for before in failed):
                break
            again = self._again(best, other, first if other > _FINER * first else other)
            if again is None:
                step /= 2
                failed.append(other)
                continue
            tried.append((other, self.faces_of(again)))
            if self.off(again) < off:
                best, spacing = again, other
        return best, spacing

    def laid_again(self, best: Pieces, spacing: float) -> Pieces | None:
        """A mesh with the first spacing on finer triangles, by any plan that keeps what the best keeps, if any.

        None, too, where triangles are fine enough as they are: all would come out as before.
        """
        if self.is_late or not any(part.is_cut_for(_FINEST * spacing) for part in self.surface.parts):
            return None
        return self._made([Again(0, _FINEST * spacing)] * len(best.plans), spacing, best)

    def _again(self, best: Pieces, spacing: float, resolution: float) -> Pieces | None:
        """The mesh with another spacing; None where there is none, or none as good in all but the count."""
        others = self.off(best) > _FAR
        again = self._made([Again(plan, resolution, others) for plan in best.plans], spacing, best)
        return None if again is None or (len(again.notes) > len(best.notes) and not others) else again

    def _made(self, kept: list[Again], spacing: float, best: Pieces) -> Pieces | None:
        """The mesh with another spacing, if there is one with as many creases."""
        short = replace(self.settings, time_limit=self.settings.time_limit * _SHARE)
        try:
            again = mesh_components(self.surface, self.lattices, spacing, short, kept)
        except NoMeshError:
            return None
        return None if again.creases.length < (1 - _ROUNDING) * best.creases.length else again


def next_spacing(tried: list[tuple[float, int]], count: int) -> float:
    """A spacing that should give the count, from spacings that were tried and their counts.

    Between the nearest counts on both sides, where there are some, on a line through the logarithms; else in
    proportion to the root of the count, from the spacing that went farthest.
    """
    more, fewer = ([pair for pair in tried if (pair[1] > count) == side] for side in (True, False))
    if not (more and fewer):
        spacing, found = min(more or fewer, key=lambda pair: pair[0] if fewer else -pair[0])
        return spacing * math.sqrt(found / count)
    finer, many = min(more, key=lambda pair: (pair[1], -pair[0]))
    coarser, few = max(fewer, key=lambda pair: (pair[1], -pair[0]))
    share = min(max(math.log(count / many) / math.log(few / many), _INSIDE), 1 - _INSIDE)
    return finer * math.exp(share * math.log(coarser / finer))


def _told(pieces: Pieces, found: int, count: int) -> Pieces:
    if abs(found / count - 1) <= _SAID:
        return pieces
    words = f"{found} faces instead of {count}: no spacing that was tried comes nearer; another count may"
    return replace(pieces, notes=[*pieces.notes, words])
