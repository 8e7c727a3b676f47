"""Triangle lattices with rows along one of the two principal curvatures, the other one where that turns faces over."""

from __future__ import annotations

import itertools
import time
from dataclasses import dataclass, replace
from typing import NamedTuple

import torch
from torch import Tensor

from ..energies import NormalVariation
from ..settings.meshing_settings import MeshingSettings
from ..topology import Topology
from .alignment import aligned
from .components import Pieces, ReadSurface, on_surface
from .counts import mesh_to_count
from .curvature_sizes import CurvatureSizes, curvature_sizes
from .lattice import triangle_lattice
from .no_mesh import NoMeshError
from .plans import SCALES, scaled_words
from .row_distances import row_sizes, rows_across
from .thin_triangles import kept_vertices, without_thin_triangles
from .three_valent import with_three_valent_inside
from .turned_over import counted, told, turned_over
from .unfolding import unfolded

_COARSE = 5000  # vertices: edges of finer meshes are no longer chords of lines that turn, and little is won
_SAID = 0.15  # by which a count may differ without a word


class _Laid(NamedTuple):
    """Triangles with their spacing.

    Attributes:
        across: whether rows follow the smaller curvature.
        faces: those that are turned over.
        unfolded: whether vertices had to move so that no more are.
        words: how many more or fewer there are than was asked for.
    """

    pieces: Pieces
    spacing: float
    across: bool
    faces: Tensor
    unfolded: bool
    words: str = ""

    @property
    def over(self) -> int:
        """How many triangles are turned over."""
        return len(self.faces)

    def rank(self) -> tuple[int, float]:
        """Triangles that are turned over, and E."""
        positions = torch.from_numpy(self.pieces.positions)
        return self.over, float(NormalVariation(Topology.from_faces(self.pieces.faces, len(positions)))(positions))


@dataclass(frozen=True, eq=False)
class RowLattice:
    """What triangles are laid by, but for which curvature their rows follow.

    Attributes:
        surface: with its directions.
        ratio: distance of rows over the spacing along them.
        spacing: along rows, to start with.
        count: of triangles, None where the spacing is what was asked for.
        settings: of the mesh.
    """

    surface: ReadSurface
    ratio: float
    spacing: float
    count: int | None
    settings: MeshingSettings

    def laid(self) -> tuple[Pieces, float]:
        """Triangles and their spacing, with rows along the curvature for which E is low where K is negative.

        Rows that turn back around an umbilic are cut short by the edges on them. Where they lie much closer than
        vertices on them, as those along long ellipsoids do at their ends, that turns triangles over, and vertices move:
        see :func:`unfolded`. Then rows along the other curvature are tried, too, and taken if fewer triangles are
        turned over with them or, of as many, E is lower. Where there are some still, 7 and 15 % more or fewer triangles
        are tried with both, until there are none. Notes say so.

        Raises:
            NoMeshError: if there is no valid mesh with the first rows.
        """
        across = rows_across(self.surface.frames, self.surface.directions)
        began, first = time.process_time(), self._along(across)
        best, spacings = first, {across: first.spacing}
        if not (first.over or first.unfolded) or not self.settings.fallback:
            return self._told(first, first)
        if (other := self._tried(not across, "")) is not None:
            spacings[not across] = other.spacing
            best = min(best, other, key=_Laid.rank)
        for scale, (way, spacing) in itertools.product(SCALES[1:], spacings.items()):
            if not best.over or time.process_time() - began > self.settings.time_limit / 2:
                break
            near = replace(self, spacing=spacing * scale, count=None)
            other = near._tried(way, scaled_words(scale))
            if other is not None and self._off(other) <= max(self._off(best), _SAID):
                best = min(best, other, key=_Laid.rank)
        return self._told(best, first)

    def _told(self, made: _Laid, first: _Laid) -> tuple[Pieces, float]:
        """A mesh with notes on what differs from the first one, and its spacing."""
        notes, spared = [], counted(first.over)
        if made.across != first.across:
            names = ("larger", "smaller") if first.across else ("smaller", "larger")
            why = f"{spared} turned over" if first.over else "triangles were turned over, and without those E is higher"
            notes.append(f"rows follow the {names[0]} curvature: along the {names[1]} one {why}")
        if made.words:
            notes.append(f"{made.words}: as asked for, {spared} turned over")
        if len(made.faces):
            notes.append(told(made.pieces, made.faces, "triangle", "quads"))
        return replace(made.pieces, notes=[*made.pieces.notes, *notes]), made.spacing

    def _off(self, made: _Laid) -> float:
        """By how much the count differs, relative."""
        return 0.0 if self.count is None else abs(len(made.pieces.faces) / self.count - 1)

    def _tried(self, across: bool, words: str) -> _Laid | None:
        """As :meth:`_along`; None if there is no valid mesh."""
        try:
            return self._along(across)._replace(words=words)
        except NoMeshError:
            return None

    def _along(self, across: bool) -> _Laid:
        """With rows along the smaller curvature (``across``), or along the larger one."""
        surface, settings = self.surface, self.settings

        def sizing(at: float) -> CurvatureSizes:
            frames = surface.smooth_frames
            sizes = curvature_sizes(frames, surface.directions, at, settings.spacing_range, isotropic=True)
            field = row_sizes(sizes.field, frames, surface.directions, across, self.ratio, at)
            return CurvatureSizes(field, sizes.limited)

        laid = replace(
            surface,
            fields=[of.turned for of in surface.fields] if across else surface.fields,
            sizing=sizing if settings.adaptive else None,
        )
        lattices = [triangle_lattice(self.ratio)] * len(surface.parts)
        pieces, spacing = mesh_to_count(
            laid, lattices, self.spacing, settings, self.count, lambda made: len(made.faces)
        )
        inside = with_three_valent_inside(pieces, surface)
        pieces = unfolded(inside, surface)
        has_moved = pieces is not inside
        if len(pieces.positions) <= _COARSE and not (settings.adaptive and settings.spacing_range > 1):
            pieces = aligned(pieces, surface, spacing, settings, has_rows=True)
        pieces = on_surface(pieces, surface, settings)
        pieces = without_thin_triangles(pieces, surface, kept_vertices(pieces, surface, settings, spacing))
        return _Laid(pieces, spacing, across, turned_over(pieces, surface), has_moved)
