"""Triangle lattices with rows along one of the two principal curvatures, the other one where that turns faces over."""

from __future__ import annotations

from dataclasses import dataclass, replace

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
        over = len(turned_over(pieces, self.surface))
        if not over:
            return pieces, spacing
        left = over
        if self.settings.fallback:
            try:
                others, other_spacing = self._along(not across)
            except NoMeshError:
                pass
            else:
                left = min(over, len(turned_over(others, self.surface)))
        names = ("smaller", "larger") if across else ("larger", "smaller")
        notes = []
        if left < over:
            pieces, spacing = others, other_spacing
            spared = f"along the {names[0]} one {_triangles(over)} turned over"
            notes.append(f"rows follow the {names[1]} curvature: {spared}")
        if left:
            place = pieces.positions[pieces.faces[int(turned_over(pieces, self.surface)[0])]].mean(0)
            where = ", ".join(f"{of:.4g}" for of in place)
            notes.append(f"{_triangles(left)} turned over, one at ({where}): ask for more or fewer, or for quads")
        return replace(pieces, notes=[*pieces.notes, *notes]), spacing

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
