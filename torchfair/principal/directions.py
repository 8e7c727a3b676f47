"""Principal edges from principal directions of the surface."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from .._names import PlacedError
from .._side_by_side import side_by_side
from ..errors import ShapeError, TorchfairError
from ..geometry import FittedCurvature, fitted_curvature, star_normals
from ..geometry._ops import cross, gather
from ..topology import Topology
from ._families import Differences, Ints, differences, face_components, mark, seams, spread
from .labels import require_no_seams
from .principal_edges import PrincipalEdges

Floats = npt.NDArray[np.float64]

LARGE_MISALIGNMENT = 0.4
"""Radians from which on edges cannot be said to follow directions: crosses at random are pi/8 = 0.39 off."""

_EDGES = 1 << 14  # at once: what is made of them stays near the cache
_LEAST = 1e-6  # confidence of computed directions: also on spheres and planes there is a choice


class AlignedEdges(NamedTuple):
    """Principal edges, and how well they follow the directions that they were chosen by.

    Attributes:
        edges: the choice.
        misalignment: see :func:`misalignment_of`.
        chosen: (F,) which of the directions, 0 or 1, the principal edge of each face is nearer to. With computed
            directions 0 is that of the larger principal curvature, with its sign.
    """

    edges: PrincipalEdges
    misalignment: float
    chosen: Tensor


def principal_edges_from_directions(
    vertices: Tensor,
    topology: Topology,
    directions: Tensor | None = None,
    *,
    confidence: Tensor | None = None,
    allow_exceptions: bool = False,
) -> AlignedEdges:
    """The family of edges that best follows principal directions.

    In each component there are three families of parallel edges, as :func:`principal_edges_from_seed` finds them; taken
    is the one with the smallest mean angle to the cross of both directions, that is, to the nearer one. Which of both
    has the larger curvature is not asked: between a hill and a valley they change places.

    Args:
        vertices: (V, 3) positions, any length unit.
        topology: a triangle mesh.
        directions: (V, 3) or, a cross, (V, 2, 3), of any length and sign; zero where there is no direction. If left
            out, those of :func:`torchfair.geometry.fitted_curvature` at interior vertices.
        confidence: (V,) how much the directions count, 0 or more. By default all count alike if they are given, and
            computed ones by :attr:`torchfair.geometry.FittedCurvature.confidence`: in full where they are certain, next
            to nothing at umbilics, in flat places and where noise hides them.
        allow_exceptions: whether the choice may break where no family is consistent; the seams then run where
            triangles follow the directions badly or beside each other prefer different families.

    Raises:
        ShapeError: if vertices, directions or confidence have another shape.
        MeshError: if a face is not a triangle; and, unless exceptions are allowed, if no choice is possible, as
            for :func:`principal_edges_from_seed`.
        TorchfairError: if a number is not finite, a confidence is negative, or a component has no directions at all.
    """
    rule = differences(topology)
    crosses = _crosses(vertices, topology, directions, confidence)
    angles, nearer = _side_angles(vertices, topology, crosses, rule)
    trust = _face_means(crosses, topology)
    components, count = face_components(rule)
    roots = np.unique(components, return_index=True)[1]
    starts = np.zeros(count, np.int64)
    sides = spread(rule, roots, starts)
    broken = seams(rule, sides)
    if broken.size:
        if not allow_exceptions:
            require_no_seams(topology, broken)
        sides = spread(rule, roots, starts, _crossing_costs(rule, angles))
    options = (sides + np.arange(3)[:, None]) % 3  # (3, F)
    taken = np.take_along_axis(angles[None], options[..., None], 2)[..., 0]
    means = np.stack([_means(option, trust, components, count) for option in taken])
    _require_directions(topology, means, roots)
    best = means.argmin(0)[components]
    faces = np.arange(len(components))
    final = options[best, faces]
    edges = PrincipalEdges(topology, torch.from_numpy(mark(rule, final)).to(topology.device))
    chosen = torch.from_numpy(nearer[faces, final]).to(topology.device)
    return AlignedEdges(edges, _mean(taken[best, faces], trust), chosen)


def misalignment_of(
    vertices: Tensor,
    edges: PrincipalEdges,
    directions: Tensor | None = None,
    *,
    confidence: Tensor | None = None,
) -> float:
    """Mean angle in radians between principal edges and the nearer of both principal directions, 0 to pi/4.

    Seen along the vertex normals, between a principal edge and the mean of the directions at its ends; 0 to pi/2 if a
    single direction is given. Near 0 on meshes that follow the directions. Where equilateral triangles lie at a
    constant angle to both directions, the best choice has 0.26 (15 degrees) or less; where directions turn against the
    lattice or are noise, it tends to pi/8 = 0.39, and above ``LARGE_MISALIGNMENT``, 0.4 radians, there is little that a
    choice of edges can do.

    Args:
        vertices: (V, 3) positions, any length unit.
        edges: the choice, with the topology.
        directions: see :func:`principal_edges_from_directions`.
        confidence: likewise.

    Returns:
        The mean over all faces with a principal edge, weighted by their confidence; 0 if no direction counts.

    Raises:
        ShapeError, TorchfairError: as :func:`principal_edges_from_directions`.
    """
    rule = differences(edges.topology)
    crosses = _crosses(vertices, edges.topology, directions, confidence)
    angles, _ = _side_angles(vertices, edges.topology, crosses, rule)
    principal = edges.mask.cpu().numpy()[rule.side_edges]
    trust = np.broadcast_to(_face_means(crosses, edges.topology)[:, None], angles.shape)
    return _mean(angles[principal], trust[principal])


def fitted_directions(fit: FittedCurvature, topology: Topology) -> tuple[Tensor, Tensor]:
    """Computed directions (V, 2, 3) that count, none at the boundary, where they are less certain, and confidence (V,).

    Args:
        fit: at the vertices, or between some of them.
        topology: connectivity.
    """
    directions = fit.directions.clone()
    directions[topology.is_boundary_vertex] = 0
    return directions, fit.confidence.clamp_min(_LEAST)


class _Crosses(NamedTuple):
    """Directions and how much they count.

    Attributes:
        directions: (V, fields, 3) float64, zero where there is none.
        confidence: (V,) float64, zero where there is no direction.
    """

    directions: Tensor
    confidence: Tensor


def _crosses(vertices: Tensor, topology: Topology, directions: Tensor | None, confidence: Tensor | None) -> _Crosses:
    topology.check_vertices(vertices)
    count = topology.num_vertices
    if vertices.ndim != 2:
        raise ShapeError("vertices", f"one mesh ({count}, 3)", tuple(vertices.shape))
    if directions is not None and directions.shape not in ((count, 3), (count, 2, 3)):
        raise ShapeError("directions", f"({count}, 3) or ({count}, 2, 3)", tuple(directions.shape))
    if confidence is not None and confidence.shape != (count,):
        raise ShapeError("confidence", f"({count},)", tuple(confidence.shape))
    for name, values in (("vertices", vertices), ("directions", directions), ("confidence", confidence)):
        if values is not None and not values.isfinite().all():
            raise TorchfairError(f"{name}: some are not finite numbers. Use zeros where there is no direction.")
    if confidence is not None and (confidence < 0).any():
        raise TorchfairError("confidence: some are negative. Use zeros where there is no direction.")
    vertices = vertices.detach().to(torch.float64)
    if directions is None:
        directions, certain = fitted_directions(fitted_curvature(vertices, topology), topology)
        confidence = certain if confidence is None else confidence
    directions = directions.detach().to(torch.float64).reshape(count, -1, 3)
    exists = (directions != 0).any(2).any(1).to(torch.float64)
    return _Crosses(directions, exists if confidence is None else exists * confidence.detach().to(torch.float64))


def _side_angles(vertices: Tensor, topology: Topology, crosses: _Crosses, rule: Differences) -> tuple[Floats, Ints]:
    """(F, 3) angle of each side with the nearer mean of directions at its ends, NaN where there is none; and which."""
    vertices = vertices.detach().to(torch.float64)
    directions, normals = crosses.directions, star_normals(vertices, topology)
    # The angle at an end is told by the products of the edge with a direction and with that turned in the surface.
    both = torch.cat([directions, cross(normals[:, None].expand_as(directions), directions)], 1)
    parts = side_by_side(
        lambda ends: _edge_angles(vertices, both, crosses.confidence, ends),
        torch.split(topology.edges, _EDGES),
        vertices,
    )
    nearest, which = (torch.cat(found) for found in zip(*parts, strict=True))
    values: Floats = torch.where(nearest.isinf(), torch.nan, nearest).cpu().numpy()
    fields: Ints = which.cpu().numpy()
    return values[rule.side_edges], fields[rule.side_edges]


def _edge_angles(vertices: Tensor, both: Tensor, confidence: Tensor, ends: Tensor) -> tuple[Tensor, Tensor]:
    """(n,) angle of edges with the nearer mean of directions at their ends, infinite where there is none; and which.

    Args:
        vertices: (V, 3).
        both: (V, 2 * fields, 3) directions, and the same turned by a right angle about the vertex normals.
        confidence: (V,).
        ends: (n, 2) vertices.
    """
    along = gather(vertices, ends[:, 1]) - gather(vertices, ends[:, 0])
    fields = both.shape[1] // 2
    at_ends = gather(both.flatten(1), ends).view(*ends.shape, 2 * fields, 3)
    flat = (at_ends @ along[:, None, :, None]).squeeze(-1)
    flat = torch.complex(flat[..., :fields], flat[..., fields:])  # (n, 2, fields)
    # Directions have no sign, so angles are doubled before they are averaged. On a curve that bends in the surface
    # the angles at both ends have opposite signs.
    turned = flat / flat.abs()
    doubled = torch.nan_to_num(turned * turned) * confidence[ends][..., None]
    first, second = doubled.permute(1, 2, 0)  # (fields, n)
    # Between the ends d1 and d2 may change places: each direction goes with the one that is nearest to it.
    likeness = (first[:, None] * second[None].conj()).real + 1e-12 * torch.eye(fields).to(first.real)[..., None]
    mean = first + second.gather(0, likeness.argmax(1))
    angle = torch.where(mean.abs() > 1e-9, mean.angle().abs() / 2, torch.inf)
    nearest, which = angle.min(0)
    return nearest, which


def _face_means(crosses: _Crosses, topology: Topology) -> Floats:
    """(F,) mean confidence at the corners."""
    means: Floats = crosses.confidence[topology.triangles].mean(1).cpu().numpy()
    return means


def _crossing_costs(rule: Differences, angles: Floats) -> Floats:
    """(I,) high where two faces prefer sides that are not parallel or do not follow the directions (F, 3)."""
    filled = np.where(np.isnan(angles), np.pi / 4, angles)
    preferred, quality = filled.argmin(1), filled.min(1)
    left, right = rule.faces.T
    disagree = (preferred[left] + rule.shifts - preferred[right]) % 3 != 0
    costs: Floats = 0.01 + quality[left] + quality[right] + np.pi * disagree
    return costs


def _means(values: Floats, weights: Floats, components: Ints, count: int) -> Floats:
    """(count,) weighted mean over each component of the values that are not NaN, infinite where there are none."""
    weights = np.where(np.isnan(values), 0.0, weights)
    sums = np.bincount(components, np.nan_to_num(values) * weights, count)
    totals = np.bincount(components, weights, count)
    means: Floats = np.divide(sums, totals, out=np.full(count, np.inf), where=totals > 0)
    return means


def _mean(values: Floats, weights: Floats) -> float:
    """Weighted mean of the values that are not NaN; 0 where there are none, or none that count."""
    weights = np.where(np.isnan(values), 0.0, weights)
    total = weights.sum()
    return float(np.nan_to_num(values) @ weights / total) if total > 2 * _LEAST * len(weights) else 0.0


def _require_directions(topology: Topology, means: Floats, roots: Ints) -> None:
    empty = np.flatnonzero(np.isinf(means).all(0))
    if empty.size:
        face = int(roots[empty[0]])
        raise PlacedError(
            "directions: none in the component of face ",
            ("face", face),
            " (vertex ",
            ("vertex", int(topology.corners[3 * face])),
            "). Give a direction at one or more of its vertices.",
        )
