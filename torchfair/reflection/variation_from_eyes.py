"""Reflection variation seen from a point, in closed form."""

from __future__ import annotations

import itertools
import math

import torch
from torch import Tensor

from .._precision import in_single_at_least
from ..geometry._ops import cross, dot, face_groups, gather, norm
from ..geometry.lengths import edge_vectors
from ..geometry.normals import adjacent_normals
from ..topology import Topology
from .variation import see, view_vectors


@in_single_at_least
def reflection_variation_from_eyes_per_edge(
    vertices: Tensor, topology: Topology, eyes: Tensor, *, visibility: Tensor | None = None
) -> Tensor:
    """What every interior edge adds to the reflection variation seen from each eye: (*batch, n, I).

    Arguments, degenerate cases and errors as for :func:`reflection_variation_from_eyes`.
    """
    edges = edge_vectors(vertices, topology)[..., : topology.num_interior_edges, :]
    views = view_vectors("eyes", eyes, vertices)[..., :, None, :]
    v, w = topology.interior_edges.unbind(1)
    start, end = (vertices.index_select(-2, ends)[..., None, :, :] - views for ends in (v, w))
    near, far, lengths = norm(start), norm(end), norm(edges)[..., None, :]
    area = cross(edges[..., None, :, :].expand_as(start), start)
    # e.(d1 - d0) without a difference of nearly equal numbers. Zero denominators: the eye is on the edge.
    denominator = near * far * lengths * (near * far + dot(start, end))
    valid = denominator > 0
    seen_length = (near + far) * dot(area, area) / torch.where(valid, denominator, 1.0)
    left, right, _ = adjacent_normals(vertices, topology)
    jumps = 2 * norm(cross(left, right))[..., None, :]
    return see(jumps * torch.where(valid, seen_length, 0.0), visibility, topology)


def reflection_variation_from_eyes(
    vertices: Tensor, topology: Topology, eyes: Tensor, *, visibility: Tensor | None = None
) -> Tensor:
    r"""Total variation of the mirrored direction over what an eye sees, less its smooth part.

    The picture is taken on the sphere of viewing directions. From a point the mirrored direction also varies
    inside a face, as it does in one plane mirror. That part is ``sqrt(2)`` times the solid angle of the mesh whatever
    its shape: see :func:`solid_angles`. What the edges add is returned here, with unit vectors ``d0, d1`` from the
    eye to the ends of an edge and its own direction
    ``e``::

        sum_e 2 |sin a| e.(d1 - d0)

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity; any polygons, mixed. Exact for planar faces; where polygons are not planar
            ``|sin a|`` is ``|n x n'|`` and the jump is taken as if ``n x n'`` were parallel to the edge.
        eyes: (n, 3) or (*batch, n, 3) positions.
        visibility: factors that broadcast to (*batch, n, I), the visible share of every interior edge; 1 if left
            out, which counts hidden edges too.

    Returns:
        (*batch, n) >= 0, one value per eye (and one for each of joined meshes behind), dimensionless: unchanged
        by scaling mesh and eyes together. Times the
        distance of the eye it tends to :func:`reflection_variation` as the eye goes away. Terms and derivatives
        are zero at flat edges (a kink), at edges that point at the eye or touch it, and where there is no
        dihedral angle.

    Raises:
        ShapeError: if a tensor has the wrong shape or is not floating.
    """
    terms = reflection_variation_from_eyes_per_edge(vertices, topology, eyes, visibility=visibility)
    return topology.sum_per_mesh(terms, "interior_edges")


@in_single_at_least
def solid_angles(vertices: Tensor, topology: Topology, eyes: Tensor) -> Tensor:
    """Signed solid angle of every face seen from each eye: (*batch, n, F).

    ``sqrt(2)`` times the sum of the absolute values over the visible faces is the part of the reflection
    variation that is the same in every mirror of this outline (:func:`reflection_variation_from_eyes`).

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity; any polygons, mixed. Polygons count as fans of triangles from their first corner.
        eyes: (n, 3) or (*batch, n, 3) positions.

    Returns:
        Steradians, in (-2 pi, 2 pi) for triangles; positive where the face turns its back to the eye, so
        that a closed surface with outward normals adds up to 4 pi around the eye and to 0 outside. Zero with
        derivative zero for faces that are seen edge-on or touch the eye with a corner.

    Raises:
        ShapeError: if a tensor has the wrong shape or is not floating.
    """
    topology.check_vertices(vertices)
    spokes = vertices[..., None, :, :] - view_vectors("eyes", eyes, vertices)[..., :, None, :]
    numbers, angles = [], []
    for faces, corners in face_groups(topology):
        a, *others = gather(spokes, corners).unbind(-2)
        fan = [_triangle_angle(a, b, c) for b, c in itertools.pairwise(others)]
        numbers.append(faces)
        angles.append(torch.stack(fan).sum(0))
    order = torch.cat(numbers).argsort()
    return torch.cat(angles, dim=-1).index_select(-1, order)


def _triangle_angle(a: Tensor, b: Tensor, c: Tensor) -> Tensor:
    """Signed solid angle (van Oosterom and Strackee 1983) of triangles with corners (..., 3) seen from the origin."""
    x, y, z = norm(a), norm(b), norm(c)
    volume = dot(a, cross(b, c))
    spread = x * y * z + dot(a, b) * z + dot(b, c) * x + dot(c, a) * y
    flat = volume == 0
    # (0, 1) has angle 0 and keeps atan2 away from (0, 0); edge-on faces around the eye have no angle either.
    return 2 * torch.atan2(torch.where(flat, 0.0, volume), torch.where(flat, 1.0, spread))


MIRROR_PART = math.sqrt(2)
"""Variation of the mirrored direction of one plane mirror per solid angle."""
