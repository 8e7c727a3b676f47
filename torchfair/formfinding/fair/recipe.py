"""Smoother meshes near a reference surface: lowers E by sliding vertices (paper section 5.1)."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

import torch
from torch import Tensor

from ...errors import SettingsError
from ...progress import phase
from ...projection import Callback, ProjectionResult
from ...projection.layout import State
from ...settings.fair_settings import FairSettings
from ...topology import Topology
from ..job import JobResult, Level, Promise, Recipe, Stage, solved
from ..references import GivenReference, normalised_reference, refuse_far_reference, surface_of
from ..stopping import interrupted_at_the_start
from .edge_guide import WantedDirections, normalised_directions
from .feature_curves import FeatureCurves, feature_curves
from .measures import fair_measures, fair_promises, located
from .plan import FairPlan
from .problem import FairProblem
from .refinement import refined


class FairRecipe(Recipe[FairSettings]):
    """Lowers E near a reference surface; see :func:`minimise_normal_variation`.

    Args:
        vertices, topology, reference, settings: See :func:`minimise_normal_variation`.
        handles: Likewise; more of them may be pulled later.
        rim: Curves along boundary and creases; by default those of the start.
        input_edge: Mean edge length in which the distance limit is given; by default that of the start.
        near_input: Whether the reference is the input; by default where none is given.
        fixed: Vertices that stay where they are.
        directions_at: See :func:`minimise_normal_variation`.

    Attributes:
        reference: The surface to stay close to: vertices and topology, or a function.
        directions_at: As given.
    """

    name = "fair"

    def __init__(
        self,
        vertices: Tensor,
        topology: Topology,
        *,
        reference: GivenReference | None = None,
        handles: Mapping[int, Sequence[float]] | None = None,
        settings: FairSettings | None = None,
        rim: FeatureCurves | None = None,
        input_edge: float | None = None,
        near_input: bool | None = None,
        fixed: Iterable[int] = (),
        directions_at: WantedDirections | None = None,
    ) -> None:
        super().__init__(vertices, topology, settings or FairSettings())
        surface = None if reference is None else normalised_reference(reference, self.unit)
        made = None
        if surface is not None and input_edge is None and self.settings.reference_distance < math.inf:
            with phase("preparing the reference surface"):
                made = surface_of(surface)
            refuse_far_reference(surface, made, self.start, self.topology, most=self.settings.reference_distance)
        self.reference = reference or (self.given, self.topology)
        self.rim = rim or feature_curves(self.given, self.topology, self.settings)
        self.input_edge, self.directions_at = input_edge or self.unit.length, directions_at
        self.problem = FairProblem(
            self.start,
            self.topology,
            surface,
            self.pulls,
            self.settings,
            rim=self.rim.mapped(self.unit.apply),
            input_edge=self.input_edge / self.unit.length,
            near_input=near_input,
            surface=made,
            wanted=None if directions_at is None else normalised_directions(directions_at, self.unit),
        )
        self.notes = self.problem.notes
        self.fix(fixed, handles or {})
        self.pull(handles or {})

    def take_settings(self, settings: FairSettings) -> None:
        """Takes other weights."""
        super().take_settings(settings)
        self.problem.take_settings(settings)

    def reconsider(self) -> None:
        """Where a handle leaves the reference surface, that is given up."""
        self.problem.reconsider()

    def put_at(self, state: State) -> None:
        """Vertices beyond the distance limit may not go farther away than they are."""
        self.problem.near.lift(self.placed(state))

    def snapshot(self) -> Callable[[], None]:
        """Puts back whether the reference surface is given up."""
        return self.problem.snapshot()

    def plan(self, state: State) -> FairPlan:
        """Constraints in portions, then the absolute value sharper and sharper."""
        self.problem.near.take_up(self.placed(state))
        return FairPlan(self.problem, state)

    def follower(self, state: State) -> Stage:
        """Everything at once, with the sharp absolute value; longer steps would carry handles past their targets."""
        self.problem.near.take_up(self.placed(state))
        settings = replace(self.settings.projection, least_extrapolation=math.inf, least_uncorrected_gain=0.0)
        return self.problem.stage(state, 1.0, 1.0, settings)

    def final(self, state: State) -> Stage:
        """Everything at once, with the sharp absolute value."""
        if self.settings.formulation != "reduced":
            raise SettingsError(f"formulation {self.settings.formulation!r} has no layer: take 'reduced'")
        self.problem.near.take_up(self.placed(state))
        return self.problem.stage(state, 1.0, 1.0, self.settings.projection)

    @property
    def glides(self) -> bool:
        """Along boundary and creases, as the settings say."""
        return self.problem.boundary is not None and self.problem.boundary.feet is not None

    def take_reference(self, reference: tuple[Tensor, Topology]) -> None:
        """In place of the one before."""
        self.reference = reference
        self.problem.take_reference(normalised_reference(reference, self.unit))

    def trace_reference(self, vertices: Tensor) -> None:
        """Closest points, and the planes there, follow the vertices (R, 3)."""
        self.problem.near.trace(self.unit.apply(vertices))

    def blocks(self, vertices: Tensor) -> State:
        """With auxiliary variables that fit."""
        return self.problem.blocks(vertices)

    def placed(self, state: State) -> Tensor:
        """Gliding vertices are put on their curves."""
        return self.problem.placed(state)

    def observe(self, state: State) -> dict[str, float]:
        """E, in the unit of the input."""
        return {"normal_variation": self.unit.length * self.problem.guard.energy(state)}

    def stays(self) -> Tensor:
        """Boundary vertices or corners, as the settings say, unless they are pulled."""
        return self.problem.stays()

    def forget(self) -> None:
        """Searches for closest points begin anew."""
        self.problem.near.forget()

    def measures(self, vertices: Tensor) -> dict[str, float]:
        """See ``fair_measures``."""
        return fair_measures(vertices, self.given, self.problem, self.unit)

    def after(self, vertices: Tensor, before: dict[str, float]) -> dict[str, float]:
        """A start that was not moved has its own measures, and is not measured again."""
        return dict(before) if torch.equal(vertices, self.given) else self.measures(vertices)

    def is_untouched(self, state: State, runs: Sequence[ProjectionResult]) -> bool:
        """Where it was stopped before a step was taken; boundary vertices are then not put on their curves either."""
        return interrupted_at_the_start(runs) and torch.equal(state["vertices"], self.start)

    def promises(self, before: Mapping[str, float], after: Mapping[str, float]) -> list[Promise]:
        """See ``fair_promises``."""
        return fair_promises(self.problem, before, after)

    def level(self, state: State, before: dict[str, float], runs: list[ProjectionResult], like: Tensor) -> Level:
        """What is returned of a state, with the panels named that break promises."""
        level = super().level(state, before, runs, like)
        return replace(level, promises=located(level.promises, self.vertices(state), self.problem))

    def refined(self, state: State) -> FairRecipe:
        """By Loop's or Catmull and Clark's scheme, near the same reference surface."""
        return refined(self, self.vertices(state))


def minimise_normal_variation(
    vertices: Tensor,
    topology: Topology,
    *,
    reference: GivenReference | None = None,
    handles: Mapping[int, Sequence[float]] | None = None,
    fixed: Iterable[int] = (),
    levels: int = 0,
    directions_at: WantedDirections | None = None,
    settings: FairSettings | None = None,
    callback: Callback | None = None,
) -> JobResult[Level]:
    """Moves vertices along a reference surface so that E = sum l l* becomes small.

    Works on triangle, quad and hybrid polygon meshes, with or without boundary. Promises, which are measured on the
    result (:attr:`~torchfair.formfinding.JobResult.promises`): the merit never increases within a stage, nor does E
    above its start (unless handles, another reference or planarity ask for a different shape); no vertex goes farther
    from the reference surface than ``settings.distance_limit`` (gliding boundary vertices are on smooth curves through
    the boundary, which bulge over its chords); no corner angle and no face area falls below its bound; no face flips;
    faces that are kept planar are, and panels of coplanar triangles stay flat. No more faces have sides that
    cross than at the start (unless faces may turn). The problem is solved centred and with unit mean edge length, so
    results do not depend on the unit.

    Args:
        vertices: (V, 3).
        topology: Connectivity; it does not change but by refinement.
        reference: Surface to stay close to, by default the input itself: vertices and topology of a mesh, or a smooth
            surface as a function that gives closest points and unit normals (:func:`torchfair.geometry.closest_on`).
            Vertices that start farther from it than the limit may not go farther away than they are.
        handles: Targets by vertex number. Where a target is farther from the reference surface than the
            limit, the reference is given up (design mode, paper Fig. 12) and a note says so.
        fixed: Numbers of vertices that stay where they are.
        levels: How often to refine the result and lower E again: triangles by Loop's scheme, others by Catmull and
            Clark's. Reference and boundary curves stay; handles, and what is planar or flat, are carried on.
        directions_at: With ``settings.directions`` of ``"keep"``, the directions that interior edges should have where
            they are, in place of their own: a function of their middles (n, 3) and vectors (n, 3) that gives (n, 3)
            vectors, zero for edges that keep their own. Asked before every stage.
        settings: Weights, bounds and tolerances.
        callback: Called with every iteration record, whose quantities hold ``normal_variation``; returning
            True stops. Ctrl-C, or a function that raises KeyboardInterrupt, returns the best mesh so far.

    Returns:
        One level for every mesh from coarse to fine. The last run of each is that with the sharp absolute value; the
        others, if any, are stages with a blunter one, and where handles travel far or faces have to become planar, with
        constraints imposed step by step.

    Raises:
        ShapeError: vertices are not ``(V, 3)``, a handle is not a point, or what ``directions_at`` gives is not
            ``(n, 3)``.
        MeshError: vertices are not finite, a face has no area, a handle or a fixed vertex is none or one is both, or
            the reference is farther away than ``settings.reference_distance``, or what ``directions_at`` gives is not
            finite.
        SettingsError: ``directions_at`` is given and ``settings.directions`` is not ``"keep"``.

    Example:
        >>> from torchfair.formfinding import minimise_normal_variation
        >>> from torchfair.shapes import Catenoid, irregular_triangles
        >>> mesh = irregular_triangles(Catenoid(), 60)
        >>> result = minimise_normal_variation(mesh.vertices, mesh.topology)
        >>> result.after["normal_variation"] < 0.95 * result.before["normal_variation"]
        True
        >>> result.holds
        True

        Ribs of a roof, the edges more along x than along y, are drawn into planes across y:

        >>> import torch
        >>> from torchfair.formfinding import FairSettings
        >>> from torchfair.shapes import FreeFormPatch, parameter_quads
        >>> roof = parameter_quads(FreeFormPatch(), 8, 8)
        >>> def in_planes(middles, vectors):
        ...     is_rib = vectors[:, :1].abs() > vectors[:, 1:2].abs()
        ...     return torch.where(is_rib, vectors * torch.tensor([1.0, 0.0, 1.0]), 0.0)
        >>> settings = FairSettings(directions="keep", direction_weight=300.0)
        >>> made = minimise_normal_variation(roof.vertices, roof.topology, directions_at=in_planes, settings=settings)
        >>> ends = made.vertices[roof.topology.interior_edges]
        >>> along, across, _ = (ends[:, 1] - ends[:, 0]).abs().unbind(1)
        >>> bool((across / along)[along > across].mean() < 0.005)
        True
    """
    chosen = list(fixed)
    if directions_at is not None and (settings or FairSettings()).directions != "keep":
        raise SettingsError("directions_at has edges keep directions: give settings with directions='keep'")

    def begin() -> FairRecipe:
        return FairRecipe(
            vertices,
            topology,
            reference=reference,
            handles=handles,
            fixed=chosen,
            settings=settings,
            directions_at=directions_at,
        )

    return solved(begin, vertices, levels=levels, callback=callback)
