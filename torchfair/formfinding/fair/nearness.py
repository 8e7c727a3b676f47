"""How near a mesh stays to its reference surface, and when a handle has that given up."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property

import torch
from torch import Tensor

from ... import constraints as c
from ...constraints.closeness import Feet
from ...geometry import ReferenceSurface, closest_on, face_centres
from ...geometry._closest_farthest import largest_distance
from ...geometry.reference import Reference
from ...progress import phase
from ...projection import ElementTerm
from ...projection.layout import State
from ...topology import Topology
from ..differentiable.traced_planes import TracedPlanes
from ..job.pulls import Pulls
from ..references import GivenReference, distances_from, surface_of
from .gliding_boundary import GlidingBoundary

_NO_LIMIT = 1e9  # mean edge lengths
_ROUNDING = 1.0 + 1e-9  # of distances at the start


class Nearness:
    """Closeness to a reference surface, with a largest distance from it.

    Both are given up while a handle is pulled off the surface (design mode, paper Fig. 12). Once all handles are back
    on it, or let go, closeness draws the mesh back, and no vertex may go farther away than it is.

    Args:
        vertices: (V, 3) start, normalised.
        topology: Its connectivity.
        reference: The surface, normalised, a mesh or a function.
        pulls: Handles and held vertices.
        boundary: Curves on which boundary vertices glide, which are left to these; None if they do not.
        limit: Largest distance, normalised; None for no limit.
        input_edge: Mean edge length of the input, normalised.
        notes: Where decisions are told, in words.
        surface: The reference, where closest points on it have been made ready already.

    Attributes:
        points: (n, 3) points on it: its vertices; of a function those nearest to the vertices and to the centres of the
            faces of the start.
        limit: As given.
        limits: (V,) largest distances from it; None for no limit.
        allowed: (V,) the same as they are now: none in design mode, more than ``limits`` on the way back from it.
        design_mode: Whether a handle is pulled off the surface, which is then given up.
    """

    def __init__(
        self,
        vertices: Tensor,
        topology: Topology,
        reference: GivenReference,
        pulls: Pulls,
        boundary: GlidingBoundary | None,
        *,
        limit: float | None,
        input_edge: float,
        notes: list[str],
        surface: Reference | None = None,
    ) -> None:
        self._vertices, self._pulls, self._boundary = vertices, pulls, boundary
        self._used = topology.valences > 0
        self.limit, self._input_edge, self._notes = limit, input_edge, notes
        self._reference, self._is_start = reference, isinstance(reference, tuple) and reference[0] is vertices
        if surface is not None:
            self.surface = surface
        self.design_mode = False
        self.forget()
        if self._is_start:  # the surface is made once something leaves it
            self.points = vertices[self._used]
        else:
            with phase("preparing the reference surface"):
                self.points = _points_on(self.surface, reference, vertices, topology)
        with phase("distances from the reference surface"):
            self.limits = self.allowed = self._limits()

    @cached_property
    def surface(self) -> Reference:
        """With closest points; of the start itself it is made when first asked for."""
        with phase("preparing the reference surface"):
            return surface_of(self._reference)

    def forget(self) -> None:
        """Makes searches for closest points anew."""
        self._feet: Feet | None = None

    def _planes(self, state: State) -> tuple[Tensor, Tensor]:
        if self._feet is None:
            self._feet = c.TangentPlanes(self.surface)
        return self._feet(state)

    def trace(self, vertices: Tensor) -> None:
        """Makes planes from now on differentiable functions of the vertices (R, 3) of the surface, a mesh."""
        assert isinstance(self.surface, ReferenceSurface)
        self._feet = TracedPlanes(self.surface, vertices)

    # ---- decisions -------------------------------------------------------------------------------------

    @property
    def is_on_the_way_back(self) -> bool:
        """Whether limits are others than those of the start."""
        return self.allowed is not self.limits

    def reconsider(self) -> None:
        """Takes in that handles are pulled elsewhere."""
        before, self.design_mode = self.design_mode, self._is_left()
        if self.design_mode and self.limits is not None:
            self.allowed = torch.full_like(self.limits, _NO_LIMIT)
        self._pulls.version += before != self.design_mode

    def take_up(self, vertices: Tensor) -> None:
        """Lifts limits to where handles have left the ``vertices`` (V, 3), once these are let go or on it again."""
        if self.design_mode or self.limits is None or self.allowed is None or self.allowed is self.limits:
            return
        lifted = torch.maximum(self.limits, self.distances(vertices) * _ROUNDING).minimum(self.allowed)
        self.allowed = lifted if bool((lifted > self.limits).any()) else self.limits
        self._pulls.version += 1

    def lift(self, vertices: Tensor, most: float = 0.0, *, room: float = 1.0) -> None:
        """Lifts limits to where the ``vertices`` (V, 3) are, and to ``most`` mean edges of the input; never below.

        With ``room`` above 1 to so many times their distances, but not beyond the farthest of them.
        """
        if self.limits is None or self.design_mode:
            return
        distances = self.distances(vertices) * _ROUNDING
        lifted = (room * distances).minimum(distances[self._used].max()).clamp_min(most * self._input_edge)
        self.allowed = torch.maximum(self.limits, lifted)
        self._pulls.version += 1

    def put_back(self) -> None:
        """Limits are those of the start again."""
        if not self.design_mode:
            self.allowed = self.limits
            self._pulls.version += 1

    def snapshot(self) -> Callable[[], None]:
        """A function that puts back what handles have changed."""
        design_mode, allowed = self.design_mode, self.allowed

        def put_back() -> None:
            self.design_mode, self.allowed = design_mode, allowed

        return put_back

    def _is_left(self) -> bool:
        handles = self._pulls.vertices
        if not handles.numel() or self.limit is None:
            return False
        farthest = float(distances_from(self.surface, self._pulls.targets[handles]).max())
        if farthest > self.limit and not self.design_mode:
            self._notes.append(
                f"a handle pulls {farthest / self._input_edge:.3g} mean edge lengths off the reference surface: "
                "closeness and the distance limit are switched off (design mode)"
            )
        return farthest > self.limit

    def _limits(self) -> Tensor | None:
        """(V,) largest distances that are allowed; isolated vertices have no limit."""
        if self.limit is None:
            return None
        distances = self.distances(self._vertices)
        far = int((distances > self.limit)[self._used].sum())
        if far:
            self._notes.append(f"{far} vertices start farther from the reference surface than the distance limit")
        return torch.where(self._used, distances.clamp_min(self.limit) * _ROUNDING, _NO_LIMIT)

    # ---- terms and distances ---------------------------------------------------------------------------

    def terms(self, *, weight: float, barrier_weight: float) -> list[ElementTerm]:
        """Closeness, and the barrier before the limits."""
        pulls, used = self._pulls, self._used
        if self.design_mode and not pulls.everywhere:
            return []
        close = used if self._boundary is None else used & ~(self._boundary.held & ~pulls.pulled)
        chosen = torch.nonzero(used if pulls.everywhere else close).squeeze(1)
        (term,) = c.closeness_terms(self._near_surface, chosen, weight=weight)
        if pulls.everywhere:
            weights = torch.zeros_like(close) if self.design_mode else close
            term = replace(term, element_weights=weights[chosen].to(self._vertices))
        if self.allowed is None:
            return [term]
        return [term, *c.distance_limit_terms(self._near_surface_or_curve, self.allowed, weight=barrier_weight)]

    def distances(self, vertices: Tensor) -> Tensor:
        """(V,) distances from the reference surface or, where a vertex glides on a curve that is nearer, from that."""
        if self._is_reference(vertices):
            return vertices.new_zeros(len(vertices))
        positions, _ = self._nearest({"vertices": vertices})
        distances: Tensor = torch.linalg.vector_norm(vertices - positions, dim=1)
        return distances

    def largest_distance_back(self, vertices: Tensor, topology: Topology, *, like_start: bool) -> float:
        """Largest distance of :attr:`points` from a mesh (V, 3).

        Args:
            vertices: Of the mesh.
            topology: Its connectivity.
            like_start: Whether its vertices are near those of the reference that have the same numbers.
        """
        if self._is_reference(vertices):
            return 0.0
        owners = None
        if like_start and isinstance(self._reference, tuple):
            owners = torch.nonzero(self._reference[1].valences > 0).squeeze(1)
        return largest_distance(self.points, vertices, topology, owners)

    def _is_reference(self, vertices: Tensor) -> bool:
        """Whether these are the vertices of the reference itself: they are on it, without being looked for."""
        return self._is_start and torch.equal(vertices[self._used], self.points)

    def _near_surface(self, state: State) -> tuple[Tensor, Tensor]:
        """Closest points on the surface and normals there; where it is given up, nothing that costs."""
        return (state["vertices"], self._vertices) if self.design_mode else self._planes(state)

    def _near_surface_or_curve(self, state: State) -> tuple[Tensor, Tensor]:
        return (state["vertices"], self._vertices) if self.design_mode else self._nearest(state)

    def _nearest(self, state: State) -> tuple[Tensor, Tensor]:
        """Planes from which distances are measured: of gliding vertices from the surface or from their curve."""
        planes = self._planes(state)
        return planes if self._boundary is None else self._boundary.nearest(state, *planes)


def _points_on(surface: Reference, reference: GivenReference, vertices: Tensor, topology: Topology) -> Tensor:
    if isinstance(reference, tuple):
        return reference[0][reference[1].valences > 0]
    places = torch.cat([vertices[topology.valences > 0], face_centres(vertices, topology)])
    return closest_on(surface)(places)[0]
