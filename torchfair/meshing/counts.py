"""The spacing that gives about as many faces as are asked for."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace

from ..settings.meshing_settings import MeshingSettings
from .components import Pieces, ReadSurface, mesh_components
from .ladder import Again, NoMeshError
from .lattice import Lattice

_CORRECTIONS = 4
_SHARE = 1 / 6  # of the time limit, for a correction; all of them may take twice as long
_ENOUGH = 0.08  # by which the count may differ, relative, so that no other spacing is tried
_FAR = 0.25  # beyond that other settings are taken for the sake of the count
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
    finer ones would have other counts. What comes nearest is taken; where it is off by more than 15 %, a note says so.

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
    first, tried, step, began = spacing, [(spacing, faces_of(best))], 1.0, time.process_time()
    failed: list[float] = []
    short = replace(settings, time_limit=settings.time_limit * _SHARE)
    for _ in range(_CORRECTIONS):
        off = abs(faces_of(best) / count - 1)
        if off <= _ENOUGH or time.process_time() - began > 2 * short.time_limit:
            break
        other = spacing * (next_spacing(tried, count) / spacing) ** step
        if any(abs(other / before - 1) < _SAME for before in failed):
            break
        again = _again(surface, lattices, (other, first), short, best, off)
        if again is None:
            step /= 2
            failed.append(other)
            continue
        tried.append((other, faces_of(again)))
        if abs(faces_of(again) / count - 1) < off:
            best, spacing = again, other
    return _told(best, faces_of(best), count), spacing


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


def _again(
    surface: ReadSurface,
    lattices: list[Lattice],
    spacings: tuple[float, float],
    settings: MeshingSettings,
    best: Pieces,
    off: float,
) -> Pieces | None:
    """The mesh with another spacing than the first; None where there is none, or none as good in all but the count."""
    spacing, first = spacings
    resolution = first if spacing > _FINER * first else spacing
    try:
        kept = [Again(plan, resolution, others=off > _FAR) for plan in best.plans]
        again = mesh_components(surface, lattices, spacing, settings, kept)
    except NoMeshError:
        return None
    lost = again.creases.length < (1 - _ROUNDING) * best.creases.length
    changed = len(again.notes) > len(best.notes) and off <= _FAR
    return None if lost or changed else again


def _told(pieces: Pieces, found: int, count: int) -> Pieces:
    if abs(found / count - 1) <= _SAID:
        return pieces
    words = f"{found} faces instead of {count}: no spacing that was tried comes nearer; another count may"
    return replace(pieces, notes=[*pieces.notes, words])
