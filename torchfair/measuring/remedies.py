"""What bad stars need: a slide of the vertex, a flip of an edge, or another layout of the whole mesh."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from torch import Tensor

from .._names import FROM_ZERO, Names
from .._threads import threads_for
from ..errors import MeshError, TorchfairError
from ..topology import Topology
from ._star_patches import Patch, bad_stars, surroundings
from .diagnosis import Diagnosis

_TOGETHER = 50  # vertices whose trials are judged at once
_MANY = 0.2  # share of negatively curved stars that are bad from which on the layout is to blame
_LARGE = 50_000  # vertices from which on directions are fitted at some of them: misalignments are right to a degree
_ALIGNED = 0.2  # radians off principal directions up to which a family of edges is worth keeping


@dataclass(frozen=True)
class Remedy:
    """What makes fewer stars around a vertex bad.

    Attributes:
        words: what to do.
        bad_before: bad stars among the vertex and its neighbours: bad saddles, stars that are neither convex nor
            saddles, pyramids that intersect themselves.
        bad_after: those left, measured.
    """

    words: str
    bad_before: int
    bad_after: int

    def as_dict(self) -> dict[str, Any]:
        """For reports."""
        return {"words": self.words, "bad_before": self.bad_before, "bad_after": self.bad_after}


def star_remedy(vertices: Tensor, topology: Topology, vertex: int, *, names: Names = FROM_ZERO) -> Remedy | None:
    """The slide of an inner vertex, or the flip of an edge beside it, after which least stars around it are bad.

    Slides go along the tangent plane, by up to a third of an edge; edges are flipped between triangles. Everything is
    tried and measured on the star and the stars beside it. The shortest slide comes first, slides before flips.

    Args:
        vertices: (V, 3) float64.
        topology: any polygons.
        vertex: an inner vertex.
        names: what vertices are called in words, such as ``names`` of a mesh that was read.

    Returns:
        None where nothing of that leaves fewer bad stars.
    """
    return star_remedies(vertices, topology, [vertex], names=names)[0]


def star_remedies(
    vertices: Tensor, topology: Topology, chosen: Sequence[int], *, names: Names = FROM_ZERO
) -> list[Remedy | None]:
    """What :func:`star_remedy` says of each of some vertices, by itself, in a fraction of the time.

    Args:
        vertices: (V, 3) float64.
        topology: any polygons.
        chosen: inner vertices.
        names: what vertices are called in words, such as ``names`` of a mesh that was read.
    """
    remedies: list[Remedy | None] = []
    with threads_for(0, vertices.device):
        for start in range(0, len(chosen), _TOGETHER):
            remedies += _remedies(vertices, topology, chosen[start : start + _TOGETHER], names)
    return remedies


def _remedies(vertices: Tensor, topology: Topology, chosen: Sequence[int], names: Names) -> list[Remedy | None]:
    patches: dict[int, Patch] = {}
    for number, near in enumerate(surroundings(topology, chosen)):
        with suppress(MeshError):  # faces around it that touch in single vertices are no mesh
            patches[number] = Patch(vertices, near, chosen[number], names)
    trials = [patch.trials() for patch in patches.values()]
    found: list[Remedy | None] = [None] * len(chosen)
    for number, own, bad in zip(patches, trials, bad_stars(list(patches.values()), trials), strict=True):
        before, *after = bad
        least = min(after, default=before)
        if least < before:
            found[number] = Remedy(own[1 + after.index(least)].words, before, least)
    return found


def layout_advice(vertices: Tensor, topology: Topology, diagnosis: Diagnosis, *, names: Names = FROM_ZERO) -> list[str]:
    """What the mesh as a whole needs, in sentences; none if no star is bad.

    Args:
        vertices: (V, 3) float64.
        topology: any polygons.
        diagnosis: of this mesh.
        names: what vertices are called in words, such as ``names`` of a mesh that was read.
    """
    counts = diagnosis.counts()
    negative = counts["negative_angle_defects"]
    bad = counts["bad_saddle"] + counts["neither"]
    if not bad + counts["self_intersecting_pyramids"]:
        return []
    words = f"{bad} of {counts['inner_vertices']} stars are neither convex nor good saddles"
    wrong = counts["bad_saddle"] + counts["neither_with_negative_angle_defect"]
    if not negative or wrong <= _MANY * negative:
        return [f"{words}: few, so that single vertices are worth mending as listed, or all of them by torchfair fair"]
    if not topology.is_triangular:
        remesh = f"torchfair mesh --quads {topology.num_faces}"
        return [f"{words}, too many to mend one by one: lower E by torchfair fair, or remesh by {remesh}"]
    from ..principal import LARGE_MISALIGNMENT, principal_edges_from_directions

    try:
        directions, confidence = _sampled_directions(vertices, topology)
        aligned = principal_edges_from_directions(
            vertices, topology, directions, confidence=confidence, allow_exceptions=True
        )
    except TorchfairError:  # stars without a normal, in a whole component
        return [f"{words}, and there are no principal directions to go by: remesh, or mend degenerate faces first"]
    degrees = math.degrees(aligned.misalignment)
    off = f"the best family of parallel edges is {degrees:.0f} degrees off the nearer principal direction"
    remesh = f"torchfair mesh --triangles {topology.num_faces}"
    if aligned.misalignment > LARGE_MISALIGNMENT:
        return [f"{words}, and {off}: no choice of edges will do; remesh by {remesh}"]
    v, w = map(names.vertex, topology.edges[int(aligned.edges.mask.nonzero()[0])].tolist())
    advice = [f"{words}, and {off}: torchfair symmetric --seed {v} {w} makes saddles of negatively curved stars"]
    if aligned.misalignment > _ALIGNED:
        advice.append(f"edges that far off have to turn, which bends the shape: {remesh} lays them right")
    return advice


def _sampled_directions(vertices: Tensor, topology: Topology) -> tuple[Tensor, Tensor] | tuple[None, None]:
    """Directions of a large mesh and how far they are trusted; nothing for others, where all vertices have fits."""
    if topology.num_vertices < _LARGE:
        return None, None
    from ..geometry.sampled_curvature import sampled_curvature
    from ..principal import fitted_directions

    return fitted_directions(sampled_curvature(vertices.double(), topology), topology)
