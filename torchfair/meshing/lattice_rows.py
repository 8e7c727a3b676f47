"""Triangle lattices with rows along one of the two principal curvatures, the other one where that turns faces over."""

from __future__ import annotations

from dataclasses import dataclass, replace

from torch import Tensor

from ..settings.meshing_settings import MeshingSettings
from .components import Pieces, ReadSurface, on_surface
from .counts import mesh_to_count
from .curvature_sizes import CurvatureSizes, curvature_sizes
from .ladder import NoMeshError
from .lattice import triangle_lattice
from .row_distances import row_sizes, rows_across
from .three_valent import with_three_valent_inside
from .turned_over import turned_over


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
        vertices on them, as those along long ellipsoids do at their ends, that turns triangles over. Then rows along
        the other curvature are tried, and taken if they have fewer of those. Notes say so.

        Raises:
            NoMeshError: if there is no valid mesh with the first rows.
        """
        across = rows_across(self.surface.frames, self.surface.directions)
        pieces, spacing = self._along(across)
        over = turned_over(pieces, self.surface)
        if not len(over):
            return pieces, spacing
        notes = []
        other = self._turned(across) if self.settings.fallback else None
        if other is not None and len(other[2]) < len(over):
            spared = _triangles(len(over))
            pieces, spacing, over = other
            names = ("larger", "smaller") if across else ("smaller", "larger")
            notes.append(f"rows follow the {names[0]} curvature: along the {names[1]} one {spared} turned over")
        if len(over):
            place = ", ".join(f"{of:.4g}" for of in pieces.positions[pieces.faces[int(over[0])]].mean(0))
            notes.append(f"{_triangles(len(over))} turned over, one at ({place}): ask for more or fewer, or for quads")
        return replace(pieces, notes=[*pieces.notes, *notes]), spacing

    def _turned(self, across: bool) -> tuple[Pieces, float, Tensor] | None:
        """Along the other curvature, with the faces that are turned over there; None if there is no valid mesh."""
        try:
            pieces, spacing = self._along(not across)
        except NoMeshError:
            return None
        return pieces, spacing, turned_over(pieces, self.surface)

    def _along(self, across: bool) -> tuple[Pieces, float]:
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
        return on_surface(with_three_valent_inside(pieces, surface), surface, settings), spacing


def _triangles(number: int) -> str:
    return "one triangle is" if number == 1 else f"{number} triangles are"
