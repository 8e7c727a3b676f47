"""Which vertex stars of a mesh are bad, and what that does to its Gauss image."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import torch
from torch import Tensor

from .._one_mesh import one_mesh
from .._threads import threads_for
from ..errors import MeshError, ShapeError, TorchfairError
from ..stars import (
    GaussOverlaps,
    StarClasses,
    StarKind,
    classify_stars,
    gauss_overlaps,
    pyramid_perimeters,
    pyramid_self_intersections,
    pyramid_windings,
)
from ..topology import Topology

MOST_ARCS = 200_000
"""Interior edges up to which crossings in the whole Gauss image are counted."""


@dataclass(frozen=True)
class Diagnosis:
    """Stars and normal pyramids of one mesh.

    Attributes:
        topology: connectivity.
        classes: what each star is.
        crossings: (V,) self-intersections of each normal pyramid.
        perimeters: (V,) of the pyramids, in radians.
        windings: (V,) of the pyramids around the vertex normals.
        overlaps: crossings in the whole Gauss image; None where the mesh is too large or too crumpled.
    """

    topology: Topology
    classes: StarClasses
    crossings: Tensor
    perimeters: Tensor
    windings: Tensor
    overlaps: GaussOverlaps | None

    @property
    def inner(self) -> Tensor:
        """(V,) bool, the vertices that have a star to judge."""
        return ~self.classes.is_kind(StarKind.EXCLUDED)

    def class_names(self) -> list[str]:
        """Class of every vertex: convex, saddle, neither, boundary or isolated."""
        names = ["convex", "saddle", "neither", "boundary", "isolated"]
        isolated = (self.topology.valences == 0).to(torch.int64)
        return [names[code] for code in (self.classes.kinds.to(torch.int64) + isolated).tolist()]

    def counts(self) -> dict[str, Any]:
        """How many stars of each kind, how many folded pyramids and crossings; angles in degrees.

        Keys are those of ``torchfair diagnose --json``; a value is None where there is nothing to measure.
        """
        return dict(self._counts)

    @cached_property
    def _counts(self) -> dict[str, Any]:
        classes, topology, inner = self.classes, self.topology, self.inner
        convex, saddle, neither = map(classes.is_kind, (StarKind.CONVEX, StarKind.SADDLE, StarKind.NEITHER))
        folded = self.crossings > 0
        perimeters = self.perimeters[inner].rad2deg()
        overlaps = self.overlaps
        windings, frequencies = torch.unique(self.windings[inner], return_counts=True)
        return {
            "vertices": topology.num_vertices,
            "faces": topology.num_faces,
            "inner_vertices": _count(inner),
            "boundary_vertices": _count(topology.is_boundary_vertex),
            "isolated_vertices": _count(topology.valences == 0),
            "convex": _count(convex),
            "flat": _count(classes.flat),
            "saddle": _count(saddle),
            "good_saddle": _count(classes.good),
            "bad_saddle": _count(classes.bad_saddles),
            "neither": _count(neither),
            "degenerate_stars": _count(classes.degenerate),
            "self_intersecting_pyramids": _count(folded),
            "self_intersecting_pyramids_by_class": {
                "convex": _count(folded & convex),
                "good_saddle": _count(folded & classes.good),
                "bad_saddle": _count(folded & classes.bad_saddles),
                "neither": _count(folded & neither),
            },
            "pyramid_self_intersections": int(self.crossings.sum()),
            "mean_pyramid_perimeter_degrees": float(perimeters.mean()) if perimeters.numel() else None,
            "largest_pyramid_perimeter_degrees": float(perimeters.max()) if perimeters.numel() else None,
            "positive_angle_defects": _count(classes.defect_signs > 0),
            "negative_angle_defects": _count(classes.defect_signs < 0),
            "neither_with_negative_angle_defect": _count(neither & (classes.defect_signs < 0)),
            "saddle_patterns": _named(classes.pattern_counts(kind=StarKind.SADDLE)),
            "ordinary_patterns": _named(classes.pattern_counts(ordinary=True)),
            "pyramid_windings": {str(w): n for w, n in zip(windings.tolist(), frequencies.tolist(), strict=True)},
            "gauss_image_crossings": None if overlaps is None else overlaps.crossings,
            "gauss_image_crossings_between_stars": None if overlaps is None else overlaps.between_stars,
        }

    def worst_vertices(self, count: int) -> list[dict[str, Any]]:
        """The ``count`` worst vertices that are no convex or good saddle stars, or have a self-intersecting pyramid.

        Those with most self-intersections come first, then those that are neither convex nor saddles, then those with
        the longest perimeters, then smaller numbers.

        Raises:
            ShapeError: if ``count`` is negative.
        """
        if count < 0:
            raise ShapeError("count", "0 or more", count)
        classes, crossings = self.classes, self.crossings
        neither = classes.is_kind(StarKind.NEITHER)
        suspect = torch.nonzero((crossings > 0) | classes.bad).squeeze(1)
        # Sorted by the least important key first; a perimeter rounded to 1e-9 keeps ties in the order of the numbers.
        for key in ((self.perimeters * 1e9).round(), neither.to(torch.int64), crossings):
            suspect = suspect[key[suspect].argsort(descending=True, stable=True)]
        return [self.describe_vertex(vertex) for vertex in suspect[:count].tolist()]

    def describe_vertex(self, vertex: int) -> dict[str, Any]:
        """One inner vertex in words and numbers.

        Raises:
            TorchfairError: if there is no such vertex, or it is not inside.
        """
        if not (0 <= vertex < self.topology.num_vertices and bool(self.inner[vertex])):
            raise TorchfairError(f"vertex {vertex} is not inside the mesh: it has no star to describe")
        classes = self.classes
        good = bool(classes.good[vertex])
        name = StarKind(int(classes.kinds[vertex])).name.lower()
        return {
            "vertex": vertex,
            "valence": int(self.topology.valences[vertex]),
            "class": f"{'good' if good else 'bad'} saddle" if name == "saddle" else name,
            "pattern": list(classes.pattern(vertex)),
            "ordinary_pattern": list(classes.pattern(vertex, ordinary=True)),
            "inflection_faces": int(classes.inflection_counts[vertex]),
            "self_intersections": int(self.crossings[vertex]),
            "perimeter_degrees": math.degrees(float(self.perimeters[vertex])),
            "angle_defect_sign": int(classes.defect_signs[vertex]),
        }

    def per_vertex(self) -> dict[str, list[Any]]:
        """Lists with one entry for each vertex."""
        return {
            "class": self.class_names(),
            "good_saddle": self.classes.good.tolist(),
            "self_intersections": self.crossings.tolist(),
            "perimeter_degrees": self.perimeters.rad2deg().tolist(),
            "winding": self.windings.tolist(),
            "angle_defect_sign": self.classes.defect_signs.tolist(),
        }


def diagnose_mesh(vertices: Tensor, topology: Topology) -> Diagnosis:
    """Judges all stars of one mesh.

    Example::

        diagnosis = diagnose_mesh(vertices, topology)
        diagnosis.counts()["bad_saddle"], diagnosis.worst_vertices(3)

    Args:
        vertices: positions ``(V, 3)``, any length unit.
        topology: connectivity; any polygons, mixed.

    Raises:
        ShapeError: if ``vertices`` are not one mesh that fits the topology.
    """
    vertices = one_mesh(vertices, topology)
    with threads_for(vertices.numel(), vertices.device):
        return Diagnosis(
            topology=topology,
            classes=classify_stars(vertices, topology),
            crossings=pyramid_self_intersections(vertices, topology),
            perimeters=pyramid_perimeters(vertices, topology),
            windings=pyramid_windings(vertices, topology),
            overlaps=_overlaps(vertices, topology),
        )


def _overlaps(vertices: Tensor, topology: Topology) -> GaussOverlaps | None:
    """Crossings in the whole Gauss image; None for very large meshes and where too many arcs are near each other."""
    if topology.num_interior_edges > MOST_ARCS:
        return None
    try:
        return gauss_overlaps(vertices, topology)
    except MeshError:
        return None


def _count(mask: Tensor) -> int:
    return int(mask.sum())


def _named(patterns: dict[tuple[int, ...], int]) -> dict[str, int]:
    return {",".join(map(str, lengths)) or "-": count for lengths, count in patterns.items()}
