"""Principal-symmetric triangle meshes: design coarse, refine, design again (paper sections 2.3 and 5.2)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from ...errors import MeshError, SettingsError
from ...geometry import ReferenceSurface
from ...principal import PrincipalEdges
from ...principal.principal_edges import PrincipalStars
from ...projection import Callback, ProjectionResult
from ...projection.layout import State
from ...settings.symmetric_settings import SymmetricSettings
from ...topology import Topology
from ..job import JobResult, Level, OneStage, Plan, Promise, Recipe, Stage, solved
from ..references import GivenReference, normalised_reference, surface_of
from .changes import Changes
from .measures import symmetric_measures
from .plan import SettlingPlan, SymmetricPlan
from .problem import Aim, SymmetricProblem
from .promises import symmetric_promises
from .refinement import refined
from .strip_normals import strip_normals


@dataclass(frozen=True)
class SymmetricLevel(Level):
    """The mesh of one level of refinement.

    Attributes:
        principal: Its principal edges.
        normals: (V, 3) unit normals n(v), see :func:`strip_normals`.
    """

    principal: PrincipalEdges
    normals: Tensor


class SymmetricRecipe(Recipe[SymmetricSettings]):
    """Makes a triangle mesh principal-symmetric; see :func:`principal_symmetric`.

    Args:
        vertices, principal, fixed, reference, on, settings: See :func:`principal_symmetric`.
        handles: Likewise; more of them may be pulled later.

    Attributes:
        principal: Which edges are principal.
        stars: Where conditions are imposed.
        reference: Surface to stay close to: vertices and topology of a mesh, or a function that gives closest points
            and unit normals (:func:`torchfair.geometry.closest_on`).
        rounds: How often a shape is looked for at most; None for as often as the settings say.
        changes: Compares meshes with the start.
        first: Measures of the mesh that was given, of the coarsest level; None on that level itself.
    """

    name = "symmetric"

    def __init__(
        self,
        vertices: Tensor,
        principal: PrincipalEdges,
        *,
        handles: Mapping[int, Sequence[float]] | None = None,
        fixed: Tensor | None = None,
        reference: GivenReference | None = None,
        on: Tensor | None = None,
        settings: SymmetricSettings | None = None,
    ) -> None:
        self.principal = principal.to("cpu")
        super().__init__(vertices, self.principal.topology, settings or SymmetricSettings())
        self.stars = _chosen(self.principal.stars(), on)
        self.changes = Changes(self.given, self.topology)
        self.reference = reference
        self.rounds: int | None = None
        self.first: Mapping[str, float] | None = None
        surface = None if reference is None else surface_of(normalised_reference(reference, self.unit))
        self.problem = SymmetricProblem(
            self.start, self.principal, self.stars, self._fixed(fixed), self.pulls, surface, self.settings
        )
        self.pull(handles or {})

    def take_settings(self, settings: SymmetricSettings) -> None:
        """Takes other weights."""
        super().take_settings(settings)
        self.problem.settings = settings

    def reconsider(self) -> None:
        """Once a vertex is pulled, the shape is no longer that of the start, even where it is let go again."""
        self.problem.steered |= bool(self.pulls.pulled.any())

    def check_pulls(self, vertices: Tensor, targets: Tensor) -> None:
        """Handles on fixed vertices are refused."""
        fixed = vertices[self.stays()[vertices]].tolist()
        if fixed:
            raise MeshError(f"handles {fixed[:10]} are fixed: free them, or move them before")

    # ---- what is solved --------------------------------------------------------------------------------

    def plan(self, state: State) -> Plan:
        """Rounds until conditions and saddle sides are right; without rounds one run of everything weighted."""
        if not self.settings.rounds:
            self.problem.pull_fully()
            self.problem.sides.decide(state["vertices"])
            return OneStage(
                self.problem.stage(self.problem.blocks(state["vertices"]), Aim.SHAPE, self.settings.projection)
            )
        return SymmetricPlan(self.problem, state, self.rounds or self.settings.rounds)

    def follower(self, state: State) -> Stage:
        """The shape with weighted conditions; what stars are to be is decided anew whenever handles have moved.

        Longer steps would carry handles past their targets.
        """
        self.problem.pulls.strength = 1.0
        self.problem.sides.decide(state["vertices"])
        settings = replace(self.settings.projection, least_extrapolation=math.inf)
        return self.problem.stage(state, Aim.SHAPE, settings)

    def final(self, state: State) -> Stage:
        """The best shape among those that meet the conditions; what stars are to be is decided where the state is."""
        if self.settings.formulation == "lifted":
            raise SettingsError("formulation 'lifted' has no layer: take 'spheres' or 'eliminated'")
        self.problem.pull_fully()
        self.problem.sides.decide(state["vertices"])
        return self.problem.stage(state, Aim.MINIMUM, self.settings.projection)

    def take_reference(self, reference: tuple[Tensor, Topology]) -> None:
        """In place of the one before."""
        self.reference = reference
        vertices, topology = reference
        self.problem.take_reference(ReferenceSurface(self.unit.apply(vertices), topology))

    def trace_reference(self, vertices: Tensor) -> None:
        """Closest points, and the planes there, follow the vertices (R, 3)."""
        self.problem.trace_reference(self.unit.apply(vertices))

    def settling(self, state: State, damping: float | None) -> Plan:
        """Conditions and saddle sides to rounding, from the shape on; if that fails, the whole job."""
        if not self.settings.rounds:
            return super().settling(state, damping)
        return SettlingPlan(self.problem, state, self.rounds or self.settings.rounds, damping)

    def blocks(self, vertices: Tensor) -> State:
        """With auxiliary variables that fit."""
        return self.problem.blocks(vertices)

    def stays(self) -> Tensor:
        """Fixed vertices, with those of the boundary if the settings say so, and isolated ones."""
        return self.problem.stays

    def snapshot(self) -> Callable[[], None]:
        """Puts back what stars are to be."""
        return self.problem.snapshot()

    def forget(self) -> None:
        """Searches for closest points begin anew."""
        self.problem.forget()

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

    # ---- what comes of it ------------------------------------------------------------------------------

    def measures(self, vertices: Tensor) -> dict[str, float]:
        """See :func:`~torchfair.formfinding.symmetric_measures`; and what has changed since the start of the level."""
        handles = self.pulls.vertices
        targets = self.unit.invert(self.pulls.targets[handles])
        measures = symmetric_measures(vertices, self.principal, self.stars, handles, targets)
        return {**measures, **self.changes.measures(vertices)}

    def promises(self, before: Mapping[str, float], after: Mapping[str, float]) -> list[Promise]:
        """See ``symmetric_promises``."""
        has_handles = bool(self.pulls.pulled.any())
        return symmetric_promises(
            self.settings, before, after, self.first, has_handles=has_handles, keeps_shape=self.problem.keeps_shape
        )

    def normals(self, vertices: Tensor) -> Tensor:
        """(V, 3) unit normals n(v) of vertices (V, 3); see :func:`~torchfair.formfinding.strip_normals`."""
        return strip_normals(vertices, self.principal, self.stars)

    def level(
        self, state: State, before: dict[str, float], runs: list[ProjectionResult], like: Tensor
    ) -> SymmetricLevel:
        """With principal edges and normals."""
        level, normals = super().level(state, before, runs, like), self.normals(self.vertices(state))
        return SymmetricLevel(**vars(level), principal=self.principal, normals=normals)

    def refined(self, state: State) -> SymmetricRecipe:
        """On the mesh refined by Loop subdivision, with labels, handles and fixed vertices."""
        return refined(self, self.vertices(state))


def principal_symmetric(
    vertices: Tensor,
    principal: PrincipalEdges,
    *,
    handles: Mapping[int, Sequence[float]] | None = None,
    fixed: Tensor | None = None,
    reference: GivenReference | None = None,
    on: Tensor | None = None,
    levels: int = 0,
    settings: SymmetricSettings | None = None,
    callback: Callback | None = None,
) -> JobResult[SymmetricLevel]:
    """Makes a triangle mesh principal-symmetric, in its shape or through its handles, and refines it.

    At every regular vertex the four neighbours across non-principal edges lie on a sphere through the vertex, along
    principal edges the normals of these spheres and the edge are coplanar, and where the angle sum is above 2 pi the
    star is saddle-shaped. Nothing is asked of singular and boundary vertices. Promises, which are measured on every
    level (:attr:`~torchfair.formfinding.JobResult.promises`): conditions within ``settings.tolerance``; negatively
    curved stars saddle-shaped, without pyramids that intersect themselves; handles within 0.05 mean edges of their
    targets; no face turned over.

    Without handles and reference the shape is kept, unless ``settings.free``: vertices stay close to the surface on
    which the level starts, its boundary glides on smooth curves through it, corners stay. Promised is then, too, that
    no vertex is farther than 0.1 mean edges from that surface, and that E/C grows by 1 % at most. Where the lattice is
    turned against principal directions, edges have to turn, and neither may be possible: see
    :func:`torchfair.principal.misalignment_of`.

    Principal edges must run along a principal direction of the surface, and near parabolic curves along that of the
    smaller curvature: stars there cannot be saddle-shaped otherwise.

    Args:
        vertices: (V, 3) start.
        principal: Which edges are principal, with the topology.
        handles: Places by vertex number. They pull their surroundings along; unless the conditions forbid it they
            are reached, but for a hundredth of an edge or so.
        fixed: (V,) bool, vertices that keep their places.
        reference: Surface to stay close to: vertices and topology of a mesh, or a function that gives closest points
            and unit normals (:func:`torchfair.geometry.closest_on`).
        on: (n,) vertices where conditions are imposed, such as those of some principal polylines (paper Fig. 14h);
            by default all regular ones. With ``settings.energy_weight`` E is lowered everywhere else.
        levels: How often to refine by Loop subdivision; the labels are carried along.
        settings: Weights and tolerances.
        callback: Called with every iteration record; returning True stops. Ctrl-C, or a function that raises
            KeyboardInterrupt, returns the best state so far.

    Returns:
        One level for every mesh from coarse to fine, with its principal edges and normals.

    Raises:
        ShapeError: vertices are not ``(V, 3)``, or a handle is not a point.
        MeshError: vertices are not finite, a face has no area, a handle is no vertex or fixed, or no condition can be
            imposed.

    Example:
        >>> from torchfair.formfinding import principal_symmetric
        >>> from torchfair.principal import principal_edges_of_lattice
        >>> from torchfair.shapes import Catenoid, principal_triangles
        >>> mesh = principal_triangles(Catenoid(), 6, 12)
        >>> edges = principal_edges_of_lattice(mesh)
        >>> target = (1.1 * mesh.vertices[0]).tolist()
        >>> result = principal_symmetric(mesh.vertices, edges, handles={0: target})
        >>> result.after["largest_cospherical"] < 1e-6
        True
    """

    def begin() -> SymmetricRecipe:
        return SymmetricRecipe(
            vertices, principal, handles=handles, fixed=fixed, reference=reference, on=on, settings=settings
        )

    return solved(begin, vertices, levels=levels, callback=callback)


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
