"""The terms and fixed vertices of the job that lowers C, on one level of refinement."""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import torch
from torch import Tensor

from ... import constraints as c
from ..._graph import graph_laplacian
from ...energies import total_absolute_curvature
from ...geometry import corner_angles, dihedral_angles, vertex_normals
from ...geometry.spline_curves import SplineCurves
from ...linear import Factor, factorise
from ...measuring.trust import LARGEST_DIHEDRAL
from ...normalisation import Normalisation
from ...projection import ElementTerm, LogAbsolute, SmoothAbsolute, SmoothNuclearNorm
from ...settings.form_settings import FormSettings
from ...topology import Topology
from ..job.pulls import Pulls
from .boundary_track import BoundaryTrack
from .rim import Rim

_EXACTLY = 10.0  # weight of tangent planes in the end, over that on the way
_EVENED = 0.2  # of the extent of the mesh
_LEAST_LENGTH = 1e-2  # of a mean of unit normals that still has a direction
_LEAST_SMOOTHING = 1e-4  # mean edge lengths: where a flat start has nothing to measure it by


class FormProblem:
    """Everything guided projection needs to lower C of one triangle mesh.

    Args:
        topology: Triangle mesh.
        normalisation: To unit mean edge length.
        rim: What is asked along the boundary.
        pulls: Handles and held vertices.
        settings: Weights.
    """

    def __init__(
        self, topology: Topology, normalisation: Normalisation, rim: Rim, pulls: Pulls, settings: FormSettings
    ) -> None:
        self.topology, self.settings, self.pulls, self.normals = topology, settings, pulls, rim.normals
        self._normalisation, self._track = normalisation, rim.track

    @property
    def fixed(self) -> Tensor:
        """(V,) bool, vertices that do not move."""
        return staying_vertices(self.topology, self._track, self.settings) | self.pulls.held

    @property
    def length(self) -> float:
        """One mean edge length, in the unit of the input."""
        return self._normalisation.length

    @property
    def glides(self) -> bool:
        """Whether boundary vertices slide along their curves."""
        return self.settings.boundary == "glide"

    def smoothing(self, vertices: Tensor, fraction: float) -> float:
        """Smoothing that is the given fraction of the mean absolute curvature of a star."""
        mean = float(total_absolute_curvature(vertices, self.topology)) / max(1, self.topology.num_vertices)
        return max(fraction * mean, _LEAST_SMOOTHING)

    # ---- vertices move along normals -------------------------------------------------------------------

    def directions(self, vertices: Tensor) -> Tensor:
        """(V, 3) vertex normals, evened out over a fifth of the mesh; towards their targets at handles.

        Raw normals of a mesh that is not smooth yet cross each other and would drive vertices together.
        """
        ways = self._evened(vertex_normals(vertices, self.topology))
        handles = self.pulls.vertices
        pull = self.pulls.aims[handles] - vertices[handles]
        length = torch.linalg.vector_norm(pull, dim=1, keepdim=True)
        ways[handles] = torch.where(length > 0.0, pull / length, ways[handles])
        return ways

    def height_terms(
        self, vertices: Tensor, directions: Tensor, smoothing: float, fairness_weight: float, *, correct: bool = False
    ) -> list[ElementTerm]:
        """Terms whose unknowns are heights along the directions; the boundary stays."""
        others = self._others(vertices, fairness_weight, correct=correct)
        pulls = self.pulls.terms(weight=self.settings.handle_weight, as_data=True)
        terms = [*self._curvature(smoothing), *self._bending(smoothing), *others, *pulls]
        return [c.along_directions(term, vertices, directions) for term in terms]

    def _evened(self, normals: Tensor) -> Tensor:
        """Unit vectors ``d`` with ``(I + (f sqrt(V))^2 / 6 L) d ~ n``, L the graph Laplacian."""
        found = self._evening.solve(normals).values
        length = torch.linalg.vector_norm(found, dim=1, keepdim=True)
        return torch.where(length > _LEAST_LENGTH, found / length.clamp_min(_LEAST_LENGTH), normals)

    @cached_property
    def _evening(self) -> Factor:
        from scipy.sparse import eye_array

        size = self.topology.num_vertices
        reach = (_EVENED * size**0.5) ** 2 / 6.0
        return factorise(eye_array(size) + reach * graph_laplacian(self.topology))

    # ---- vertices move in space ------------------------------------------------------------------------

    def blocks(self, vertices: Tensor) -> dict[str, Tensor]:
        """Variable blocks at ``vertices``."""
        if self.settings.formulation == "reduced":
            return {"vertices": vertices}
        return {"vertices": vertices, **c.lifted_absolute_curvature_blocks(vertices, self.topology)}

    def terms(self, vertices: Tensor, smoothing: float, fairness_weight: float | None = None) -> list[ElementTerm]:
        """Terms whose unknowns are the vertices, or those of the lifted formulation.

        Args:
            vertices: (V, 3) where fairness and tangent planes are seen from.
            smoothing: See :meth:`smoothing`.
            fairness_weight: By default that of the settings.
        """
        settings = self.settings
        pulls = self.pulls.terms(weight=settings.handle_weight)
        fairness = settings.fairness_weight if fairness_weight is None else fairness_weight
        others = [*self._others(vertices, fairness), *pulls, *self._spreading()]
        if settings.formulation == "reduced":
            return [*self._curvature(smoothing), *self._bending(smoothing), *others]
        lifted = c.lifted_absolute_curvature_terms(
            self.topology,
            smoothing=smoothing,
            weight=settings.curvature_weight,
            constraint_weight=settings.constraint_weight,
            absolute=LogAbsolute if settings.absolute_value == "logarithmic" else SmoothAbsolute,
        )
        return [*lifted, *others]

    def traced_terms(self, vertices: Tensor, fraction: float) -> list[ElementTerm]:
        """The same for the smoothing of that fraction, as differentiable functions of the vertices (V, 3)."""
        mean = total_absolute_curvature(vertices, self.topology) / max(1, self.topology.num_vertices)
        smoothing = (fraction * mean).clamp_min(_LEAST_SMOOTHING)
        terms = self.terms(vertices, float(smoothing.detach()))
        return [_smoothed(term, smoothing) if isinstance(term.loss, SmoothNuclearNorm) else term for term in terms]

    @property
    def fixed_in_space(self) -> Tensor:
        """(V,) bool, vertices that stay while others are spread.

        Next to prescribed tangent planes they all do: it would be easier to crowd them at the boundary, where stars are
        turned by little moves, than to bend the surface.
        """
        if not self.keeps_rows:
            return self.fixed
        v, w = self.topology.edges.unbind(1)
        prescribed = (self.normals != 0.0).any(1)
        held = self.fixed.clone()
        held[w[prescribed[v]]] = True
        held[v[prescribed[w]]] = True
        return held

    @property
    def keeps_rows(self) -> bool:
        """Whether vertices next to prescribed tangent planes move along normals only."""
        settings = self.settings
        return self.has_tangent_planes and settings.boundary == "fixed" and settings.formulation == "reduced"

    @property
    def has_tangent_planes(self) -> bool:
        """Whether normals are prescribed."""
        return bool((self.normals != 0.0).any())

    # ---- judging ---------------------------------------------------------------------------------------

    def merit(self, vertices: Tensor, smoothing: float) -> float:
        """Smoothed C, for comparing surfaces."""
        return _total(self._curvature(smoothing), vertices)

    def curvature_and_pulls(self, vertices: Tensor) -> float:
        """C, and what handles miss, for comparing surfaces."""
        pulls = self.pulls.terms(weight=self.settings.handle_weight, as_data=True)
        return float(total_absolute_curvature(vertices, self.topology)) + _total(pulls, vertices)

    def has_collapsed(self, vertices: Tensor, start: Tensor) -> bool:
        """Whether a corner angle is smaller than the settings allow and than half the smallest of the start."""
        return self.smallest_angle(vertices) < self.least_angle(start)

    def least_angle(self, start: Tensor) -> float:
        """Smallest corner angle, radians, that is not a collapse from this start."""
        return min(self.settings.least_angle, 0.5 * self.smallest_angle(start))

    def smallest_angle(self, vertices: Tensor) -> float:
        """Smallest corner angle, radians."""
        return float(corner_angles(vertices, self.topology).min())

    def steepest(self, start: Tensor) -> float:
        """Largest dihedral angle, radians, to which steps may fold an edge from this start.

        Any where no handle pulls: a surface that folds then is given other faces if they may be replaced, and ends
        lower than one that is held at an angle.
        """
        if not bool(self.pulls.pulled.any()):
            return math.pi
        angles = dihedral_angles(start, self.topology).abs()
        return max(math.radians(LARGEST_DIHEDRAL), float(angles.max()) if angles.numel() else 0.0)

    # ---- terms -----------------------------------------------------------------------------------------

    def _curvature(self, smoothing: float) -> list[ElementTerm]:
        return c.absolute_curvature_terms(self.topology, smoothing=smoothing, weight=self.settings.curvature_weight)

    def _bending(self, smoothing: float) -> list[ElementTerm]:
        if not self.has_tangent_planes:
            return []
        weight = self.settings.curvature_weight
        return c.boundary_bending_terms(self.topology, self.normals, smoothing=smoothing, weight=weight)

    def _others(self, vertices: Tensor, fairness_weight: float, *, correct: bool = False) -> list[ElementTerm]:
        """Fairness and conditions, the former and tangent planes as seen from ``vertices``."""
        return [
            *c.even_fairness_terms(vertices, self.topology, weight=fairness_weight),
            *self._umbrellas(),
            *self._tangent_planes(vertices, correct),
        ]

    def _umbrellas(self) -> list[ElementTerm]:
        weight = self.settings.umbrella_weight
        return c.interior_fairness_terms(self.topology, weight=weight) if weight else []

    def _tangent_planes(self, vertices: Tensor, correct: bool) -> list[ElementTerm]:
        chosen = torch.nonzero((self.normals != 0.0).any(1)).squeeze(1)
        if not chosen.numel():
            return []
        weight = self.settings.tangent_weight
        if correct:
            exactly = _EXACTLY * weight
            return c.tangent_patch_terms(vertices, self.topology, chosen, self.normals[chosen], weight=exactly)
        targets = c.BoundaryNormals.of(vertices, self.topology).star_targets(self.normals)
        return c.tangent_plane_terms(self.topology, chosen, targets[chosen], weight=weight)

    def _spreading(self) -> list[ElementTerm]:
        """What only vertices that move in space need: they slide along curves, and over the surface."""
        settings, terms = self.settings, []
        if self._feet is not None:
            terms += c.gliding_terms(self._feet, weight=settings.boundary_weight)
            terms += c.boundary_fairness_terms(self.topology, self._track.corners, weight=settings.fairness_weight)
        if settings.tangential_fairness_weight:
            terms += c.tangential_fairness_terms(self.topology, weight=settings.tangential_fairness_weight)
        return terms

    @cached_property
    def _feet(self) -> c.CurveFeet | None:
        """Of gliding vertices on their curves."""
        track = self._track
        spans = [span for curve in track.curves for span in curve.spans()]
        if self.settings.boundary == "fixed" or not spans:
            return None
        vertices = torch.nonzero(self.topology.is_boundary_vertex & ~track.corners).squeeze(1)
        normalise = self._normalisation.apply
        curves = SplineCurves([normalise(span.points) for span in spans], [span.closed for span in spans])
        return c.CurveFeet(curves, vertices, track.spans(vertices))

    def forget(self) -> None:
        """Makes searches for closest points anew."""
        self.__dict__.pop("_feet", None)


def staying_vertices(topology: Topology, track: BoundaryTrack, settings: FormSettings) -> Tensor:
    """(V,) bool, vertices that do not move: the boundary or, where that glides, its corners; isolated ones."""
    gliding = settings.boundary == "glide"
    return topology.is_boundary_vertex & (track.corners | (not gliding)) | (topology.valences == 0)


def _total(terms: Sequence[ElementTerm], vertices: Tensor) -> float:
    """What the terms contribute to the merit at vertices (V, 3)."""
    arguments = [(term, term.arguments({"vertices": vertices})) for term in terms]
    return sum(float(term.contributions(data, term.values(data)).sum()) for term, data in arguments)


def _smoothed(term: ElementTerm, smoothing: Tensor) -> ElementTerm:
    """The term with a smoothing () that it is a differentiable function of."""
    loss = copy.copy(term.loss)
    object.__setattr__(loss, "epsilon", smoothing)  # which checks itself as a number
    return replace(term, loss=loss)
