"""Surfaces of minimal total absolute curvature with given boundary (paper sections 4 and 5.3)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

import torch
from torch import Tensor

from ...curves import ClosedCurve
from ...energies import total_absolute_curvature
from ...errors import MeshError, SettingsError
from ...projection import ElementTerm, ProjectionResult
from ...projection.layout import State
from ...settings.form_settings import FormSettings
from ...subdivision import catmull_clark, loop
from ...topology import Topology
from ...triangulation import triangulate
from ..handles import refuse_unreachable_handles
from ..job import Level, Plan, Promise, Recipe, Stage
from .even_mesh import even_mesh
from .follower import FormFollower, SettlingPlan
from .measures import form_measures, form_promises, warp_notes
from .other_starts import Start, other_starts
from .plan import FormPlan
from .problem import FormProblem, staying_vertices
from .rim import Rim, check_rim
from .several_starts import FAR, SeveralStarts
from .stages import in_space


class FormRecipe(Recipe[FormSettings]):
    """Lowers C; see :func:`~torchfair.formfinding.minimise_absolute_curvature`.

    Args:
        vertices, topology, curves, normals, settings: See :func:`~torchfair.formfinding.minimise_absolute_curvature`.
        handles, fixed: Likewise; more of them may be pulled or held later.
        rim: Curves and normals of a coarser mesh, carried on to its refinement, instead of ``curves`` and ``normals``;
            the vertices are then taken to be near the solution.
        starts, remesh: See :func:`~torchfair.formfinding.minimise_absolute_curvature`.

    Attributes:
        rim: What is asked along the boundary.
    """

    name = "form"

    def __init__(
        self,
        vertices: Tensor,
        topology: Topology,
        *,
        curves: Sequence[ClosedCurve] | None = None,
        normals: Tensor | None = None,
        handles: Mapping[int, Sequence[float]] | None = None,
        settings: FormSettings | None = None,
        rim: Rim | None = None,
        starts: int = 1,
        remesh: bool = False,
        fixed: Iterable[int] = (),
    ) -> None:
        super().__init__(vertices, topology, settings or FormSettings())
        check_rim(self.given, self.topology, curves)
        self._starts, self._remesh = starts, remesh
        self._input, self._nearby, topology = self.given, rim is not None, self.topology
        self.rim = rim or Rim.of(self.given, topology, curves, normals, self.settings.corner_angle)
        self.start_at(self.rim.track.positions(self.given))
        triangles = topology
        if not topology.is_triangular:
            self.notes.append("faces with more than three corners are cut into triangles while C is lowered")
            triangles = Topology.from_faces(triangulate(self.given, topology).triangles, topology.num_vertices)
        self.problem = FormProblem(triangles, self.unit, self.rim, self.pulls, self.settings)
        self._follower = FormFollower(self.problem)
        self.fix(fixed, handles or {})
        self.pull(handles or {})

    def take_settings(self, settings: FormSettings) -> None:
        """Takes other weights."""
        super().take_settings(settings)
        self.problem.settings = settings

    def check_pulls(self, vertices: Tensor, targets: Tensor) -> None:
        """Refuses handles ``vertices`` (n,) on a boundary that stays, with ``targets`` (n, 3) elsewhere."""
        refuse_unreachable_handles(vertices, targets, self.given, self.stays())

    def plan(self, state: State) -> Plan:
        """Along normals with decreasing smoothing, then in space; from several starts where there are some."""
        self._follower.forget()
        far = self.pulls.farthest(state["vertices"]) > FAR
        if self._nearby or self.settings.formulation == "lifted" or not (self._starts > 1 or far):
            return FormPlan(self.problem, state, nearby=self._nearby)
        given = Start("as given", state["vertices"])
        others = other_starts(given.vertices, self.problem.topology, self._starts - 1) if self._starts > 1 else []
        return SeveralStarts(self.problem, [given, *others], self.notes.append)

    def predicted(self, state: State) -> State:
        """Cones around handles."""
        return self._follower.predicted(state)

    def follower(self, state: State) -> Stage:
        """In space, with the last smoothing."""
        return self._follower.stage(state)

    def final(self, state: State) -> Stage:
        """In space, with the last smoothing and with fairness as the surface of the state asks for it."""
        if self.settings.formulation != "reduced":
            raise SettingsError(f"formulation {self.settings.formulation!r} has no layer: take 'reduced'")
        if self.problem.has_tangent_planes:
            raise SettingsError("prescribed normals have no layer: the job ends with patches that it freezes")
        self.pulls.aim(1.0, state["vertices"])
        return in_space(self.problem, state["vertices"], self.settings.smoothing, self.settings.projection)

    sees_itself = True

    def terms_seen_from(self, stage: Stage, vertices: Tensor) -> list[ElementTerm]:
        """With smoothing and the even part of fairness as functions of them."""
        return self.problem.traced_terms(vertices, self.settings.smoothing)

    @property
    def glides(self) -> bool:
        """The boundary, if the settings say so."""
        return self.problem.glides

    def settling(self, state: State, damping: float | None) -> SettlingPlan:
        """From where the surface is and from the start, whichever is better."""
        self._follower.forget()
        return SettlingPlan(self.problem, state, self.start, nearby=self._nearby)

    def snapshot(self) -> Callable[[], None]:
        """What following remembers."""
        return self._follower.snapshot()

    def observe(self, state: State) -> dict[str, float]:
        """C, in the unit of the input."""
        found = float(total_absolute_curvature(state["vertices"], self.problem.topology))
        return {"total_absolute_curvature": self.unit.length * found}

    def stays(self) -> Tensor:
        """The boundary or, where that glides, its corners; isolated vertices."""
        return staying_vertices(self.topology, self.rim.track, self.settings)

    def forget(self) -> None:
        """Searches for closest points begin anew."""
        self.problem.forget()
        self._follower.forget()

    def vertices(self, state: State) -> Tensor:
        """(V, 3) of a state in the unit of the input; gliding boundary vertices are on their curves."""
        vertices = super().vertices(state)
        return self._on_the_rim(vertices) if self.problem.glides else vertices

    def before(self) -> dict[str, float]:
        """Measures of the input, before its boundary is moved onto the curves; notes where it runs through itself."""
        measures = self.measures(self._input)
        if measures["self_intersections"] and not self._nearby:
            count = measures["self_intersections"]
            self.notes.append(f"the start runs through itself: {count} pair(s) of faces meet")
        return measures

    def measures(self, vertices: Tensor) -> dict[str, float]:
        """See ``form_measures``."""
        away = self.unit.length * self.pulls.away(self.unit.apply(vertices))
        return form_measures(vertices, self.topology, self._on_the_rim(vertices), self.rim.normals, away)

    def promises(self, before: Mapping[str, float], after: Mapping[str, float]) -> list[Promise]:
        """See ``form_promises``."""
        handles, normals = bool(self.pulls.pulled.any()), self.problem.has_tangent_planes
        return form_promises(self.settings, before, after, handles=handles, normals=normals, remesh=self._remesh)

    def level(self, state: State, before: dict[str, float], runs: list[ProjectionResult], like: Tensor) -> Level:
        """What is returned of a state; notes where faces have lost their planarity."""
        level = super().level(state, before, runs, like)
        self.notes += warp_notes(level.before, level.after)
        return level

    def refined(self, state: State) -> FormRecipe:
        """By Loop or Catmull-Clark subdivision; new boundary vertices are put on the curves, by arc length."""
        vertices = self.vertices(state)
        track = self.rim.track.updated(vertices) if self.problem.glides else self.rim.track
        scheme = loop if self.topology.is_triangular else catmull_clark
        step = scheme(self.topology, boundary="interpolate", corners=track.corners)
        rim = self.rim._replace(track=track).refined(step)
        start = rim.track.positions(step.apply(vertices))
        handles, remesh = self.handles, self._remesh
        finer = FormRecipe(start, step.topology, handles=handles, settings=self.settings, rim=rim, remesh=remesh)
        finer.pulls.hold(torch.nonzero(self.pulls.held).squeeze(1))
        return finer

    def renewed(self, state: State) -> FormRecipe | None:
        """With even triangles, if they may be replaced; boundary vertices, handles and held ones keep their places."""
        if not self._remesh:
            return None
        pulls, vertices = self.pulls, self.vertices(state)
        try:
            even = even_mesh(vertices, self.topology, pulls.pulled | pulls.held, self.topology.num_vertices)
            rim = self.rim._replace(track=self.rim.track.updated(vertices)) if self.problem.glides else self.rim
            handles = {int(even.numbers[vertex]): place for vertex, place in self.handles.items()}
            other = FormRecipe(
                even.vertices, even.topology, handles=handles, settings=self.settings,
                rim=rim.renumbered(even.topology, even.numbers), remesh=True,
            )  # fmt: skip
        except MeshError:
            return None
        other.pulls.hold(even.numbers[torch.nonzero(pulls.held).squeeze(1)])
        return other

    def _on_the_rim(self, vertices: Tensor) -> Tensor:
        return self.rim.nearest(vertices, glides=self.problem.glides)
