"""Creases of a mesh: the sharp edges inside it, as curves with corners."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from ._numbers import check_radians
from .errors import ShapeError
from .geometry import dihedral_angles
from .topology import Topology


class CreaseChain(NamedTuple):
    """A stretch of a crease.

    Attributes:
        vertices: (n,) vertex numbers in order; an open chain includes the corners at both ends.
        closed: whether it is a whole loop without corners, whose last vertex is joined to its first.
    """

    vertices: Tensor
    closed: bool


def crease_edges(vertices: Tensor, topology: Topology, crease_angle: float) -> Tensor:
    """Interior edges whose faces meet at more than ``crease_angle``.

    Args:
        vertices: (V, 3) positions, any length unit.
        topology: the connectivity; any polygons.
        crease_angle: radians between the normals of both faces, 0 to pi: 0 where flat; as a setting, 0 for no creases.

    Returns:
        (n,) edge numbers in order; none beside a face without area.

    Raises:
        ShapeError: if ``vertices`` is not a floating tensor (V, 3).
        SettingsError: if ``crease_angle`` is not between 0 and pi.

    Example:
        >>> from torchfair.creases import crease_edges
        >>> import math, torch
        >>> from torchfair import Topology
        >>> tent = torch.tensor([[0.0, 0, 0], [0, 1, 0], [1, 0, 1], [-1, 0, 1]])
        >>> crease_edges(tent, Topology.from_faces([[0, 2, 1], [0, 1, 3]]), math.radians(40))
        tensor([0])
    """
    topology.check_vertices(vertices)
    if vertices.ndim != 2:
        raise ShapeError("vertices", f"({topology.num_vertices}, 3), one mesh", tuple(vertices.shape))
    check_radians("crease_angle", crease_angle)
    if crease_angle == 0:
        return torch.zeros(0, dtype=torch.int64, device=topology.device)
    return torch.nonzero(dihedral_angles(vertices.detach(), topology).abs() > crease_angle).squeeze(1)


def crease_corners(vertices: Tensor, topology: Topology, edges: Tensor, corner_angle: float) -> Tensor:
    r"""Vertices at which creases end, branch, turn or meet the boundary.

    ::

            |                                    o --   a turn by more than
         -- o --   three or more      o --   an  |      ``corner_angle``
                                             end |

    Args:
        vertices: (V, 3) positions, any length unit.
        topology: the connectivity.
        edges: (n,) numbers of the interior edges that are creases, such as from :func:`crease_edges`.
        corner_angle: radians, the largest turn of a crease that is no corner; 0 for straight on.

    Returns:
        (V,) bool; false at vertices without a crease.

    Raises:
        MeshError: if an edge number is out of range.
    """
    topology.check_interior_edges(edges, "creases: ")
    ends = topology.edges[edges]
    count = torch.bincount(ends.reshape(-1), minlength=topology.num_vertices)
    corners = (count > 0) & ((count != 2) | topology.is_boundary_vertex)
    v, w = ends.unbind(1)
    along = torch.nn.functional.normalize(vertices.detach()[w] - vertices.detach()[v], dim=1)
    sums = torch.zeros_like(vertices).index_add(0, v, along).index_add(0, w, -along)  # 2 sin(turn / 2) where two meet
    turns = 2.0 * torch.asin((0.5 * torch.linalg.vector_norm(sums, dim=1)).clamp_max(1.0))
    return corners | ((count == 2) & (turns > corner_angle))


def crease_chains(topology: Topology, edges: Tensor, corners: Tensor) -> list[CreaseChain]:
    """Crease edges in order, cut at corners.

    Every edge is in one chain. Chains that meet at a corner share it; one that leaves a corner and returns to it
    without another starts and ends there.

    Args:
        topology: the connectivity.
        edges: (n,) numbers of the edges that are creases, each once.
        corners: (V,) bool, such as from :func:`crease_corners`: wherever other than two of the edges meet.

    Returns:
        Open chains by the number of the corner where they begin, the smaller of both; then the closed ones.

    Raises:
        ShapeError: if ``corners`` is not a bool tensor (V,), or two edges do not meet at a vertex that is no corner.

    Example:
        >>> from torchfair.creases import crease_chains, crease_corners, crease_edges
        >>> import math, torch
        >>> from torchfair import Topology
        >>> tent = torch.tensor([[0.0, 0, 0], [0, 1, 0], [1, 0, 1], [-1, 0, 1]])
        >>> topology = Topology.from_faces([[0, 2, 1], [0, 1, 3]])
        >>> edges = crease_edges(tent, topology, math.radians(40))
        >>> crease_chains(topology, edges, crease_corners(tent, topology, edges, math.radians(40)))
        [CreaseChain(vertices=tensor([0, 1]), closed=False)]
    """
    if corners.shape != (topology.num_vertices,) or corners.dtype != torch.bool:
        expected = f"a bool tensor ({topology.num_vertices},)"
        raise ShapeError("corners", expected, f"{tuple(corners.shape)} {corners.dtype}")
    ends = topology.edges[edges]
    count = torch.bincount(ends.reshape(-1), minlength=topology.num_vertices)
    if bool(((count > 0) & (count != 2) & ~corners).any()):
        raise ShapeError(
            "corners", "true wherever one crease edge ends or more than two meet", "false at such a vertex"
        )
    stops = set(torch.nonzero(corners).squeeze(1).tolist())
    beside: dict[int, list[int]] = {}
    for v, w in ends.tolist():
        beside.setdefault(v, []).append(w)
        beside.setdefault(w, []).append(v)
    chains = []
    for start in [*sorted(beside.keys() & stops), *sorted(beside.keys() - stops)]:
        while beside[start]:
            walk = _walked(beside, start, stops)
            closed = start not in stops
            chains.append(CreaseChain(torch.tensor(walk[:-1] if closed else walk, device=topology.device), closed))
    return chains


def _walked(beside: dict[int, list[int]], start: int, stops: set[int]) -> list[int]:
    """The vertices from ``start`` along edges that have not been walked, to a stop or back; takes these edges out."""
    walk = [start]
    while len(walk) == 1 or (walk[-1] != start and walk[-1] not in stops):
        here, there = walk[-1], beside[walk[-1]].pop(0)
        beside[there].remove(here)
        walk.append(there)
    return walk
