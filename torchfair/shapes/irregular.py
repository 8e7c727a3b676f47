"""Irregular triangle meshes with well-shaped triangles, and the icosphere."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import torch

from torchfair.errors import MeshError

from ._delaunay import flip_to_delaunay, triangulate
from .rotated_lattice import metric_scale
from .shape_mesh import Points, ShapeMesh, build_mesh, check_count
from .sphere import Sphere
from .surface import Surface

Ints = npt.NDArray[np.int64]

_CANDIDATES = 40  # random points to choose from, per vertex
_PROFILE = 400  # samples along a side for its arc length


def irregular_triangles(surface: Surface, count: int, seed: int = 0) -> ShapeMesh:
    """Delaunay triangles over ``count`` vertices spread evenly but without any pattern.

    Boundary vertices are equally spaced along the sides of the patch. Inner ones are chosen one after the other
    from random points of uniform density on the surface, each time the one farthest from all vertices so far, so
    no two are close and no gap stays open; hence no slivers (angles stay above 20 degrees in practice). The
    triangulation is that of the parameter rectangle, closed up in periodic directions without a seam, with edges
    flipped until it is Delaunay on the surface. Closed spheres and caps use the convex hull.

    The same ``count`` and ``seed`` give the same mesh.

    Raises:
        MeshError: if ``count`` is too small for the boundary or to close up around the surface, and for
            sectors of a sphere that reach a pole.
    """
    check_count("count", count, 12, "a mesh of the surface needs some vertices")
    check_count("seed", seed, 0, "it starts a random generator")
    if any(surface.poles) and not surface.periodic[0]:
        raise MeshError("a sector of a sphere that reaches a pole has no irregular mesh. Use full angles or a zone.")
    spacing = _spacing(surface.area(), _boundary_length(surface), count)
    outer = _boundary_parameters(surface, spacing)
    if len(outer) >= count:
        raise MeshError(f"count = {count} is too small: the boundary alone takes {len(outer)} vertices. Ask for more.")
    inner = _spread(surface, outer, count - len(outer), np.random.default_rng(seed))
    parameters = np.concatenate([outer, inner])
    vertices = _positions(surface, parameters)
    if any(surface.poles):
        return build_mesh(surface, parameters, _hull(surface, vertices, parameters))
    scale, _ = metric_scale(surface)
    low, high = np.array(surface.domain).T
    size = (high - low) * scale
    fixed = np.arange(count) < len(outer)
    flat = triangulate((parameters - low) * scale, fixed, (size[0], size[1]), surface.periodic)
    faces = flip_to_delaunay(vertices, flat.faces)
    a, b, c = vertices[faces].transpose(1, 0, 2)
    normals = surface.normal(*torch.from_numpy(np.ascontiguousarray(parameters.T))).numpy()
    facing = np.cross(b - a, c - a)[:, None] * normals[faces]
    if (facing.sum(-1) <= 0).any():
        raise MeshError(f"count = {count} is too small: faces would lie across the surface. Ask for more.")
    return build_mesh(surface, parameters, faces)


def icosphere(subdivisions: int = 3, radius: float = 1.0) -> ShapeMesh:
    """Closed sphere of ``20 * 4**subdivisions`` nearly equilateral triangles: a subdivided icosahedron.

    Raises:
        MeshError: if ``subdivisions`` is not an integer from 0 on.
    """
    check_count("subdivisions", subdivisions, 0, "0 is the icosahedron")
    points, faces = _icosahedron()
    for _ in range(subdivisions):
        edges = np.sort(faces[:, [1, 2, 2, 0, 0, 1]].reshape(-1, 2), axis=1)
        unique, inverse = np.unique(edges, axis=0, return_inverse=True)
        middle = len(points) + inverse.reshape(-1, 3)  # opposite to corners 0, 1, 2
        points = np.concatenate([points, points[unique].sum(1)])
        points /= np.linalg.norm(points, axis=1, keepdims=True)
        a, b, c = faces.T
        x, y, z = middle.T
        faces = np.concatenate([np.stack(f, axis=1) for f in ((a, z, y), (b, x, z), (c, y, x), (x, y, z))])
    parameters = np.stack([np.arctan2(points[:, 1], points[:, 0]) % (2 * np.pi), np.arcsin(points[:, 2])], axis=1)
    return build_mesh(Sphere(radius), parameters, faces)


def _icosahedron() -> tuple[Points, Ints]:
    from scipy.spatial import ConvexHull

    golden = (1 + np.sqrt(5)) / 2
    corners = np.array([[0, a, b * golden] for a in (-1, 1) for b in (-1, 1)])
    points = np.concatenate([np.roll(corners, turn, axis=1) for turn in range(3)]) / np.hypot(1, golden)
    return points, _outward(points, ConvexHull(points).simplices.astype(np.int64))


def _positions(surface: Surface, parameters: Points) -> Points:
    u, v = torch.from_numpy(np.ascontiguousarray(parameters.T))
    return surface.position(u, v).numpy()


# ---- vertices ------------------------------------------------------------------------------------------


def _spacing(area: float, boundary: float, count: int) -> float:
    """Mean edge length of a mesh: ``count = area / (sqrt(3)/2 spacing^2) + boundary / (2 spacing)``."""
    density = area * 2 / np.sqrt(3)
    return float((boundary / 2 + np.sqrt(boundary**2 / 4 + 4 * count * density)) / (2 * count))


def _sides(surface: Surface) -> list[tuple[Points, Points]]:
    """Finely sampled boundary curves, counterclockwise: parameters and arc length."""
    (u0, u1), (v0, v1) = surface.domain
    corners = np.array([[u0, v0], [u1, v0], [u1, v1], [u0, v1], [u0, v0]])
    sides = []
    for side in range(4):
        open_end = not surface.periodic[1 - side % 2]
        pole = side % 2 == 0 and surface.poles[side // 2]
        if open_end and not pole:
            along = np.linspace(corners[side], corners[side + 1], _PROFILE)
            steps = np.linalg.norm(np.diff(_positions(surface, along), axis=0), axis=1)
            sides.append((along, np.concatenate([[0.0], np.cumsum(steps)])))
    return sides


def _boundary_length(surface: Surface) -> float:
    return float(sum(length[-1] for _, length in _sides(surface)))


def _boundary_parameters(surface: Surface, spacing: float) -> Points:
    """Equally spaced vertices on the boundary; every side starts at its corner and leaves its end to the next."""
    parts = [np.zeros((0, 2))]
    for along, length in _sides(surface):
        wanted = np.linspace(0, length[-1], max(round(length[-1] / spacing), 3) + 1)[:-1]
        parts.append(np.stack([np.interp(wanted, length, along[:, axis]) for axis in range(2)], axis=1))
    return np.concatenate(parts)


def _spread(surface: Surface, outer: Points, count: int, random: np.random.Generator) -> Points:
    """Farthest-point sampling: ``count`` parameters that keep away from each other and from ``outer``."""
    from scipy.spatial import cKDTree

    candidates = _random_parameters(surface, _CANDIDATES * (count + len(outer)), random)
    places = _positions(surface, candidates)
    tree = cKDTree(places)
    if len(outer):
        distance: Points = np.asarray(cKDTree(_positions(surface, outer)).query(places)[0])
        chosen = [int(np.argmax(distance))]
    else:
        chosen = [0]
        distance = np.linalg.norm(places - places[0], axis=1)
    while True:
        place = places[chosen[-1]]
        near = tree.query_ball_point(place, distance[chosen[-1]])
        distance[near] = np.minimum(distance[near], np.linalg.norm(places[near] - place, axis=1))
        if len(chosen) == count:
            return candidates[chosen]
        chosen.append(int(np.argmax(distance)))


def _random_parameters(surface: Surface, count: int, random: np.random.Generator) -> Points:
    """Parameters of points with uniform density on the surface, by rejection."""
    low, high = np.array(surface.domain).T
    accepted = np.zeros((0, 2))
    while len(accepted) < count:
        trial = random.uniform(low, high, (2 * count, 2))
        density = surface.area_element(*torch.from_numpy(np.ascontiguousarray(trial.T))).numpy()
        accepted = np.concatenate([accepted, trial[random.uniform(0, density.max(), len(trial)) < density]])
    return accepted[:count]


# ---- spheres -------------------------------------------------------------------------------------------


def _hull(surface: Surface, vertices: Points, parameters: Points) -> Ints:
    """Faces of the convex hull, outward, without the lid over an open end."""
    from scipy.spatial import ConvexHull

    faces = _outward(vertices, ConvexHull(vertices).simplices.astype(np.int64))
    latitude = parameters[faces, 1]
    for value, is_pole in zip(surface.domain[1], surface.poles, strict=True):
        if not is_pole:
            faces, latitude = (part[~(np.abs(latitude - value) < 1e-12).all(1)] for part in (faces, latitude))
    return faces


def _outward(points: Points, faces: Ints) -> Ints:
    """Faces of a convex body around the origin or of a cap, turned so that normals point away from its centre."""
    a, b, c = points[faces].transpose(1, 0, 2)
    inward = (np.cross(b - a, c - a) * (a + b + c - 3 * points.mean(0))).sum(1) < 0
    faces[inward] = faces[inward][:, ::-1]
    return faces
