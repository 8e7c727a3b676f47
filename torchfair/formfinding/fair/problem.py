"""The terms, fixed vertices and guards of the job that lowers E."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property

import torch
from torch import Tensor

from ...constraints import lifted_normal_variation_blocks
from ...geometry.reference import Reference
from ...projection import ElementTerm, ProjectionSettings
from ...projection.layout import State
from ...settings.fair_settings import FairSettings
from ...topology import Topology
from ..job.plan import Stage
from ..job.pulls import Pulls
from ..references import GivenReference
from .edge_guide import EdgeGuide, WantedDirections
from .face_bounds import FaceBounds
from .feature_curves import FeatureCurves, feature_curves
from .free_boundary import FreeBoundary
from .gliding_boundary import GlidingBoundary
from .guard import FairGuard
from .nearness import Nearness
from .panels import Panels
from .planarity_goal import PlanarityGoal
from .scales import Scales, scales
from .terms import fair_terms, planar_terms

_LONGEST_PULL = 0.5  # mean edge lengths that a handle moves in one stage
_PLANARITY_STAGES = 8
_MOST_STAGES = 20


class FairProblem:
    """Everything guided projection needs to lower E of one normalised mesh.

    Args:
        vertices: (V, 3) start, normalised.
        topology: Its connectivity.
        reference: Surface to stay close to, normalised, a mesh or a function; by default the start.
        pulls: Handles and held vertices.
        settings: Weights and bounds.
        rim: Curves along boundary and creases, normalised; by default those of the start.
        input_edge: Mean edge length of the input, in which the distance limit is given; that of the start is 1.
        near_input: Whether the reference is the input; by default where none is given.
        surface: The reference, where closest points on it have been made ready already.
        wanted: Directions that edges should have, see :class:`EdgeGuide`.

    Attributes:
        near: Closeness to the reference surface.
        guide: Directions of edges, where they keep some.
        bounds: On corner angles and areas of faces.
        scales: Of smoothing and fairness where the mesh is fine.
        input_edge: Mean edge length of the input.
        curves: Along boundary and creases.
        corners: (V,) bool, where the boundary turns.
        has_other_goals: Whether E may rise: handles, another reference or planarity ask for a different shape.
        panels: Faces that are kept planar and edges that are kept flat.
        loose: (V,) bool, corners of boundary and creases that become planar faces may take along.
        planarity: Planar faces as a goal, and what they may cost.
        sides_may_cross: Whether steps may lead where sides of faces cross, because the end is looked at.
        sides_have_crossed: Whether a step was looked at that leads there.
        boundary: Curves on which vertices of the boundary and of creases glide; None if none do.
        notes: Decisions taken, in words.
    """

    def __init__(
        self,
        vertices: Tensor,
        topology: Topology,
        reference: GivenReference | None,
        pulls: Pulls,
        settings: FairSettings,
        *,
        rim: FeatureCurves | None = None,
        input_edge: float = 1.0,
        near_input: bool | None = None,
        surface: Reference | None = None,
        wanted: WantedDirections | None = None,
    ) -> None:
        self.vertices, self.topology, self.pulls, self.settings = vertices, topology, pulls, settings
        self.notes: list[str] = []
        self._has_other_reference, self.has_other_goals = reference is not None, False
        self.near_input = reference is None if near_input is None else near_input
        self.input_edge, self.curves = input_edge, rim or feature_curves(vertices, topology, settings)
        self.corners = self.curves.rim.corners
        self._tell_of_creases()
        self.scales = Scales() if settings.projection.takes_every_step else scales(vertices, topology)
        self.guide = EdgeGuide(vertices, topology, wanted)
        self.bounds = FaceBounds(vertices, topology, pulls)
        self.panels = Panels(vertices, topology, settings, self.notes)
        self.loose = self._loose_corners()
        self.boundary = self._gliding_boundary()
        self.planarity = PlanarityGoal(self)
        self.sides_may_cross = self.sides_have_crossed = False
        self.near = self._nearness(reference or (vertices, topology), surface)

    def _nearness(self, reference: GivenReference, surface: Reference | None = None) -> Nearness:
        limit = self.settings.distance_limit
        return Nearness(
            self.vertices,
            self.topology,
            reference,
            self.pulls,
            self.boundary,
            limit=None if limit is None else limit * self.input_edge,
            input_edge=self.input_edge,
            notes=self.notes,
            surface=surface,
        )

    def take_reference(self, reference: GivenReference) -> None:
        """Another surface to stay close to, normalised."""
        self._has_other_reference, self.near_input = True, False
        self.near = self._nearness(reference)
        self.reconsider()

    def take_settings(self, settings: FairSettings) -> None:
        """Takes other weights."""
        self.settings = self.panels.settings = settings
        self.__dict__.pop("guard", None)

    def reconsider(self) -> None:
        """Takes in that handles are pulled elsewhere."""
        self.near.reconsider()
        self.has_other_goals = bool(self.pulls.pulled.any()) or self._has_other_reference
        self.__dict__.pop("guard", None)

    @property
    def fairness_scale(self) -> float:
        """By which the weight of fairness is multiplied in the last stage; 1 where handles leave the reference."""
        return 1.0 if self.near.design_mode else self.scales.fairness

    def snapshot(self) -> Callable[[], None]:
        """A function that puts back what handles have changed."""
        put_back_near, put_back_planarity = self.near.snapshot(), self.planarity.snapshot()
        has_other_goals = self.has_other_goals

        def put_back() -> None:
            put_back_near()
            put_back_planarity()
            self.has_other_goals = has_other_goals
            self.__dict__.pop("guard", None)

        return put_back

    # ---- stages ----------------------------------------------------------------------------------------

    def stage(self, state: State, share: float, blur: float, settings: ProjectionSettings) -> Stage:
        """A run of guided projection from ``state`` on; for the others see :meth:`terms`.

        Live steps of a session keep their own solver, so stages by another one have another name.
        """
        name = "fair" if settings.solver == self.settings.projection.solver else f"fair by {settings.solver}"
        return self._stage(name, state, lambda: self.terms(share, blur), (share, blur), settings)

    def shares(self, vertices: Tensor) -> list[float]:
        """How far the constraints that the ``vertices`` (V, 3) violate are imposed, stage after stage; the last is 1.

        Handles move on in small portions and planarity is raised by powers of ten, so that the barriers
        around badly shaped faces are never asked to hold against a sudden pull.
        """
        steps = math.ceil(self.pulls.farthest(vertices) / _LONGEST_PULL)
        if self.panels.come_in_stages(vertices):
            steps = max(steps, _PLANARITY_STAGES)
        steps = max(1, min(steps, _MOST_STAGES))
        self.has_other_goals = self.has_other_goals or steps > 1
        return [(i + 1) / steps for i in range(steps)]

    def terms(self, share: float, blur: float = 1.0) -> list[ElementTerm]:
        """Element terms of a stage, see :func:`.fair_terms`."""
        return fair_terms(self, share, blur)

    def planar_stage(self, state: State, share: float) -> Stage:
        """A run of guided projection with :func:`.planar_terms`."""
        blocks = {"vertices": state["vertices"]}
        return self._stage("planar", blocks, lambda: planar_terms(self, share), (share,), self.settings.stage())

    def _stage(
        self,
        name: str,
        blocks: State,
        terms: Callable[[], list[ElementTerm]],
        version: tuple[float, ...],
        settings: ProjectionSettings,
    ) -> Stage:
        if self.settings.directions == "keep":
            self.guide.read(blocks["vertices"])
        return Stage(
            name=name,
            blocks=blocks,
            terms=terms,
            version=(self.pulls.version, self.guide.version, *version),
            settings=settings,
            fixed={"vertices": self.stays() | self.pulls.held},
            guard=self.admits,
        )

    def energy(self, vertices: Tensor) -> float:
        """E, with gliding ``vertices`` (V, 3) put in place."""
        return self.guard.energy({"vertices": vertices})

    def blocks(self, vertices: Tensor) -> dict[str, Tensor]:
        """Variable blocks at ``vertices``; auxiliary variables satisfy their constraints there."""
        if self.settings.formulation == "reduced":
            return {"vertices": vertices}
        return {"vertices": vertices, **lifted_normal_variation_blocks(vertices, self.topology)}

    # ---- decisions -------------------------------------------------------------------------------------

    def stays(self) -> Tensor:
        """(V,) bool, vertices that do not move unless pulled: the boundary or its corners, corners of creases."""
        isolated = self.topology.valences == 0
        kinds = {
            "glide": self.topology.is_boundary_vertex & self.corners,
            "fixed": self.topology.is_boundary_vertex.clone(),
            "free": torch.zeros_like(isolated),
        }
        fixed = kinds[self.settings.boundary] | isolated | (self.curves.corners & ~self.topology.is_boundary_vertex)
        return fixed & ~self.pulls.pulled & ~self.loose

    def _loose_corners(self) -> Tensor:
        """Those of faces that are to become planar: where all their corners stayed, few could."""
        settings = self.settings
        corners = self.corners if settings.boundary == "glide" else torch.zeros_like(self.corners)
        if not self.panels.makes_planar or settings.projection.takes_every_step:
            return torch.zeros_like(corners)
        return self.panels.warped_corners(self.vertices) & (corners | self.curves.stay)

    def _tell_of_creases(self) -> None:
        count, stay = int((self.curves.edges >= 0).sum()), int(self.curves.stay.sum())
        if count:
            degrees = math.degrees(self.settings.crease_angle)
            self.notes.append(
                f"{count} edges are creases, of more than {degrees:.3g} degrees: their vertices glide on them and "
                f"{stay} corners stay; 0 degrees for no creases"
            )

    def _gliding_boundary(self) -> GlidingBoundary | None:
        glides = self.settings.boundary == "glide"
        if not glides and not self.curves.points:
            return None
        held = (self.topology.is_boundary_vertex & glides) | self.curves.on_creases
        return GlidingBoundary(held, self.curves.curves(boundary=glides), self.pulls, self.panels.corners)

    @cached_property
    def free(self) -> FreeBoundary:
        """What a free boundary is held by."""
        return FreeBoundary(self.vertices, self.curves.rim, self.pulls)

    # ---- guards ----------------------------------------------------------------------------------------

    def placed(self, state: State) -> Tensor:
        """The vertices (V, 3) of the mesh of a state: gliding ones are put on their curves."""
        return state["vertices"] if self.boundary is None else self.boundary.placed(state)

    def keeps_faces(self, state: State, trial: State) -> bool:
        """Whether a step leaves faces as good as they have to be, and crosses no sides unless they may on the way."""
        kept = self.guard.keeps_faces(state, trial) and self.guard.keeps_bounds(trial)
        if kept and not self.guard.keeps_sides_apart(state, trial):
            self.sides_have_crossed = True
            return self.sides_may_cross
        return kept

    def crosses_sides(self, vertices: Tensor) -> bool:
        """Whether sides of faces of ``vertices`` (V, 3) cross that do not at the start."""
        return not self.guard.keeps_sides_apart({"vertices": self.vertices}, {"vertices": vertices})

    def admits(self, state: State, trial: State) -> bool:
        """Whether a step may be taken: no face turns over, bounds hold, and E does not rise above that of the start.

        E may rise where handles, another reference or planarity ask for a different shape, and on the way back from
        where handles have been.
        """
        kept = self.keeps_faces(state, trial)
        if kept and self.planarity.most_warped < math.inf:
            kept = self.planarity.largest_warp(trial["vertices"]) <= self.planarity.most_warped
        rises = self.has_other_goals or self.near.is_on_the_way_back
        return kept and (rises or self.guard.keeps_energy(state, trial))

    @cached_property
    def guard(self) -> FairGuard:
        """What judges the meshes of states."""
        bounded = self.settings.quality_weight > 0.0
        return FairGuard(
            self.vertices,
            self.topology,
            self.placed,
            smallest_angle=bounded * self.bounds.smallest_angle(self.settings),
            smallest_areas=bounded * self.bounds.smallest_areas(self.settings),
            sides=self.bounds.sides,
            smallest_edge=bounded * self.settings.smallest_edge,
            largest_areas=self.bounds.largest_areas(self.settings),
            from_last=self.near.design_mode or self.pulls.everywhere,
            may_turn=self.pulls.everywhere or self.settings.faces_may_turn,
        )
