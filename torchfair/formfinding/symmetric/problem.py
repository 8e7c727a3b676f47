"""The problem of a principal-symmetric mesh on one level of refinement, compiled once for many edits."""

from __future__ import annotations

import copy
from collections.abc import Callable
from enum import Enum

import torch
from torch import Tensor

from ... import constraints as c
from ...constraints.closeness import TangentPlanes
from ...constraints.eliminated_principal_symmetric import eliminated_principal_symmetric_terms
from ...constraints.handles import offset
from ...constraints.lifted_principal_symmetric import lifted_blocks, lifted_principal_symmetric_terms
from ...constraints.principal_symmetric import between_stars, sphere_blocks
from ...constraints.saddle_sides import SaddleSides
from ...geometry import corner_angles
from ...geometry.closest_point import ReferenceSurface
from ...principal import PrincipalEdges
from ...principal.principal_edges import PrincipalStars
from ...projection import ElementTerm, GuidedProjection
from ...projection.layout import State
from ..face_guard import FaceGuard
from .settings import SymmetricSettings

_SAFE_ANGLE = 2.5  # smallest angles at which the barrier sets in
_KEPT_MARGIN = 0.1  # share of the margin of saddle sides that is kept where conditions are met exactly


class Aim(Enum):
    """What a run is for."""

    SEARCH = "conditions, saddle sides and everything else, weighted; stars may turn into others"
    SHAPE = "the same, stars stay what they are"
    TIGHT = "the same as SHAPE with conditions weighted more"
    EXACT = "conditions and saddle sides alone"
    CONDITIONS = "conditions alone"


class SymmetricProblem:
    """Terms and compiled runs for one mesh in normalised units.

    Args:
        base: (V, 3) where fairness wants to see the displacement zero.
        principal: Which edges are principal.
        stars: Where conditions are imposed.
        handles: (n,) vertices that are pulled.
        fixed: (V,) vertices that do not move.
        reference: Surface to stay close to.
        settings: Weights.

    Attributes:
        targets: (n, 3) of the handles; assign to move them.
        pull: Factor of the weight of handles.
        sides: What stars are to be; see :class:`~torchfair.constraints.saddle_sides.SaddleSides`.
    """

    def __init__(
        self,
        base: Tensor,
        principal: PrincipalEdges,
        stars: PrincipalStars,
        handles: Tensor,
        fixed: Tensor,
        reference: ReferenceSurface | None,
        settings: SymmetricSettings,
    ) -> None:
        self.base, self.topology, self.stars, self.settings = base, principal.topology, stars, settings
        self.handles, self.fixed, self.targets = handles, fixed, base[handles]
        self.pull = 1.0
        self.edges = between_stars(self.topology.edges[principal.mask], stars)
        self.sides = SaddleSides(stars, margin=settings.saddle_margin)
        self._reference = reference
        self._compiled: dict[Aim, GuidedProjection] = {}
        self.forget_compiled()
        self._angles = corner_angles(base, self.topology)
        self._smallest_angle = min(settings.smallest_angle, 0.8 * float(self._angles.min()))
        self._keeps_faces = FaceGuard(self.topology, lambda state: state["vertices"])

    def snapshot(self) -> Callable[[], None]:
        """A function that puts targets, pull and saddle sides back to what they are now.

        Linear solvers too: those that fell back to double precision would go on in it, and round differently.
        """
        targets, pull, sides, compiled = self.targets.clone(), self.pull, self.sides, dict(self._compiled)
        saved = {name: value.clone() if isinstance(value, Tensor) else value for name, value in vars(sides).items()}

        solvers = {aim: copy.copy(problem.solver) for aim, problem in compiled.items()}

        def restore() -> None:
            self.targets, self.pull, self._compiled = targets, pull, compiled
            for aim, solver in solvers.items():
                compiled[aim].solver = solver
            vars(sides).update(saved)

        return restore

    def forget_compiled(self) -> None:
        """Compiles anew from now on: what was interrupted while it searched or factorised may not be whole."""
        self._compiled = {}
        self._planes = None if self._reference is None else TangentPlanes(self._reference)

    def blocks(self, vertices: Tensor) -> State:
        """Variable blocks that fit ``vertices``."""
        if self.settings.formulation == "spheres":
            return {"vertices": vertices, **sphere_blocks(vertices, self.stars)}
        if self.settings.formulation == "lifted":
            return {"vertices": vertices, **lifted_blocks(vertices, self.edges, self.stars)}
        return {"vertices": vertices}

    def compiled(self, aim: Aim) -> GuidedProjection:
        """The run of an aim, with its symbolic analysis made once."""
        if aim not in self._compiled or self.settings.formulation == "lifted":
            self._compiled[aim] = GuidedProjection(
                self.blocks(self.base),
                self.terms(aim),
                fixed={"vertices": self.fixed[:, None].expand(-1, 3).contiguous()},
                solver=self.settings.projection.solver,
            )
        return self._compiled[aim]

    def terms(self, aim: Aim) -> list[ElementTerm]:
        """Element terms of an aim."""
        settings = self.settings
        if aim in (Aim.EXACT, Aim.CONDITIONS):
            sides = self.sides.terms(weight=settings.saddle_weight, share=_KEPT_MARGIN) if aim is Aim.EXACT else []
            return [*self._conditions(settings.constraint_weight), *sides]
        weight = settings.tight_weight if aim is Aim.TIGHT else settings.constraint_weight
        everywhere = torch.arange(self.topology.num_vertices)
        return [
            *self._conditions(weight),
            *self.sides.terms(weight=settings.saddle_weight, ahead=aim is not Aim.SEARCH),
            *c.displacement_fairness_terms(self.base, self.topology, weight=settings.fairness_weight),
            *c.even_star_terms(self.stars, weight=settings.evenness_weight),
            *c.handle_terms(everywhere, self.base, weight=settings.anchor_weight, name="anchors"),
            *self._handles(),
            *self._closeness(),
            *self._energy(),
            *self._quality(),
        ]

    def _conditions(self, weight: float) -> list[ElementTerm]:
        if self.settings.formulation == "eliminated":
            return eliminated_principal_symmetric_terms(self.edges, self.stars, weight=weight)
        if self.settings.formulation == "lifted":
            return lifted_principal_symmetric_terms(self.edges, self.stars, self.sides.is_saddle, weight=weight)
        return [
            *c.cospherical_terms(self.stars, weight=weight),
            *c.coplanar_terms(self.edges, self.stars, weight=weight),
        ]

    def _handles(self) -> list[ElementTerm]:
        if not self.handles.numel():
            return []
        stencil = [("vertices", self.handles[:, None])]
        return [
            ElementTerm(
                "handles",
                pulled_offset,
                stencil,
                weight=self.settings.handle_weight,
                refresh=lambda state: (self.targets, self.targets.new_full(self.handles.shape, self.pull)),
            )
        ]

    def _closeness(self) -> list[ElementTerm]:
        if self._planes is None:
            return []
        every = torch.arange(self.topology.num_vertices)
        return c.closeness_terms(self._planes, every, weight=self.settings.closeness_weight)

    def _energy(self) -> list[ElementTerm]:
        settings = self.settings
        if not settings.energy_weight:
            return []
        return c.normal_variation_terms(
            self.topology, smoothing=settings.energy_smoothing, weight=settings.energy_weight
        )

    def _quality(self) -> list[ElementTerm]:
        smallest = self._smallest_angle
        if not smallest > 0.0:
            return []
        safe = self._angles.clamp(max=_SAFE_ANGLE * smallest).clamp_min(1.1 * smallest)
        return c.corner_angle_terms(self.topology, smallest, safe, weight=0.1)

    def admits(self, state: State, trial: State) -> bool:
        """Whether a step may be taken: no face turns over, and no angle falls below its bound."""
        if not self._keeps_faces(state, trial):
            return False
        return float(corner_angles(trial["vertices"], self.topology).min()) > self._smallest_angle


def pulled_offset(x: Tensor, target: Tensor, pull: Tensor) -> Tensor:
    """From the target to the vertex ``x`` (1, 3), times the square root of ``pull``."""
    return pull.sqrt() * offset(x, target)
