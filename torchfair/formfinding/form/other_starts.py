"""Other surfaces with the same boundary and connectivity to start from: minima of C lie next to each other."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch
from scipy.sparse import eye_array
from scipy.sparse.csgraph import dijkstra
from torch import Tensor

from ..._graph import graph_laplacian
from ...geometry import corner_angles, face_area_vectors, vertex_normals
from ...geometry._edge_graph import edge_graph
from ...linear import factorise
from ...topology import Topology
from .starting.patch import Patch
from .starting.relaxing import smaller_area

_AREA_STEPS = 12
_LEAST_ANGLE = np.radians(3.0)  # of a start
_STEEP = 1.5  # how fast the hull is left next to a rim that does not lie on it
_HEIGHT = 0.6  # of bumps, over the largest distance from the rim
_FLAT = 0.3  # area that is seen along the area vector, over the area: below, a surface has no above


class Start(NamedTuple):
    """Where to start from.

    Attributes:
        name: In words.
        vertices: (V, 3).
    """

    name: str
    vertices: Tensor


def other_starts(vertices: Tensor, topology: Topology, number: int) -> list[Start]:
    """At most ``number`` of them, the same ones each time; boundary vertices keep their places.

    The surface on its convex hull above and below, bumped up and down, and of least area; then with random smooth
    bumps. Those that come out with slivers are left out, as are hulls of surfaces that have no above, such as tubes.

    Args:
        vertices: (V, 3) a surface.
        topology: Triangles.
        number: How many are wanted.
    """
    if not bool((~topology.is_boundary_vertex).any()) or not len(topology.boundary_loops()):
        return []
    up, level = _up(vertices, topology)
    distance = _from_the_rim(vertices, topology)
    round_ = torch.from_numpy(distance * (2.0 - distance / distance.max()))[:, None]  # a dome over the rim
    starts = []
    if level:
        for name, sign in (("on the convex hull, above", 1.0), ("on the convex hull, below", -1.0)):
            lifted = _on_hull(vertices, topology, sign * up[0], distance)
            starts += [Start(name, lifted)] if lifted is not None else []
    starts += [Start(f"bumped {word}", vertices + s * _HEIGHT * round_ * up) for word, s in (("up", 1), ("down", -1))]
    starts.append(Start("of least area", _least_area(vertices, topology)))
    for seed in range(max(0, number - len(starts))):
        starts.append(Start(f"random bumps {seed + 1}", vertices + _random(topology, seed) * round_ * up))
    good = [start for start in starts if float(corner_angles(start.vertices, topology).min()) > _LEAST_ANGLE]
    return good[:number]


def _up(vertices: Tensor, topology: Topology) -> tuple[Tensor, bool]:
    """Where bumps go, (V, 3) unit: along the area vector if much of the surface is seen from there, else normals."""
    areas = face_area_vectors(vertices, topology)
    total = areas.sum(0)
    share = float(torch.linalg.vector_norm(total) / torch.linalg.vector_norm(areas, dim=1).sum())
    if share > _FLAT:
        return (total / torch.linalg.vector_norm(total)).expand_as(vertices), True
    return vertex_normals(vertices, topology), False


def _from_the_rim(vertices: Tensor, topology: Topology) -> np.ndarray:
    """(V,) lengths of the shortest ways to the boundary along edges; 0 where there is none."""
    rim = torch.nonzero(topology.is_boundary_vertex).flatten().tolist()
    found = dijkstra(edge_graph(vertices, topology), directed=False, indices=rim, min_only=True)
    reached: np.ndarray = np.where(np.isfinite(found), found, 0.0)
    return reached


def _on_hull(vertices: Tensor, topology: Topology, up: Tensor, distance: np.ndarray) -> Tensor | None:
    """Inner vertices lifted along ``up`` to the convex hull of the boundary; None if that is flat."""
    from scipy.spatial import ConvexHull, QhullError

    points, way = vertices.numpy(), up.numpy()
    try:
        planes = ConvexHull(points[topology.is_boundary_vertex.numpy()]).equations
    except QhullError:
        return None
    planes = planes[planes[:, :3] @ way > 1e-9]
    heights = (-(points @ planes[:, :3].T + planes[:, 3]) / (planes[:, :3] @ way)).min(1)
    lift = np.clip(heights, -_STEEP * distance, _STEEP * distance)
    return vertices + torch.from_numpy(lift[:, None] * way)


def _least_area(vertices: Tensor, topology: Topology) -> Tensor:
    """Some steps towards it, as long as triangles stay good."""
    count = topology.num_vertices
    rims = np.where(topology.is_boundary_vertex.numpy() | (topology.valences.numpy() == 0), 0, -1)
    faces = topology.corners.view(-1, 3).numpy()
    result = vertices
    for _ in range(_AREA_STEPS):
        patch = Patch(result.numpy(), faces, rims, np.zeros(count), np.zeros(count, bool))
        trial = torch.from_numpy(smaller_area(patch))
        if float(corner_angles(trial, topology).min()) < 2.0 * _LEAST_ANGLE:
            break
        result = trial
    return result


def _random(topology: Topology, seed: int) -> Tensor:
    """(V, 1) smooth heights between about -1 and 1, bumps over a fifth to a half of the mesh."""
    rng = np.random.default_rng(seed)
    count = topology.num_vertices
    reach = rng.uniform(0.1, 0.3) ** 2 * count
    noise = torch.from_numpy(rng.normal(size=(count, 1)))
    evening = factorise(eye_array(count) + reach * graph_laplacian(topology))
    smooth = evening.solve(evening.solve(noise).values).values
    result: Tensor = rng.uniform(0.3, 1.0) * smooth / smooth.abs().max()
    return result
