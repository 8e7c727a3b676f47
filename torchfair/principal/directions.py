"""Principal edges from principal directions of the surface."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from ..errors import ShapeError, TorchfairError
from ..geometry import principal_directions, star_normals
from ..geometry._ops import cross, dot
from ..topology import Topology
from ._families import Differences, Ints, differences, face_components, mark, seams, spread
from .labels import require_no_seams
from .principal_edges import PrincipalEdges

Floats = npt.NDArray[np.float64]


class AlignedEdges(NamedTuple):
    """Principal edges, and how well they follow the directions that they were chosen by.

    Attributes:
        edges: the choice.
        misalignment: mean angle in radians, 0 to pi/2, between a principal edge and the mean of the directions at its
            ends, seen along the vertex normals. Near 0 on meshes that follow the directions. Where equilateral
            triangles lie at a constant angle to two orthogonal directions, the best choice has 0.26 (15 degrees) or
            less; where directions turn against the lattice or are noise, it tends to pi/4 = 0.79.
        chosen: (F,) which of the directions, 0 or 1, the principal edge of each face follows; the same in each
            component. With computed directions 0 is that of the larger principal curvature, with its sign.
    """

    edges: PrincipalEdges
    misalignment: float
    chosen: Tensor


def principal_edges_from_directions(
    vertices: Tensor, topology: Topology, directions: Tensor | None = None, *, allow_exceptions: bool = False
) -> AlignedEdges:
    """The family of edges that best follows principal directions.

    In each component there are three families of parallel edges, as :func:`principal_edges_from_seed` finds them,
    and one or two fields of directions; taken is the family with the smallest mean angle to a field.

    Args:
        vertices: (V, 3) positions, any length unit.
        topology: a triangle mesh.
        directions: (V, 3) or, two to choose from, (V, 2, 3), of any length and sign; zero where there is no
            direction. If left out, :func:`torchfair.geometry.principal_directions` at interior vertices.
        allow_exceptions: whether the choice may break where no family is consistent; the seams then run where
            triangles follow the directions badly or beside each other prefer different families.

    Raises:
        ShapeError: if vertices or directions have another shape.
        MeshError: if a face is not a triangle; and, unless exceptions are allowed, if no choice is possible, as
            for :func:`principal_edges_from_seed`.
        TorchfairError: if a number is not finite, or a component has no directions at all.
    """
    rule = differences(topology)
    fields = _fields(vertices, topology, directions)
    angles = _side_angles(vertices, topology, fields, rule)
    components, count = face_components(rule)
    roots = np.unique(components, return_index=True)[1]
    starts = np.zeros(count, np.int64)
    sides = np.stack([spread(rule, roots, starts)] * len(angles))
    broken = seams(rule, sides[0])
    if broken.size:
        if not allow_exceptions:
            require_no_seams(topology, broken)
        sides = np.stack([spread(rule, roots, starts, _crossing_costs(rule, of_field)) for of_field in angles])
    options = (sides[:, None] + np.arange(3)[:, None]) % 3  # (fields, 3, F)
    taken = np.take_along_axis(angles[:, None], options[..., None], 3)[..., 0]
    options = options.reshape(3 * len(angles), len(components))
    taken = taken.reshape(options.shape)
    means = np.stack([_means(option, components, count) for option in taken])
    _require_directions(topology, means, roots)
    best = means.argmin(0)[components]
    faces = np.arange(len(components))
    final, used = options[best, faces], taken[best, faces]
    edges = PrincipalEdges(topology, torch.from_numpy(mark(rule, final)).to(topology.device))
    misalignment = float(np.nanmean(used)) if used.size else 0.0
    return AlignedEdges(edges, misalignment, torch.from_numpy(best // 3).to(topology.device))


def _fields(vertices: Tensor, topology: Topology, directions: Tensor | None) -> Tensor:
    """(fields, V, 3)."""
    topology.check_vertices(vertices)
    if vertices.ndim != 2:
        raise ShapeError("vertices", f"one mesh ({topology.num_vertices}, 3)", tuple(vertices.shape))
    if directions is None:
        directions = principal_directions(vertices, topology).clone()
        directions[topology.is_boundary_vertex] = 0  # directions there are less certain
    elif directions.shape not in ((topology.num_vertices, 3), (topology.num_vertices, 2, 3)):
        expected = f"({topology.num_vertices}, 3) or ({topology.num_vertices}, 2, 3)"
        raise ShapeError("directions", expected, tuple(directions.shape))
    for name, values in (("vertices", vertices), ("directions", directions)):
        if not values.isfinite().all():
            raise TorchfairError(f"{name}: some are not finite numbers. Use zero vectors where there is no direction.")
    return directions.reshape(topology.num_vertices, -1, 3).transpose(0, 1)


def _side_angles(vertices: Tensor, topology: Topology, fields: Tensor, rule: Differences) -> Floats:
    """(fields, F, 3) angle of each side with the mean of the directions at its ends, NaN where there is none."""
    vertices, fields = vertices.detach().to(torch.float64), fields.detach().to(torch.float64)
    ends = topology.edges
    along = (vertices[ends[:, 1]] - vertices[ends[:, 0]])[:, None]
    normals = star_normals(vertices, topology)[ends]
    at_ends = fields[:, ends]  # (fields, E, 2, 3)
    # Directions have no sign, so angles are doubled before they are averaged. On a curve that bends in the surface
    # the angles at both ends have opposite signs.
    flat = torch.complex(dot(at_ends, along), dot(cross(at_ends, along.expand_as(at_ends)), normals))
    mean = torch.nan_to_num((flat / flat.abs()) ** 2).sum(-1)
    angle = torch.where(mean.abs() > 1e-9, mean.angle().abs() / 2, torch.nan)
    values: Floats = angle.cpu().numpy()
    return values[:, rule.side_edges]


def _crossing_costs(rule: Differences, angles: Floats) -> Floats:
    """(I,) high where two faces prefer sides that are not parallel or do not follow the directions (F, 3)."""
    filled = np.where(np.isnan(angles), np.pi / 2, angles)
    preferred, quality = filled.argmin(1), filled.min(1)
    left, right = rule.faces.T
    disagree = (preferred[left] + rule.shifts - preferred[right]) % 3 != 0
    costs: Floats = 0.01 + quality[left] + quality[right] + np.pi * disagree
    return costs


def _means(values: Floats, components: Ints, count: int) -> Floats:
    """(count,) mean over each component of the values that are not NaN, infinite where there are none."""
    known = ~np.isnan(values)
    sums = np.bincount(components[known], values[known], count)
    numbers = np.bincount(components[known], minlength=count)
    return np.where(numbers > 0, sums / np.maximum(numbers, 1), np.inf)


def _require_directions(topology: Topology, means: Floats, roots: Ints) -> None:
    empty = np.flatnonzero(np.isinf(means).all(0))
    if empty.size:
        face = roots[empty[0]]
        raise TorchfairError(
            f"directions: none in the component of face {face} (vertex {topology.corners[3 * face].item()}). "
            "Give a direction at one or more of its vertices."
        )
