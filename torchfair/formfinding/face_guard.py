"""The guard of damped steps that keeps faces from turning over."""

from __future__ import annotations

import math
from collections.abc import Callable

from torch import Tensor

from ..geometry import corner_angles, dihedral_angles, face_area_vectors
from ..geometry._ops import dot
from ..projection.layout import State
from ..topology import Topology


class FaceGuard:
    """Refuses steps in which a face turns over: a guard for :func:`~torchfair.projection.guided_projection`.

    The area vectors of the last trials are kept, since the state of a step is most often the trial of the one before.

    Args:
        topology: Of the mesh.
        place: The vertices (V, 3) of a state.
        least_angle: Refuses also steps that lead to a smaller corner angle, radians.
        steepest: Refuses also steps that lead to a larger dihedral angle of either sign, radians.
    """

    def __init__(
        self, topology: Topology, place: Callable[[State], Tensor], least_angle: float = 0.0, steepest: float = math.pi
    ) -> None:
        self._topology, self._place, self._least_angle, self._steepest = topology, place, least_angle, steepest
        self._known: list[tuple[State, Tensor]] = []

    def __call__(self, state: State, trial: State) -> bool:
        """Whether every face of the trial is seen from the side it is seen from in the state, within the bounds."""
        if not bool((dot(self._areas(state), self._areas(trial)) > 0.0).all()):
            return False
        if self._least_angle <= 0.0 and self._steepest >= math.pi:
            return True
        vertices, topology = self._place(trial), self._topology
        thin = bool((corner_angles(vertices, topology) < self._least_angle).any())
        return not thin and not bool((dihedral_angles(vertices, topology).abs() > self._steepest).any())

    def _areas(self, state: State) -> Tensor:
        for known, areas in self._known:
            if known is state:
                return areas
        areas = face_area_vectors(self._place(state), self._topology)
        self._known = [(state, areas), *self._known[:2]]
        return areas
