"""What attempts at the mesh of a component share."""

from __future__ import annotations

from functools import cache

from ..errors import MeshError, SingularSystemError
from ..fields import Directions
from ..settings.meshing_settings import MeshingSettings
from .attempt import attempt
from .combing import combed
from .creases import Creases, find_creases
from .cut_graph import CutGraph
from .failed_attempt import FailedAttemptError
from .lattice import Lattice
from .piece_mesh import PieceMesh
from .plan import Plan
from .surface import DesignSurface

_PATHS = 1.3  # times the merging length of quads: paths along edges are longer than straight ones


class Prepared:
    """What attempts at a component share, each thing made once.

    Attributes:
        surface: of :func:`mesh_component`, in its pose, as all lengths are.
        directions, lattice, settings: of it.
        resolution: length of edges for which triangles are made fine enough.
    """

    def __init__(
        self,
        surface: DesignSurface,
        directions: Directions,
        lattice: Lattice,
        settings: MeshingSettings,
        resolution: float,
    ) -> None:
        self.given, self.surface, self.resolution = surface, surface.placed, resolution
        self.directions = surface.pose.directions(directions)
        self.lattice, self.settings = lattice, settings
        self._finer, self._creases, self._graph = cache(self._cut_finer), cache(self._find_creases), cache(self._combed)

    def attempt(self, plan: Plan) -> PieceMesh:
        """The mesh as planned.

        Raises:
            FailedAttemptError: if there is none.
        """
        graph = self._graph(plan.spacing, plan.smoothing, plan.creases, plan.even)
        creases, triangles = self._creases(plan.spacing, plan.creases), self._finer(plan.creases)[0]
        try:
            return attempt(triangles, creases, graph, self.lattice, plan, self.settings)
        except SingularSystemError:
            raise FailedAttemptError("triangles are too thin to be mapped to the plane") from None

    def _cut_finer(self, kept: bool) -> tuple[DesignSurface, Directions]:
        if kept or not self.surface.sharp.any():
            return self.surface.cut_finer(self.directions, self.resolution)
        plain = self.surface.without_creases()
        directions, _ = self.given.without_creases().directions(self.settings.noise)
        return plain.cut_finer(self.given.pose.directions(directions), self.resolution)

    def _find_creases(self, spacing: float, kept: bool) -> Creases:
        triangles = self._finer(kept)[0]
        return find_creases(triangles.frames, triangles.sharp, self.settings.corner_angle, spacing)

    def _combed(self, spacing: float, smoothing: float, kept: bool, even: float) -> CutGraph:
        triangles, directions = self._finer(kept)
        merging = self.settings.merging * spacing * (1.0 if self.lattice.has_rows else _PATHS)
        creases = self._creases(spacing, kept)
        angle, symmetry = self.settings.boundary_angle, self.lattice.symmetry
        try:
            return combed(triangles.frames, directions, symmetry, smoothing, merging, creases, angle, even=even)
        except MeshError as error:
            raise FailedAttemptError(str(error), hopeless=True) from None
