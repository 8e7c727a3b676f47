"""A principal-symmetric mesh that answers while its handles are moved."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

import torch
from torch import Tensor

from ..._interrupts import deferred_interrupts
from ..._threads import threads_for
from ...boundary import boundary_corners
from ...constraints import BoundaryNormals
from ...errors import MeshError
from ...geometry.closest_point import ReferenceSurface
from ...normalisation import Normalisation
from ...principal import PrincipalEdges
from ...principal.principal_edges import PrincipalStars
from ...projection import Callback, ProjectionResult, Status
from ...subdivision import Refinement, interpolate_vertices, loop, near
from ...subdivision.interpolation import BOUNDARY_CORNER
from ...topology import Topology
from ..checks import one_start, refuse_degenerate_faces
from ..handles import read_handles
from .measures import symmetric_measures
from .problem import SymmetricProblem
from .rounds import SymmetricRounds
from .settings import SymmetricSettings
from .strip_normals import strip_normals

_KEPT_RINGS = 6  # from the boundary on, over which Loop subdivision passes from interpolating to smoothing


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

    Raises:
        ShapeError: vertices do not fit the topology.
        MeshError: the mask of fixed vertices does not fit, vertices are not finite, a face has no area, a handle is
            fixed, or there is no star to impose conditions on.
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

    def solve(self, callback: Callback | None = None, *, rounds: int | None = None) -> bool:
        """Meets the conditions near the current state; returns whether it was stopped by callback or Ctrl-C.

        The shape is found with weighted conditions; then they are met exactly, by the shortest way. Where that fails
        it is tried again with handles that pull less: they yield to the conditions. A few saddle sides that come out
        wrong are tried again with a wider margin. The best state found is kept, also after Ctrl-C. Where a callback
        raises any other error, the design is as it was before.

        Args:
            callback: Called with every iteration record; returning True stops.
            rounds: How often that is tried, by default as the settings say. With 1 the answer is fast enough to
                follow a handle that is dragged; solve again when it is let go.
        """
        return self._edited(self.problem.targets, callback, rounds)

    def _edited(self, targets: Tensor, callback: Callback | None, rounds: int | None) -> bool:
        """Solves for handles at ``targets`` (n, 3), normalised. Errors leave everything as it was."""
        changes = self._reference is not None or self.settings.energy_weight > 0.0
        with deferred_interrupts() as interrupts:
            restore = interrupts.insist(self.problem.snapshot)
            work = SymmetricRounds(self.problem, self.principal, self._state, callback)
            try:
                self.problem.targets = targets
                with threads_for(self.vertices.numel(), self.vertices.device):
                    stopped = interrupts.insist(partial(work.run, settled=not changes), rounds or self.settings.rounds)
                moved = interrupts.insist(self.normalisation.invert, work.state["vertices"])
                vertices = torch.where(self.fixed[:, None], self.vertices, moved)
            except BaseException as error:
                restore()
                if not isinstance(error, Exception):
                    self.problem.forget_compiled()
                raise
            if work.runs and work.runs[-1].status is Status.INTERRUPTED:
                self.problem.forget_compiled()
            self.runs, self._state, self.vertices = [*self.runs, *work.runs], work.state, vertices
        return stopped

    def move(
        self,
        targets: Mapping[int, Sequence[float]],
        callback: Callback | None = None,
        *,
        rounds: int | None = None,
    ) -> bool:
        """Moves handles to ``targets`` and solves; see :meth:`solve`.

        Raises:
            ShapeError: a target is not a point with finite coordinates.
            MeshError: a vertex is none of the handles.
        """
        rows = {vertex: row for row, vertex in enumerate(self.handles.tolist())}
        moved = self.problem.targets.clone()
        vertices, places = read_handles(targets, self.topology)
        for vertex, place in zip(vertices.tolist(), self.normalisation.apply(places), strict=True):
            if vertex not in rows:
                raise MeshError(f"vertex {vertex} is no handle of this design: handles are {list(rows)[:10]}")
            moved[rows[vertex]] = place
        return self._edited(moved, callback, rounds)

    def refined(self) -> SymmetricDesign:
        """The design on the mesh refined by Loop subdivision, labels, handles and fixed vertices carried along.

        Vertices keep their places on the boundary and where they are fixed, and fewer and fewer away from there: see
        :func:`~torchfair.subdivision.interpolate_vertices`.
        """
        corners = boundary_corners(self.vertices, self.topology, BOUNDARY_CORNER)
        step = loop(self.topology, boundary="interpolate", corners=corners)
        normals = BoundaryNormals.of(self.vertices, self.topology).at_boundary
        keep = near(self.topology, self.topology.is_boundary_vertex | self.fixed, _KEPT_RINGS)
        finer = SymmetricDesign(
            interpolate_vertices(step, self.vertices, normals, keep=keep),
            self.principal.refine(step),
            handles=self.handles.tolist(),
            fixed=_carried(step, self.fixed, _on_boundary(self.topology)),
            reference=self._reference,
            on=self._finer_stars(step),
            settings=self.settings,
        )
        finer.problem.targets = finer.normalisation.apply(self.targets)
        return finer

    def _finer_stars(self, step: Refinement) -> Tensor | None:
        """Stars of the finer mesh on the same polylines; None if conditions are imposed everywhere."""
        if self.stars.vertices.shape[0] == self.principal.stars().vertices.shape[0]:
            return None
        chosen = torch.zeros(self.topology.num_vertices, dtype=torch.bool)
        chosen[self.stars.vertices] = True
        return torch.nonzero(_carried(step, chosen, self.principal.mask)).squeeze(1)

    def measures(self) -> dict[str, float]:
        """See :func:`~torchfair.formfinding.symmetric_measures`."""
        return symmetric_measures(self.vertices, self.principal, self.stars, self.handles, self.targets)

    def normals(self) -> Tensor:
        """(V, 3) unit normals n(v); see :func:`~torchfair.formfinding.strip_normals`."""
        return strip_normals(self.vertices, self.principal, self.stars)

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


def _on_boundary(topology: Topology) -> Tensor:
    """(E,) bool: boundary edges."""
    return torch.arange(topology.num_edges) >= topology.num_interior_edges


def _carried(step: Refinement, mask: Tensor, along: Tensor) -> Tensor:
    """The mask of vertices on the finer mesh, with new vertices on edges ``along`` between two of them."""
    return step.carry_vertex_labels(mask, along=along & mask[step.coarse.edges].all(1))


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
