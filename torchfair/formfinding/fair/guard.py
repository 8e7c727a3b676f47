"""What steps of the job that lowers E may not do."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

from torch import Tensor

from ...energies import normal_variation
from ...geometry import corner_angles, face_areas, face_normals
from ...projection.layout import State
from ...topology import Topology


class FairGuard:
    """Judges the mesh of a state, with gliding vertices on their curves, where barriers see them beside.

    Args:
        vertices: (V, 3) the start.
        topology: Connectivity.
        placed: The vertices (V, 3) of the mesh of a state.
        smallest_angle: No corner angle may be smaller, radians.
        smallest_area: No face may be smaller than this fraction of its area at the start.
        from_last: Faces may not turn over against the last state, rather than against the start.
    """

    def __init__(
        self,
        vertices: Tensor,
        topology: Topology,
        placed: Callable[[State], Tensor],
        *,
        smallest_angle: float,
        smallest_area: float,
        from_last: bool,
    ) -> None:
        self.vertices, self.topology, self.placed = vertices, topology, placed
        self._smallest_angle, self._from_last = smallest_angle, from_last
        self._smallest_areas = smallest_area * face_areas(vertices, topology)

    def keeps_faces(self, state: State, trial: State) -> bool:
        """Whether no face turns over."""
        before = face_normals(self.placed(state), self.topology) if self._from_last else self._normals
        after = face_normals(self.placed(trial), self.topology)
        return bool(((before * after).sum(1) > 0.0).all())

    def keeps_bounds(self, trial: State) -> bool:
        """Whether no corner angle and no face area falls below its bound where gliding vertices are put in place."""
        after = self.placed(trial)
        if after is trial["vertices"]:
            return True  # barriers see the same mesh
        angles, areas = corner_angles(after, self.topology), face_areas(after, self.topology)
        return bool((angles >= self._smallest_angle).all() & (areas >= self._smallest_areas).all())

    def keeps_energy(self, trial: State) -> bool:
        """Whether E does not rise above that of the start."""
        return float(normal_variation(self.placed(trial), self.topology)) <= self._energy

    @cached_property
    def _energy(self) -> float:
        return float(normal_variation(self.vertices, self.topology))

    @cached_property
    def _normals(self) -> Tensor:
        return face_normals(self.vertices, self.topology)
