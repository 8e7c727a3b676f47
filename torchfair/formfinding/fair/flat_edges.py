"""Which edges the job that lowers E keeps flat: the diagonals of planar panels that arrive as triangles."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from ..._graph import connected, face_components
from ...constraints.normal_variation import edge_stencils
from ...geometry import corner_angles, dihedral_angles
from ...geometry._ops import angle_of, cross, dot, norm
from ...settings.fair_settings import FairSettings
from ...topology import Topology

_ROUNDING = 1e-6  # radians: where every edge is flat, angles are those of rounding
_BY_CHANCE = 3.0  # times the tolerance: share of the edges of a smooth mesh that are flat by chance, at most
_STRAIGHT = math.radians(1.0)  # how far from 180 degrees the corner of a panel is no corner


def edges_to_keep_flat(vertices: Tensor, topology: Topology, settings: FairSettings) -> Tensor:
    """(n,) numbers of the interior edges that ``settings.flat`` chooses.

    Raises:
        MeshError: an edge number is out of range.
    """
    chosen, count = settings.flat, topology.num_interior_edges
    if not isinstance(chosen, str):
        edges = torch.tensor(chosen, dtype=torch.int64)
        topology.check_interior_edges(edges, "flat: ")
        return edges
    if chosen == "none":
        return torch.zeros(0, dtype=torch.int64)
    arrive = flat_edges(vertices, topology, settings.flat_tolerance)
    if chosen == "all":
        return arrive
    if len(arrive) <= _BY_CHANCE * settings.flat_tolerance * count:
        return arrive[:0]
    return arrive[_in_panels(vertices, topology, arrive)]


def flat_edges(vertices: Tensor, topology: Topology, tolerance: float) -> Tensor:
    """(n,) numbers of the edges between two triangles that are flat.

    Args:
        vertices: (V, 3).
        topology: Any polygon mesh.
        tolerance: Their angle over the mean angle of all interior edges, at most.
    """
    angles = dihedral_angles(vertices, topology).abs()
    if not angles.numel():
        return torch.zeros(0, dtype=torch.int64)
    triangles = (topology.face_sizes[topology.interior_edge_faces] == 3).all(1)
    return torch.nonzero(triangles & (angles <= max(tolerance * float(angles.mean()), _ROUNDING))).squeeze(1)


def _in_panels(vertices: Tensor, topology: Topology, flat: Tensor) -> Tensor:
    """(n,) bool: which of the edges ``flat`` (n,) are diagonals of panels.

    Coplanar triangles that hang together are one panel, cut by diagonals alone, if no vertex lies among them and they
    are not all there is. Where its outline passes straight through a vertex, several panels lie in one plane: then its
    triangles are joined in pairs, the most rectangular first.
    """
    sides = topology.interior_edge_faces
    regions = torch.from_numpy(connected(sides[flat].numpy(), topology.num_faces))
    whole = face_components(topology)
    size, diagonals = torch.bincount(regions), torch.bincount(regions[sides[flat, 0]], minlength=int(regions.max()) + 1)
    of_all = torch.bincount(whole)[whole]
    is_part = torch.zeros_like(size, dtype=torch.bool).index_fill(0, regions[size[regions] < of_all], True)
    is_panel = is_part & (diagonals == size - 1)  # a vertex among its triangles would close a ring of diagonals
    several = _have_straight_corners(vertices, topology, regions)
    owners = regions[sides[flat, 0]]
    loose = is_panel[owners] & several[owners]
    kept = is_panel[owners] & ~several[owners]
    kept[loose] = _paired(vertices, topology, flat[loose])
    return kept


def _have_straight_corners(vertices: Tensor, topology: Topology, regions: Tensor) -> Tensor:
    """For every region of faces, regions (F,), whether its outline passes straight through one of its vertices."""
    keys, inverse = torch.unique(
        regions[topology.corner_faces] * topology.num_vertices + topology.corners, return_inverse=True
    )
    angles = vertices.new_zeros(len(keys)).index_add(0, inverse, corner_angles(vertices, topology))
    straight = keys[(angles - math.pi).abs() < _STRAIGHT] // topology.num_vertices
    return torch.bincount(straight, minlength=int(regions.max()) + 1) > 0


def _paired(vertices: Tensor, topology: Topology, edges: Tensor) -> Tensor:
    """(n,) bool: edges (n,) between triangles that make convex quads of them, each triangle in one quad at most.

    Again and again the edges are taken whose quad is more rectangular than all others of its two triangles.
    """
    sides = topology.interior_edge_faces[edges]
    angles = _quad_angles(vertices, topology, edges)
    score = (angles - 0.5 * math.pi).abs().amax(1)
    order = torch.argsort(score, stable=True)
    rank = torch.empty_like(order)
    rank[order] = torch.arange(len(order))
    free, chosen = (angles < math.pi - _STRAIGHT).all(1), torch.zeros(len(edges), dtype=torch.bool)
    while bool(free.any()):
        best = torch.full((topology.num_faces,), len(edges))
        best.scatter_reduce_(0, sides[free].T.reshape(-1), rank[free].repeat(2), "amin")
        new = free & (best[sides] == rank[:, None]).all(1)
        chosen |= new
        taken = torch.zeros(topology.num_faces, dtype=torch.bool)
        taken[sides[new].reshape(-1)] = True
        free = free & ~taken[sides].any(1)
    return chosen


def _quad_angles(vertices: Tensor, topology: Topology, edges: Tensor) -> Tensor:
    """(n, 4) angles of the quads that pairs of triangles make across ``edges`` (n,)."""
    sizes = topology.face_sizes[topology.interior_edge_faces]
    row = torch.cumsum((sizes == 3).all(1), 0) - 1
    if not edges.numel():
        return vertices.new_zeros(0, 4)
    v, w, left, right = vertices[edge_stencils(topology)[3, 3][row[edges]]].unbind(1)
    corners = [(v, w, left), (v, right, w), (w, left, v), (w, v, right), (left, v, w), (right, w, v)]
    parts = [angle_of(norm(cross(b - a, c - a)), dot(b - a, c - a)) for a, b, c in corners]
    return torch.stack([parts[0] + parts[1], parts[2] + parts[3], parts[4], parts[5]], dim=1)
