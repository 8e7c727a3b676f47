"""What steps of the job that lowers E may not do."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

from torch import Tensor

from ...energies import normal_variation
from ...geometry import corner_angles, face_area_vectors
from ...geometry._ops import dot, norm
from ...projection.layout import State
from ...topology import Topology
from .crossing_sides import crossing_sides
from .short_sides import ShortSides

_UPRIGHT = 1e-9  # cosine of a face with itself at the start: on the edge, rounding decides what is measured


class FairGuard:
    """Judges the mesh of a state, with gliding vertices on their curves, where barriers see them beside.

    Args:
        vertices: (V, 3) the start.
        topology: Connectivity.
        placed: The vertices (V, 3) of the mesh of a state.
        smallest_angle: No corner angle may be smaller, radians.
        smallest_areas: (F,) no face may be smaller.
        sides: Of polygons with more than three corners.
        smallest_edge: None of them may be shorter than this fraction of their lengths.
        largest_areas: (F,) no face may be larger; None for no bound.
        from_last: Faces may not turn over against the last state, rather than against the start.
        may_turn: With ``from_last``, whether a face may turn over against the start, step by step.
    """

    def __init__(
        self,
        vertices: Tensor,
        topology: Topology,
        placed: Callable[[State], Tensor],
        *,
        smallest_angle: float,
        smallest_areas: Tensor,
        sides: ShortSides,
        smallest_edge: float,
        largest_areas: Tensor | None,
        from_last: bool,
        may_turn: bool,
    ) -> None:
        self.topology, self.placed = topology, placed
        self._smallest_angle, self._from_last = smallest_angle, from_last
        self._largest_areas, self._may_turn = largest_areas, may_turn
        self._sides, self._smallest_edge = sides, smallest_edge
        self._start = _Mesh(vertices, topology)
        self._smallest_areas, self._upright = smallest_areas, _UPRIGHT * norm(self._start.area_vectors)
        self._known: list[tuple[Tensor, _Mesh]] = []

    def keeps_faces(self, state: State, trial: State) -> bool:
        """Whether no face turns over."""
        start, after = self._start.area_vectors, self._mesh(trial).area_vectors
        upright = dot(start, after) > self._upright * norm(after)
        if not self._from_last:
            return bool(upright.all())
        before = self._mesh(state).area_vectors
        kept = dot(before, after) > 0.0
        if not self._may_turn:
            kept = kept & (upright | (dot(start, before) <= 0.0))
        return bool(kept.all())

    def keeps_sides_apart(self, state: State, trial: State) -> bool:
        """Whether no sides of a face cross that did not, unless faces may turn over."""
        return self._may_turn or not bool((self._mesh(trial).crossing & ~self._mesh(state).crossing).any())

    def keeps_bounds(self, trial: State) -> bool:
        """Whether no corner angle, side or area falls below its bound where gliding vertices are put in place."""
        after = self._mesh(trial)
        if after.vertices is trial["vertices"]:
            return True  # barriers see the same mesh
        if not bool((norm(after.area_vectors) >= self._smallest_areas).all()):
            return False
        if self._largest_areas is not None and not bool((norm(after.area_vectors) <= self._largest_areas).all()):
            return False
        if not bool((self._sides.shares(after.vertices, self.topology) >= self._smallest_edge).all()):
            return False
        return bool((corner_angles(after.vertices, self.topology) >= self._smallest_angle).all())

    def keeps_energy(self, state: State, trial: State) -> bool:
        """Whether E does not rise above that of the start, or where handles had raised it, above that of the state."""
        energy = self._mesh(trial).energy
        return energy <= self._start.energy or energy <= self._mesh(state).energy

    def energy(self, state: State) -> float:
        """E of the mesh of a state."""
        return self._mesh(state).energy

    def _mesh(self, state: State) -> _Mesh:
        """That of a state; the two that were asked for last are kept: the state, and the trial that may follow it."""
        vertices = state["vertices"]
        mesh = next((mesh for known, mesh in self._known if known is vertices), None)
        mesh = mesh or _Mesh(self.placed(state), self.topology)
        self._known = [(vertices, mesh), *[pair for pair in self._known if pair[0] is not vertices][:1]]
        return mesh


class _Mesh:
    """A mesh and what is asked about it, found when it is asked for first."""

    def __init__(self, vertices: Tensor, topology: Topology) -> None:
        self.vertices, self._topology = vertices, topology

    @cached_property
    def area_vectors(self) -> Tensor:
        return face_area_vectors(self.vertices, self._topology)

    @cached_property
    def crossing(self) -> Tensor:
        return crossing_sides(self.vertices, self._topology)

    @cached_property
    def energy(self) -> float:
        return float(normal_variation(self.vertices, self._topology))
