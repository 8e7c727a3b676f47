"""What a job is: the one thing that has to be written for a new one."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import ClassVar, Generic, Protocol, TypeVar

import torch
from torch import Tensor

from ...errors import MeshError, SettingsError
from ...normalisation import Normalisation
from ...projection import ElementTerm, ProjectionResult, ProjectionSettings
from ...projection.layout import State
from ...topology import Topology
from ..checks import one_start, refuse_degenerate_faces
from ..handles import read_handles, vertex_numbers
from .plan import OneStage, Plan, Stage, at_rest
from .promises import Promise
from .pulls import Pulls
from .result import Level


class JobSettings(Protocol):
    """What the settings of every job have."""

    @property
    def projection(self) -> ProjectionSettings:
        """Iterations, tolerances, damping and linear solver; the time limit is that of a whole solve."""


S = TypeVar("S", bound=JobSettings)


class Recipe(ABC, Generic[S]):
    """A job on one mesh: what is asked of it and what is promised.

    Everything is solved centred and with unit mean edge length, so that weights are dimensionless and results do not
    depend on the unit of the input.

    Args:
        vertices: (V, 3) start.
        topology: Its connectivity.
        settings: Weights, bounds and tolerances.

    Attributes:
        name: Of the job, a word.
        given: (V, 3) start as float64, in the unit of the input.
        start: (V, 3) the same, normalised.
        unit: Between both.
        pulls: Handles and held vertices.
        notes: Decisions taken, in words.

    Raises:
        ShapeError: vertices are not ``(V, 3)``.
        MeshError: vertices are not finite, or a face has no area.
    """

    name: ClassVar[str]

    def __init__(self, vertices: Tensor, topology: Topology, settings: S) -> None:
        given, self.topology = one_start(vertices, topology), topology.to("cpu")
        self.settings = settings
        self.notes: list[str] = []
        self.start_at(given)
        refuse_degenerate_faces(given, self.topology)

    def start_at(self, vertices: Tensor) -> None:
        """Starts from these places (V, 3) float64, in the unit of the input; before anything is pulled."""
        self.given, self.unit = vertices, Normalisation.of(vertices, self.topology)
        self.start = _with_unused_in_place(self.unit.apply(vertices), self.topology)
        self.pulls = Pulls(self.start)

    # ---- what is solved --------------------------------------------------------------------------------

    @abstractmethod
    def plan(self, state: State) -> Plan:
        """The whole job, from a state on."""

    @abstractmethod
    def follower(self, state: State) -> Stage:
        """What one step of a live session lowers, from a state on."""

    def predicted(self, state: State) -> State:
        """Where a live step begins once handles have moved, by default where the mesh is."""
        return state

    def settling(self, state: State, damping: float | None) -> Plan:
        """What a live session does once handles are let go: by default what its steps do, until one changes little.

        Args:
            state: Where the mesh is.
            damping: Of the last live step; None if there was none.
        """
        return OneStage(at_rest(self.follower(state), damping))

    def final(self, state: State) -> Stage:
        """What the finished mesh is the minimum of, from a state near it on; for :class:`JobLayer`.

        Raises:
            SettingsError: the job, or its settings, end otherwise.
        """
        raise SettingsError(f"the job '{self.name}' does not end in a minimum that could be differentiated")

    sees_itself: ClassVar[bool] = False
    """Whether terms of :meth:`final` depend on the mesh of the state, as on what fairness finds even there."""

    def terms_seen_from(self, stage: Stage, vertices: Tensor) -> Sequence[ElementTerm]:
        """Terms of a final stage as differentiable functions of the vertices (V, 3), normalised, they are seen from."""
        return stage.terms()

    def state(self) -> State:
        """Variable blocks at the start."""
        return self.blocks(self.start)

    def state_at(self, vertices: Tensor) -> State:
        """Variable blocks for vertices (V, 3) in the unit of the input; those that no face uses stay out of the way."""
        unused = (self.topology.valences == 0)[:, None]
        return self.blocks(torch.where(unused, self.start, self.unit.apply(vertices)))

    def blocks(self, vertices: Tensor) -> State:
        """Variable blocks that fit vertices (V, 3) in the unit of the problem."""
        return {"vertices": vertices}

    def placed(self, state: State) -> Tensor:
        """The vertices (V, 3) of the mesh of a state."""
        return state["vertices"]

    def observe(self, state: State) -> dict[str, float]:
        """What the history holds of a state; lengths in the unit of the input."""
        return {}

    def stays(self) -> Tensor:
        """(V,) bool, vertices that the job itself does not move."""
        return self.topology.valences == 0

    @property
    def fixed(self) -> dict[str, Tensor]:
        """Mask of the unknowns of vertices that do not move."""
        return {"vertices": self.stays() | self.pulls.held}

    @property
    def glides(self) -> bool:
        """Whether some vertices glide on curves, on which the mesh of a state has them exactly."""
        return False

    def take_reference(self, reference: tuple[Tensor, Topology]) -> None:
        """Takes another mesh, in the unit of the input, for the surface to stay close to; before a plan is made.

        Raises:
            SettingsError: the job knows no reference.
        """
        raise SettingsError(f"the job '{self.name}' has no reference surface")

    def trace_reference(self, vertices: Tensor) -> None:
        """Makes terms from now on differentiable functions of the vertices (R, 3) of the reference that was taken."""

    def take_settings(self, settings: S) -> None:
        """Other weights, of the same kind."""
        self.settings = settings
        self.pulls.version += 1

    # ---- handles ---------------------------------------------------------------------------------------

    def fix(self, fixed: Iterable[int], handles: Iterable[int]) -> None:
        """Holds vertices of the start where they are.

        Raises:
            MeshError: one is no vertex, or is pulled.
        """
        chosen = sorted(set(fixed))
        numbers = vertex_numbers(chosen, self.topology, "fixed: ")
        both = sorted(set(chosen) & set(handles))
        if both:
            raise MeshError(f"vertices cannot be fixed and pulled at once: {both[:5]}")
        if chosen:
            self.pulls.hold(numbers)
            self.notes.append(fixed_note(len(numbers)))

    def pull(self, places: Mapping[int, Sequence[float]]) -> None:
        """Pulls vertices to places in the unit of the input.

        Raises:
            ShapeError: a target is not a point with finite coordinates.
            MeshError: a handle is no vertex, or one that does not move.
        """
        vertices, targets = read_handles(places, self.topology)
        self.check_pulls(vertices, targets)
        self.pulls.pull(vertices, self.unit.apply(targets))
        self.reconsider()

    @property
    def handles(self) -> dict[int, list[float]]:
        """Where vertices are pulled, in the unit of the input, by their numbers in order."""
        vertices = self.pulls.vertices
        places = self.unit.invert(self.pulls.targets[vertices])
        return dict(zip(vertices.tolist(), places.tolist(), strict=True))

    def reconsider(self) -> None:
        """Called after handles or held vertices have changed, for decisions that depend on them."""

    def put_at(self, state: State) -> None:
        """Called once a mesh was put elsewhere, for bounds that it does not keep there: it may come back to them."""

    def check_pulls(self, vertices: Tensor, targets: Tensor) -> None:
        """Refuses handles ``vertices`` (n,) whose ``targets`` (n, 3), in the unit of the input, cannot be reached."""

    # ---- what comes of it ------------------------------------------------------------------------------

    def vertices(self, state: State) -> Tensor:
        """(V, 3) of a state in the unit of the input; those that have not moved are exactly as given."""
        placed = self.placed(state)
        return torch.where((placed == self.start).all(1, keepdim=True), self.given, self.unit.invert(placed))

    @abstractmethod
    def measures(self, vertices: Tensor) -> dict[str, float]:
        """Energies and what is promised, of vertices (V, 3) in the unit of the input."""

    def before(self) -> dict[str, float]:
        """Measures of what the job was given."""
        return self.measures(self.given)

    def after(self, vertices: Tensor, before: dict[str, float]) -> dict[str, float]:
        """Measures of a result (V, 3); those of the start are ``before``."""
        return self.measures(vertices)

    def promises(self, before: Mapping[str, float], after: Mapping[str, float]) -> list[Promise]:
        """What was asked for and what was reached, from measures."""
        return []

    def level(self, state: State, before: dict[str, float], runs: list[ProjectionResult], like: Tensor) -> Level:
        """What is returned of a state, in the dtype and on the device of ``like``."""
        vertices = self.given if self.is_untouched(state, runs) else self.vertices(state)
        after = self.after(vertices, before)
        promises = self.promises(before, after)
        return Level(vertices.to(like), self.topology, before, after, runs, promises)

    def is_untouched(self, state: State, runs: Sequence[ProjectionResult]) -> bool:
        """Whether nothing has become of the start, which is then returned as it was given, and not measured again."""
        return False

    def refined(self, state: State) -> Recipe[S]:
        """The same job on a refinement of the mesh of a state."""
        raise MeshError(f"the job '{self.name}' works on one mesh and does not refine it")

    def renewed(self, state: State) -> Recipe[S] | None:
        """The same job with other faces on the surface of a state, asked for where promises are broken; None: none."""
        return None

    def snapshot(self) -> Callable[[], None]:
        """A function that puts back what runs change in the job itself, beside pulls and settings."""
        return lambda: None

    def forget(self) -> None:
        """Forgets what may not be whole after an interruption, such as searches for closest points."""


def _with_unused_in_place(vertices: Tensor, topology: Topology) -> Tensor:
    """Vertices that no face uses put where one that is used stands, so that no size is measured by them."""
    unused = topology.valences == 0
    return torch.where(unused[:, None], vertices[topology.corners[:1]], vertices) if unused.any() else vertices


def fixed_note(count: int) -> str:
    """How a job says that so many vertices are fixed."""
    return f"{count} vertices are fixed" if count > 1 else "1 vertex is fixed"
