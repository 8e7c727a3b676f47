"""The mesh of one component of a surface."""

from __future__ import annotations

from dataclasses import dataclass, replace

from ..fields.frames import Floats, Ints
from .pose import Pose


@dataclass(frozen=True, eq=False)
class PieceMesh:
    """The mesh of one component.

    Attributes:
        positions: (N, 3).
        faces: nodes counterclockwise; of lattices with rows triangles.
        rows: pairs of nodes, edges with the second coordinate constant.
        creases: (C, 2) nodes of the edges along creases.
        sharp: (n, 2, 3) ends of the edges of the surface that they stand for.
        singular_places, singular_charges: of the field.
    """

    positions: Floats
    faces: list[list[int]]
    rows: set[tuple[int, int]]
    creases: Ints
    sharp: Floats
    singular_places: Floats
    singular_charges: Ints

    def moved(self, pose: Pose) -> PieceMesh:
        """The same where the surface was before it was placed."""
        positions, places = pose.back(self.positions), pose.back(self.singular_places)
        sharp = pose.back(self.sharp.reshape(-1, 3)).reshape(self.sharp.shape)
        return replace(self, positions=positions, singular_places=places, sharp=sharp)
