"""A principal-symmetric mesh that answers while its handles are moved."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import torch
from torch import Tensor

from ..boundary import boundary_corners
from ..constraints import BoundaryNormals
from ..errors import MeshError
from ..geometry.closest_point import ReferenceSurface
from ..principal import PrincipalEdges
from ..principal.principal_edges import PrincipalStars
from ..projection import ProjectionResult, ProjectionSettings, Status
from ..projection.iteration import Callback
from ..projection.layout import State
from ..projection.normalisation import Normalisation
from ..projection.threads import threads_for
from ..stars import pyramid_self_intersections
from ..subdivision import interpolate_vertices, loop
from ..subdivision.interpolation import BOUNDARY_CORNER
from ..topology import Topology
from .checks import one_start, refuse_degenerate_faces
from .strip_normals import strip_normals
from .symmetric_problem import Aim, SymmetricProblem
from .symmetric_report import condition_residuals, saddle_sides_right, symmetric_measures
from .symmetric_settings import SymmetricSettings

_EXACT = ProjectionSettings(
    max_iterations=18,
    initial_damping=1e-4,
    damping_scale="identity",
    merit_tolerance=1e-16,
    step_tolerance=1e-12,
    least_extrapolation=math.inf,
)
_TIGHT_STEPS = 5
_PORTION_STEPS = 6
_LONGEST_PULL = 3.0  # mean edge lengths that handles are pulled at once
_MOST_PORTIONS = 12
_PULLED = 0.1  # mean edge lengths from which on handles may be to blame where conditions cannot be met
_MORE_MARGIN = 1.6  # from round to round
_PATIENT_ROUNDS = 2  # before stars that stay wrong are to be something else
_LESS_PULL = 0.1
_FEW = 0.01  # share of stars with wrong sides that a wider margin may mend


class SymmetricDesign:
    """One level of a design: a mesh, its principal edges and handles, and everything compiled for the next edit.

    Args:
        vertices: (V, 3).
        principal: Which edges are principal; it holds the topology.
        handles: Vertices that will be moved; the others follow.
        fixed: (V,) bool, vertices that do not move.
        reference: Vertices and topology of a surface to stay close to.
        on: Vertices where conditions are imposed, by default all regular ones.
        settings: Weights and tolerances.

    Attributes:
        vertices: (V, 3) current state, float64, in the unit of the input.
        stars: Where conditions are imposed.
        runs: Every run of guided projection so far, in normalised units.
        notes: Decisions taken, in words.

    Raises:
        ShapeError: vertices or masks do not fit the topology.
        MeshError: vertices are not finite, a face has no area, a handle is fixed, or there is no star to impose
            conditions on.
    """

    def __init__(
        self,
        vertices: Tensor,
        principal: PrincipalEdges,
        *,
        handles: Sequence[int] = (),
        fixed: Tensor | None = None,
        reference: tuple[Tensor, Topology] | None = None,
        on: Tensor | None = None,
        settings: SymmetricSettings | None = None,
    ) -> None:
        self.principal, self.settings = principal.to("cpu"), settings or SymmetricSettings()
        self.topology = self.principal.topology
        self.vertices = one_start(vertices, self.topology)
        self.normalisation = Normalisation.of(self.vertices, self.topology)
        refuse_degenerate_faces(self.vertices, self.topology)
        self.stars = _chosen(self.principal.stars(), on)
        self.fixed = self._fixed(fixed)
        self.handles = torch.tensor(list(handles), dtype=torch.int64)
        held = self.handles[self.fixed[self.handles]].tolist()
        if held:
            raise MeshError(f"handles {held[:10]} are fixed: free them, or move them before")
        self.runs: list[ProjectionResult] = []
        self.notes: list[str] = []
        surface = None
        if reference is not None:
            surface = ReferenceSurface(self.normalisation.apply(one_start(*reference)), reference[1].to("cpu"))
        start = self.normalisation.apply(self.vertices)
        self.problem = SymmetricProblem(
            start, self.principal, self.stars, self.handles, self.fixed, surface, self.settings
        )
        self._reference = reference
        self._state = self.problem.blocks(start)

    @property
    def targets(self) -> Tensor:
        """(n, 3) where the handles are to be, in the unit of the input."""
        return self.normalisation.invert(self.problem.targets)

    def solve(self, callback: Callback | None = None) -> bool:
        """Meets the conditions near the current state; returns whether it was stopped by callback or Ctrl-C.

        The shape is found with weighted conditions; then they are met exactly, by the shortest way. Where that fails
        it is tried again with handles that pull less: they yield to the conditions. A few saddle sides that come out
        wrong are tried again with a wider margin. The best state found is kept.
        """
        with threads_for(self._state["vertices"].numel(), self._state["vertices"].device):
            return self._solve(callback)

    def _solve(self, callback: Callback | None) -> bool:
        begin, start = len(self.runs), self._state
        if self._is_done():
            stopped = self._run(Aim.EXACT, _EXACT, begin, callback)
            self._take(self._state)
            return stopped
        pulled = self._farthest(start["vertices"]) > _PULLED
        best: tuple[tuple[float, float], State] | None = None
        self.problem.sides.margin, self.problem.pull = self.settings.saddle_margin, 1.0
        self.problem.sides.forget()
        for attempt in range(self.settings.rounds):
            stopped = self._round(callback, begin, first=attempt == 0)
            score = self._score()
            if best is None or score < best[0]:
                best = (score, self._state)
            if stopped or score == (self.settings.tolerance, 0.0) or not self._steps_left(begin):
                break
            many = attempt > 0 and score[1] > _FEW * self.stars.vertices.shape[0]
            if pulled and (many or score[0] > self.settings.tolerance):
                self._state = start
                self.problem.pull *= _LESS_PULL
            else:
                self.problem.sides.margin *= _MORE_MARGIN
                if attempt >= _PATIENT_ROUNDS:
                    self.problem.sides.reconsider(self._state["vertices"])
        assert best is not None
        self._take(best[1])
        return stopped

    def move(self, targets: Mapping[int, Sequence[float]], callback: Callback | None = None) -> bool:
        """Moves handles to ``targets`` and solves; see :meth:`solve`.

        Raises:
            MeshError: a vertex is none of the handles.
        """
        rows = {vertex: row for row, vertex in enumerate(self.handles.tolist())}
        moved = self.problem.targets.clone()
        for vertex, place in targets.items():
            if vertex not in rows:
                raise MeshError(f"vertex {vertex} is no handle of this design: handles are {list(rows)[:10]}")
            moved[rows[vertex]] = self.normalisation.apply(torch.as_tensor(place, dtype=moved.dtype))
        self.problem.targets = moved
        return self.solve(callback)

    def refined(self) -> SymmetricDesign:
        """The design on the mesh refined by Loop subdivision, labels, handles and fixed vertices carried along.

        Vertices keep their places; see :func:`~torchfair.subdivision.interpolate_vertices`.
        """
        corners = boundary_corners(self.vertices, self.topology, BOUNDARY_CORNER)
        step = loop(self.topology, boundary="interpolate", corners=corners)
        finer = interpolate_vertices(step, self.vertices, BoundaryNormals.of(self.vertices, self.topology).at_boundary)
        kept = self.handles
        fixed = step.carry_vertex_labels(self.fixed, along=self._fixed_edges())
        boundary_only = step.topology.is_boundary_vertex
        inner_fixed = torch.nonzero(self.fixed & ~self.topology.is_boundary_vertex).squeeze(1)
        handles = torch.cat([kept, inner_fixed[~torch.isin(inner_fixed, kept)]])
        on = None
        if self.stars.vertices.shape[0] < self.principal.stars().vertices.shape[0]:
            on = self._finer_stars(step.carry_vertex_labels)
        design = SymmetricDesign(
            finer,
            self.principal.refine(step),
            handles=handles.tolist(),
            fixed=fixed & boundary_only,
            reference=self._reference,
            on=on,
            settings=self.settings,
        )
        places = self.vertices.clone()
        places[self.handles] = self.targets
        design.problem.targets = design.normalisation.apply(places[handles])
        design.notes = self.notes
        return design

    def measures(self) -> dict[str, float]:
        """See :func:`~torchfair.formfinding.symmetric_measures`."""
        return symmetric_measures(self.vertices, self.principal, self.stars, self.handles, self.targets)

    def normals(self) -> Tensor:
        """(V, 3) unit normals n(v); see :func:`~torchfair.formfinding.strip_normals`."""
        return strip_normals(self.vertices, self.principal, self.stars)

    # ---- one round ---------------------------------------------------------------------------------------

    def _round(self, callback: Callback | None, begin: int, *, first: bool) -> bool:
        settings = self.settings
        wrong = self.problem.sides.decide(self._state["vertices"])
        aims = [Aim.SHAPE, Aim.TIGHT, Aim.EXACT]
        if first and self._approach(begin, callback):
            return True
        for aim in aims:
            if aim is Aim.TIGHT and first:
                wrong = self.problem.sides.decide(self._state["vertices"])
                if wrong and self._run(Aim.SHAPE, settings.projection, begin, callback):
                    return True
                self.problem.sides.decide(self._state["vertices"])
            chosen = {
                Aim.SHAPE: settings.projection,
                Aim.TIGHT: replace(settings.projection, max_iterations=_TIGHT_STEPS),
                Aim.EXACT: _EXACT,
            }[aim]
            if self._run(aim, chosen, begin, callback):
                return True
        return False

    def _approach(self, begin: int, callback: Callback | None) -> bool:
        """Pulls handles most of the way in portions, where they are far from their targets."""
        start, end = self._state["vertices"][self.handles], self.problem.targets
        portions = math.ceil(self._farthest(self._state["vertices"]) / _LONGEST_PULL)
        for portion in range(1, min(portions, _MOST_PORTIONS)):
            self.problem.targets = start.lerp(end, portion / portions)
            self.problem.sides.decide(self._state["vertices"])
            chosen = replace(self.settings.projection, max_iterations=_PORTION_STEPS)
            stopped = self._run(Aim.SHAPE, chosen, begin, callback)
            self.problem.targets = end
            if stopped:
                return True
        return False

    def _run(self, aim: Aim, settings: ProjectionSettings, begin: int, callback: Callback | None) -> bool:
        left = self._steps_left(begin)
        if not left:
            return False
        run = self.problem.compiled(aim).solve(
            self._state,
            settings=replace(settings, max_iterations=min(settings.max_iterations, left)),
            callback=callback,
            guard=self.problem.admits,
        )
        self.runs.append(run)
        self._state = run.blocks
        return run.status in (Status.INTERRUPTED, Status.CALLBACK)

    def _steps_left(self, begin: int) -> int:
        return max(0, self.settings.most_steps - sum(run.iterations for run in self.runs[begin:]))

    def _is_done(self) -> bool:
        """Whether the state is all that is asked for already."""
        if self._reference is not None or self.settings.energy_weight:
            return False
        at_targets = self._farthest(self._state["vertices"]) <= self.settings.tolerance
        return at_targets and self._score() == (self.settings.tolerance, 0.0)

    def _farthest(self, vertices: Tensor) -> float:
        """Largest distance of a handle from its target."""
        away = torch.linalg.vector_norm(vertices[self.handles] - self.problem.targets, dim=1)
        return float(away.max()) if away.numel() else 0.0

    def _score(self) -> tuple[float, float]:
        """Largest relative residual, and how many saddle sides are wrong: what a round is judged by."""
        vertices = self._state["vertices"]
        residuals = condition_residuals(vertices, self.principal, self.stars)
        largest = max(float(values.max()) for values in residuals.values() if values.numel())
        return max(largest, self.settings.tolerance), float(self._count_wrong(vertices))

    def _count_wrong(self, vertices: Tensor) -> int:
        """Stars of negative curvature with principal neighbours on the wrong side, or with a crossing pyramid."""
        if not self.problem.sides.count_wrong(vertices):
            return 0  # saddle-shaped stars of this kind have simple pyramids
        negative = self.problem.sides.are_negative(vertices)
        crossing = pyramid_self_intersections(vertices, self.topology)[self.stars.vertices] > 0
        return int((negative & (crossing | ~saddle_sides_right(vertices, self.stars))).sum())

    def _take(self, state: State) -> None:
        self._state = state
        moved = self.normalisation.invert(state["vertices"])
        self.vertices = torch.where(self.fixed[:, None], self.vertices, moved)

    # ---- masks -------------------------------------------------------------------------------------------

    def _fixed(self, fixed: Tensor | None) -> Tensor:
        count = self.topology.num_vertices
        mask = self.topology.valences == 0
        if self.settings.boundary == "fixed":
            mask = mask | self.topology.is_boundary_vertex
        if fixed is not None:
            if fixed.shape != (count,) or fixed.dtype != torch.bool:
                raise MeshError(f"fixed: expected a bool tensor ({count},), got {tuple(fixed.shape)} {fixed.dtype}")
            mask = mask | fixed.cpu()
        return mask

    def _fixed_edges(self) -> Tensor:
        """(E,) boundary edges between fixed vertices."""
        edges = self.topology.edges
        on_boundary = torch.zeros(edges.shape[0], dtype=torch.bool)
        on_boundary[self.topology.num_interior_edges :] = True
        return on_boundary & self.fixed[edges].all(1)

    def _finer_stars(self, carry: object) -> Tensor:
        chosen = torch.zeros(self.topology.num_vertices, dtype=torch.bool)
        chosen[self.stars.vertices] = True
        along = torch.zeros(self.topology.num_edges, dtype=torch.bool)
        edges = self.topology.edges
        along[self.principal.mask & chosen[edges].all(1)] = True
        return torch.nonzero(carry(chosen, along=along)).squeeze(1)  # type: ignore[operator]


def _chosen(stars: PrincipalStars, on: Tensor | None) -> PrincipalStars:
    if on is not None:
        kept = torch.isin(stars.vertices, on.cpu())
        stars = PrincipalStars(*(part[kept] for part in stars))
    if not stars.vertices.numel():
        raise MeshError(
            "no condition can be imposed: the mesh has no interior vertex of valence 6 with two opposite principal "
            "edges among the chosen ones. Check the principal edges, or refine the mesh."
        )
    return stars
