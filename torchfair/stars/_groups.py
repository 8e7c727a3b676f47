"""Stars of inner vertices as tensors: their arms, and the corners of faces between them."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import torch
from torch import Tensor

from .._loading import safe_to_load
from ..geometry._ops import cross, dot
from ..topology import Topology

_STRAIGHT = math.pi - 1e-5  # a corner from here on is cut in two: its arms alone hardly tell its plane


@safe_to_load
class StarGroup(NamedTuple):
    """Inner vertices with equally many edges.

    Attributes:
        centres: (n,) vertex numbers.
        ring: (n, k) neighbours, counterclockwise.
        corners: (n, k) the corner, at the centre, of the face between neighbours ``i`` and ``i + 1``.
    """

    centres: Tensor
    ring: Tensor
    corners: Tensor


def star_groups(topology: Topology) -> list[StarGroup]:
    """All inner vertices, grouped by valence. Boundary vertices and isolated ones are in no group."""
    corners = topology.ring_corners_by_valence
    return [StarGroup(*group, corners[valence]) for valence, group in topology.rings_by_valence.items()]


def star_parts(topology: Topology, most: Callable[[int], int]) -> list[StarGroup]:
    """The groups in parts of at most so many stars, for each number of edges, and one at least."""
    parts = []
    for group in star_groups(topology):
        step = max(1, most(group.ring.shape[1]))
        for start in range(0, group.centres.shape[0], step):
            parts.append(StarGroup(*(tensor[start : start + step] for tensor in group)))
    return parts


class Arms(NamedTuple):
    """Stars to be judged, all with k arms, in float64.

    Attributes:
        centres: (n,) vertex numbers.
        arms: (n, k, 3) vectors from the centre, counterclockwise, less than half a turn apart.
        noise: (n,) angle by which rounding of the coordinates may turn the planes of the star.
    """

    centres: Tensor
    arms: Tensor
    noise: Tensor


class Planes(NamedTuple):
    """What is known of the faces of a mesh: unit normals (F, 3), and angles (C,) at their corners."""

    normals: Tensor
    angles: Tensor


def star_arms(vertices: Tensor, topology: Topology, planes: Planes, group: StarGroup) -> list[Arms]:
    """Arms of the stars of a group; ``vertices`` is one mesh ``(V, 3)``.

    A corner of a polygon that is straight or reflex is cut in two by a further arm along its bisector, so that
    every two neighbouring arms span their face; those stars come apart, with one arm more. Stars with several
    such corners cannot project 1-1 and are left out.
    """
    centres = vertices[group.centres]
    arms = (vertices[group.ring] - centres[:, None]).to(torch.float64)
    scale = centres.abs().amax(-1).to(torch.float64)
    eps = torch.finfo(vertices.dtype).eps
    if topology.is_triangular:
        return [Arms(group.centres, arms, rounding_angle(arms, scale, eps))]
    normals, angles, wide = _wide_corners(topology, planes, group)
    count = wide.sum(1)
    parts = []
    for chosen in (count == 0, count == 1):
        some = arms[chosen]
        if bool(chosen.any()):
            if bool(wide[chosen].any()):
                some = _with_bisector(some, normals[chosen], angles[chosen], wide[chosen])
            parts.append(Arms(group.centres[chosen], some, rounding_angle(some, scale[chosen], eps)))
    return parts


def corner_planes(
    vertices: Tensor, topology: Topology, planes: Planes, group: StarGroup, arms: Tensor
) -> tuple[Tensor, Tensor]:
    """Unit normals (n, k, 3) of the sectors between the ``arms`` of a group, and the noise (n,) of their directions.

    At straight and reflex corners of polygons the sector has the normal of its face.
    """
    scale = vertices[group.centres].abs().amax(-1).to(torch.float64)
    noise = rounding_angle(arms, scale, torch.finfo(vertices.dtype).eps)
    sectors = sector_normals(arms)
    if topology.is_triangular:
        return sectors, noise
    normals, _, wide = _wide_corners(topology, planes, group)
    return torch.where(wide[..., None], normals, sectors), noise


def _wide_corners(topology: Topology, planes: Planes, group: StarGroup) -> tuple[Tensor, Tensor, Tensor]:
    """Face normals (n, k, 3), corner angles (n, k), and mask (n, k) of the straight and reflex corners of polygons."""
    faces = topology.corner_faces[group.corners]
    normals = planes.normals[faces].to(torch.float64)
    angles = planes.angles[group.corners].to(torch.float64)
    return normals, angles, (angles > _STRAIGHT) & (topology.face_sizes[faces] > 3)


def _with_bisector(arms: Tensor, normals: Tensor, angles: Tensor, wide: Tensor) -> Tensor:
    """Turns each ring so that its wide corner comes last, and appends the bisector of that corner."""
    size = arms.shape[1]
    last = wide.to(torch.int64).argmax(1)
    order = (last[:, None] + 1 + torch.arange(size, device=arms.device)) % size
    arms = arms.gather(1, order[..., None].expand_as(arms))
    normal = normals[torch.arange(len(last), device=arms.device), last]
    half = (angles.gather(1, last[:, None]) / 2).expand(-1, 3)
    start = arms[:, -1]
    bisector = half.cos() * start + half.sin() * cross(normal, start)
    return torch.cat([arms, bisector[:, None]], dim=1)


def rounding_angle(arms: Tensor, scale: Tensor, eps: float) -> Tensor:
    """(n,) bound on the angle by which rounding turns a plane spanned by two neighbouring arms ``(n, k, 3)``.

    Positions of size ``scale`` (n,) are known to ``eps`` of their size; the thinner the triangle, the more that
    turns it. Infinite where an arm has no length or two neighbours are parallel.
    """
    lengths = torch.linalg.vector_norm(arms, dim=-1)
    doubled = torch.linalg.vector_norm(cross(arms, arms.roll(-1, 1)), dim=-1)
    thinness = ((lengths + lengths.roll(-1, 1)) / doubled).amax(-1)
    noise: Tensor = 16 * eps * (scale + lengths.amax(-1)) * thinness
    return torch.nan_to_num(noise, nan=torch.inf)


def sector_normals(arms: Tensor) -> Tensor:
    """Unit normals (..., k, 3) of the planes through neighbouring arms ``i`` and ``i + 1``; NaN for parallel ones."""
    normals = cross(arms, arms.roll(-1, -2))
    unit: Tensor = normals / torch.linalg.vector_norm(normals, dim=-1, keepdim=True)
    return unit


def turns_once(arms: Tensor, normals: Tensor) -> Tensor:
    """(n,) whether stars ``(n, k, 3)``, seen along unit ``normals`` (n, 3), run around their centre exactly once.

    Every sector has to be seen from its front: then each turns by less than half a turn, always forward.
    """
    axis = normals[:, None]
    flat = arms - dot(arms, axis)[..., None] * axis
    ahead = flat.roll(-1, 1)
    turns = torch.atan2(dot(cross(flat, ahead), axis), dot(flat, ahead)).sum(-1)
    once: Tensor = (turns > 3.1) & (turns < 9.4)  # a whole number of full turns, up to rounding
    return once
