"""The terms, fixed vertices and guards of the design of principal-symmetric meshes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from enum import Enum
from typing import Any

import torch
from torch import Tensor

from ... import constraints as c
from ...constraints.closeness import Feet
from ...constraints.saddle_sides import SaddleSides
from ...geometry import ReferenceSurface, corner_angles
from ...geometry.reference import Reference
from ...principal import PrincipalEdges
from ...principal.principal_edges import PrincipalStars
from ...projection import ElementTerm, ProjectionSettings
from ...projection.layout import State
from ...settings.symmetric_settings import SymmetricSettings
from ..differentiable.traced_planes import TracedPlanes
from ..face_guard import FaceGuard
from ..job.plan import Stage
from ..job.pulls import Pulls
from .kept_shape import KeptShape, Missed

_SAFE_ANGLE = 2.5  # smallest angles at which the barrier sets in
_KEPT_ENERGY = 0.01  # weight of E over that of the shape that is kept: vertices slide to where E is low
_MET = 1e6  # weight at which conditions hold to 1e-8 or so
_KEPT_MARGIN = 0.1  # share of the margin of saddle sides that is kept where conditions are met exactly


class Aim(Enum):
    """What a run is for."""

    SEARCH = "conditions, saddle sides and everything else, weighted; stars may turn into others"
    SHAPE = "the same, stars stay what they are"
    TIGHT = "the same as SHAPE with conditions weighted more"
    MINIMUM = "the same as SHAPE with conditions weighted so much that they are met as promised"
    EXACT = "conditions and saddle sides alone"
    CONDITIONS = "conditions alone"


class SymmetricProblem:
    """Everything guided projection needs for one mesh in normalised units.

    Args:
        base: (V, 3) where fairness wants to see the displacement zero.
        principal: Which edges are principal.
        stars: Where conditions are imposed.
        stays: (V,) bool, vertices that do not move.
        pulls: Handles and held vertices.
        reference: Surface to stay close to.
        settings: Weights.

    Attributes:
        sides: What stars are to be; see :class:`~torchfair.constraints.saddle_sides.SaddleSides`.
        rigidity: Factor of the weight of fairness of the displacement where the shape is kept: small, vertices slide.
        stiffness: Factor of the weight of closeness to the shape that is kept.
        smoothness: Factor of the weight of E beside it.
        steered: Whether a handle has ever asked for another shape; without, that of the base is kept.
    """

    def __init__(
        self,
        base: Tensor,
        principal: PrincipalEdges,
        stars: PrincipalStars,
        stays: Tensor,
        pulls: Pulls,
        reference: Reference | None,
        settings: SymmetricSettings,
    ) -> None:
        self.base, self.principal, self.stars, self.settings = base, principal, stars, settings
        self.topology, self.stays, self.pulls = principal.topology, stays, pulls
        self.edges = c.between_stars(self.topology.edges[principal.mask], stars)
        self.sides = SaddleSides(stars, margin=settings.saddle_margin)
        self._reference, self.steered = reference, False
        self.rigidity = self.stiffness = self.smoothness = 1.0
        self.forget()
        self._angles = corner_angles(base, self.topology)
        self._smallest_angle = min(settings.smallest_angle, 0.8 * float(self._angles.min()))
        self._keeps_faces = FaceGuard(self.topology, lambda state: state["vertices"])

    @property
    def keeps_shape(self) -> bool:
        """Whether the mesh is to stay close to where it starts: nothing asks, or may come to ask, for another shape."""
        return not (self.settings.free or self.steered or self.pulls.everywhere or self._reference is not None)

    @property
    def has_other_goals(self) -> bool:
        """Whether more is asked for than conditions and handles: closeness to another surface, or E."""
        return self._reference is not None or self.settings.energy_weight > 0.0

    def missed(self, vertices: Tensor) -> Missed:
        """How far vertices (V, 3) are from what is promised of a shape that is kept; nothing if it is not."""
        return self._kept_shape().missed(vertices) if self.keeps_shape else Missed()

    def pull_fully(self) -> None:
        """Aims at the targets of handles themselves, with their full weight."""
        self.pulls.aims, self.pulls.strength = self.pulls.targets.clone(), 1.0

    def snapshot(self) -> Callable[[], None]:
        """A function that puts back saddle sides, and whether the shape is kept, to what they are now."""
        saved, steered = _copied(vars(self.sides)), self.steered

        def restore() -> None:
            vars(self.sides).update(_copied(saved))
            self.steered = steered

        return restore

    def forget(self) -> None:
        """Makes searches for closest points anew."""
        self._planes: Feet | None = None if self._reference is None else c.TangentPlanes(self._reference)
        self._shape: KeptShape | None = None
        self._kept: dict[tuple[object, SymmetricSettings], list[ElementTerm]] = {}

    def take_reference(self, reference: ReferenceSurface) -> None:
        """Another surface to stay close to, normalised."""
        self._reference = reference
        self.forget()

    def trace_reference(self, vertices: Tensor) -> None:
        """Makes terms from now on differentiable functions of the vertices (R, 3) of the surface, a mesh."""
        assert isinstance(self._reference, ReferenceSurface)
        self.forget()
        self._planes = TracedPlanes(self._reference, vertices)

    def _kept_shape(self) -> KeptShape:
        if self._shape is None:
            self._shape = KeptShape(self.base, self.topology)
        return self._shape

    # ---- stages ----------------------------------------------------------------------------------------

    def blocks(self, vertices: Tensor) -> State:
        """Variable blocks that fit ``vertices``."""
        if self.settings.formulation == "spheres":
            return {"vertices": vertices, **c.sphere_blocks(vertices, self.stars)}
        if self.settings.formulation == "lifted":
            lifted = c.lifted_principal_symmetric_blocks(vertices, self.edges, self.stars)
            return self._with_energy({"vertices": vertices, **lifted})
        return {"vertices": vertices}

    def _with_energy(self, state: State) -> State:
        """With the paper's variables of E that fit the vertices, where E is lowered in these."""
        if not self._lifts_energy:
            return state
        return {**state, **c.lifted_normal_variation_blocks(state["vertices"], self.topology)}

    @property
    def _lifts_energy(self) -> bool:
        return self.settings.formulation == "lifted" and self._energy_weight > 0.0

    @property
    def _energy_weight(self) -> float:
        least = self.smoothness * _KEPT_ENERGY * self.settings.shape_weight if self.keeps_shape else 0.0
        return max(self.settings.energy_weight, least)

    def stage(self, state: State, aim: Aim, settings: ProjectionSettings) -> Stage:
        """A run of guided projection from ``state`` on.

        Shapes that are sought, found and tightened differ in weights alone, and share one analysis. Those of the
        paper's own variables are other problems where other stars are to be saddles: slacks belong to these only.
        """
        name = aim.name if aim in (Aim.EXACT, Aim.CONDITIONS) else Aim.SHAPE.name
        return Stage(
            name=name,
            blocks=state,
            terms=lambda: self.terms(aim),
            version=(aim, self.settings, self.keeps_shape, self.rigidity, self.stiffness, self.smoothness),
            settings=replace(settings, solver=self.settings.projection.solver),
            fixed={"vertices": self.stays | self.pulls.held},
            guard=self.admits,
            result=self._with_energy,
            anew=self.settings.formulation == "lifted",
        )

    # ---- terms -----------------------------------------------------------------------------------------

    def terms(self, aim: Aim) -> list[ElementTerm]:
        """Element terms of an aim."""
        settings = self.settings
        tight, most = settings.tight_weight, max(_MET, settings.tight_weight)
        weight = {Aim.TIGHT: tight, Aim.MINIMUM: most}.get(aim, settings.constraint_weight)
        conditions = self._conditions(weight)
        if aim is Aim.CONDITIONS:
            return conditions
        if aim is Aim.EXACT:
            return [*conditions, *self._sides(share=_KEPT_MARGIN)]
        others = [
            *self._energy(weight),
            *self._same(("others", self.keeps_shape, self.rigidity, self.stiffness), self._others),
        ]
        return [*conditions, *self._sides(ahead=aim is not Aim.SEARCH), *others]

    def _same(self, name: object, make: Callable[[], list[ElementTerm]]) -> list[ElementTerm]:
        """Terms that are the very same for all aims: what is known of them is not found again."""
        key = (name, self.settings)
        if key not in self._kept:
            self._kept = {known: terms for known, terms in self._kept.items() if known[1] == self.settings}
            self._kept[key] = make()
        return self._kept[key]

    def _sides(self, *, share: float = 1.0, ahead: bool = True) -> list[ElementTerm]:
        weight = self.settings.saddle_weight
        return self._same((share, ahead), lambda: self.sides.terms(weight=weight, share=share, ahead=ahead))

    def _others(self) -> list[ElementTerm]:
        settings, everywhere = self.settings, torch.arange(self.topology.num_vertices)
        return [
            *self._fairness(),
            *c.even_star_terms(self.stars, weight=settings.evenness_weight),
            *c.handle_terms(everywhere, self.base, weight=settings.anchor_weight, name="anchors"),
            *self.pulls.refreshed_terms(weight=settings.handle_weight),
            *self._closeness(),
            *self._quality(),
        ]

    def _fairness(self) -> list[ElementTerm]:
        weight = self.settings.fairness_weight * (self.rigidity if self.keeps_shape else 1.0)
        if self.settings.second_differences:
            return c.polyline_fairness_terms(self.topology, weight=weight)
        return c.displacement_fairness_terms(self.base, self.topology, weight=weight)

    def _conditions(self, weight: float) -> list[ElementTerm]:
        if self.settings.formulation == "eliminated":
            return c.eliminated_principal_symmetric_terms(self.edges, self.stars, weight=weight)
        if self.settings.formulation == "lifted":
            return c.lifted_principal_symmetric_terms(self.edges, self.stars, self.sides.is_saddle, weight=weight)
        return [
            *c.cospherical_terms(self.stars, weight=weight),
            *c.coplanar_terms(self.edges, self.stars, weight=weight),
        ]

    def _closeness(self) -> list[ElementTerm]:
        if self.keeps_shape:
            return self._kept_shape().terms(weight=self.stiffness * self.settings.shape_weight)
        if self._planes is None:
            return []
        every = torch.arange(self.topology.num_vertices)
        return c.closeness_terms(self._planes, every, weight=self.settings.closeness_weight)

    def _energy(self, constraint_weight: float) -> list[ElementTerm]:
        settings, weight = self.settings, self._energy_weight
        if not weight:
            return []
        if self._lifts_energy:
            planar = torch.ones(self.topology.num_faces, dtype=torch.bool)
            return c.lifted_normal_variation_terms(
                self.base, self.topology, planar, weight=weight, constraint_weight=constraint_weight
            )
        return c.normal_variation_terms(self.topology, smoothing=settings.energy_smoothing, weight=weight)

    def _quality(self) -> list[ElementTerm]:
        smallest = self._smallest_angle
        if not smallest > 0.0:
            return []
        safe = self._angles.clamp(max=_SAFE_ANGLE * smallest).clamp_min(1.1 * smallest)
        return c.corner_angle_terms(self.topology, smallest, safe, weight=0.1)

    # ---- guard -----------------------------------------------------------------------------------------

    def admits(self, state: State, trial: State) -> bool:
        """Whether a step may be taken: no face turns over, and no angle falls below its bound."""
        if not self._keeps_faces(state, trial):
            return False
        return float(corner_angles(trial["vertices"], self.topology).min()) > self._smallest_angle


def _copied(values: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value.clone() if isinstance(value, Tensor) else value for name, value in values.items()}
