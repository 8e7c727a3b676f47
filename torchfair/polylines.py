"""Mesh polylines: the curves that run straight through the vertices of a mesh."""

from __future__ import annotations

import itertools

import torch
from torch import Tensor

from ._graph import edge_numbers
from .errors import MeshError, ShapeError
from .topology import Topology


def straight_triples(topology: Topology, *, corners: Tensor | None = None) -> Tensor:
    r"""Consecutive vertices ``(previous, vertex, next)`` of the mesh polylines.

    Which edges continue each other at a vertex is decided by counting, not by angles::

             \ | /            interior, even valence 2k: opposite edges of the ring are joined, k triples
            -- v --           interior, odd valence: every polyline ends here
             / | \
                              boundary: the two boundary edges are joined, the surface on the left of
            == v ==           previous -> v -> next; every other edge ends here, whatever the valence
               |
                              corner: a boundary vertex of valence 2 or one of ``corners``; all edges end

    So the middle edge of a quad mesh ends at the boundary, as do both inner edges of a triangle lattice. A
    boundary vertex of valence 2 belongs to a single face, so it is the corner of a patch, which fairness must
    not round off; corners of higher valence can only be told by geometry and are named by the caller.

    Args:
        topology: any polygon mesh.
        corners: (n,) vertex numbers, or (V,) bool, of further boundary vertices at which the boundary is not
            joined. Interior vertices among them are left as they are.

    Returns:
        (N, 3) int64, sorted by the middle vertex. Isolated vertices have no triple.

    Raises:
        ShapeError: if ``corners`` is neither a list of numbers nor a mask.
        MeshError: if a corner is no vertex of the mesh.
    """
    parts = [_boundary_triples(topology, corners)]
    for valence, (vertices, rings) in topology.rings_by_valence.items():
        if valence % 2 == 0:
            half = valence // 2
            middle = vertices[:, None].expand(-1, half)
            parts.append(torch.stack([rings[:, :half], middle, rings[:, half:]], dim=-1).reshape(-1, 3))
    triples = torch.cat(parts)
    return triples[torch.argsort(triples[:, 1], stable=True)]


def _boundary_triples(topology: Topology, corners: Tensor | None) -> Tensor:
    joined = topology.is_boundary_vertex & (topology.valences > 2)
    if corners is not None:
        joined[_checked(corners, topology)] = False
    vertices = torch.nonzero(joined).squeeze(1)
    # the ring of a boundary vertex begins with the next vertex of its loop and ends with the previous one
    following = topology.ring_vertices[topology.ring_offsets[vertices]]
    previous = topology.ring_vertices[topology.ring_offsets[vertices + 1] - 1]
    return torch.stack([previous, vertices, following], dim=1)


def _checked(corners: Tensor, topology: Topology) -> Tensor:
    """``corners`` as something to index the vertices with."""
    count = topology.num_vertices
    if corners.dtype == torch.bool and corners.shape == (count,):
        return corners
    if corners.ndim != 1 or corners.dtype not in (torch.int64, torch.int32):
        expected = f"vertex numbers (n,) or a mask ({count},)"
        raise ShapeError("corners", expected, f"{tuple(corners.shape)} {corners.dtype}")
    outside = corners[(corners < 0) | (corners >= count)].tolist()
    if outside:
        raise MeshError(f"corners: no such vertices: {outside[:5]}; the mesh has {count}")
    return corners.long()


def mesh_polylines(topology: Topology, *, corners: Tensor | None = None) -> list[Tensor]:
    """Vertices along every mesh polyline; each edge of the mesh belongs to exactly one.

    Polylines are made of the :func:`straight_triples`. Open ones come first; a closed one repeats its first
    vertex at the end. Boundary curves have the surface on their left. A polyline may cross itself. Order and
    direction depend on the topology only, so they are the same in every call.

    Args:
        topology: any polygon mesh.
        corners: (n,) as for :func:`straight_triples`.

    Returns:
        Vertex numbers, one int64 tensor of two or more for each polyline, on the device of ``topology``.
    """
    return join_triples(topology.edges, straight_triples(topology, corners=corners), topology.num_vertices)


def polylines_along(topology: Topology, mask: Tensor) -> list[Tensor]:
    """Vertices along every polyline of marked edges; each marked edge belongs to exactly one.

    They run straight on as :func:`mesh_polylines` do, and end where the next edge is not marked.

    Args:
        topology: any polygon mesh.
        mask: (E,) bool.

    Returns:
        As of :func:`mesh_polylines`.

    Raises:
        ShapeError: if ``mask`` is not a bool tensor (E,).
    """
    if mask.shape != (topology.num_edges,) or mask.dtype != torch.bool:
        raise ShapeError("mask", f"a bool tensor ({topology.num_edges},)", f"{tuple(mask.shape)} {mask.dtype}")
    triples = straight_triples(topology)
    both = mask[edge_numbers(topology, triples.unfold(1, 2, 1))].all(1)
    return join_triples(topology.edges[mask], triples[both], topology.num_vertices)


def join_triples(edges: Tensor, triples: Tensor, num_vertices: int) -> list[Tensor]:
    """Polylines made of ``edges`` (n, 2), which continue each other at the middle vertices of ``triples`` (N, 3).

    Both edges of a triple are among the edges, and no edge occurs in two triples with the same middle vertex. The
    result is as for :func:`mesh_polylines`; open polylines that can be walked along the stored direction are.
    """
    darts = torch.cat([edges, edges.flip(1)])
    followers = _following_darts(darts, triples, num_vertices)
    # a dart starts an open polyline if nothing continues into it, that is, if its reverse has no follower;
    # darts along the stored edges come first, so that boundary curves get the surface on their left
    starts = torch.nonzero(followers.roll(len(edges)) < 0).squeeze(1)
    sequence, lengths = _walk(followers.tolist(), starts.tolist())
    chains = torch.split(darts[torch.tensor(sequence, dtype=torch.int64, device=edges.device)], lengths)
    return [torch.cat([chain[:1, 0], chain[:, 1]]) for chain in chains]


def _following_darts(darts: Tensor, triples: Tensor, num_vertices: int) -> Tensor:
    """(2n,) the directed edge that continues each directed edge, or -1.

    Dart ``e`` runs along edge ``e`` as it is stored, dart ``n + e`` against it.
    """
    keys, order = torch.sort(darts[:, 0] * num_vertices + darts[:, 1])

    def find(tails: Tensor, heads: Tensor) -> Tensor:
        return order[torch.searchsorted(keys, tails * num_vertices + heads)]

    previous, middle, following = triples.unbind(1)
    followers = torch.full_like(order, -1)
    followers[find(previous, middle)] = find(middle, following)
    followers[find(following, middle)] = find(middle, previous)
    return followers


def _walk(followers: list[int], starts: list[int]) -> tuple[list[int], list[int]]:
    """Chains of darts that use each edge once, open ones from ``starts``, then closed ones; and their lengths."""
    num_edges = len(followers) // 2
    unused = [True] * num_edges
    sequence: list[int] = []
    lengths: list[int] = []
    for dart in itertools.chain(starts, range(num_edges)):
        begin = len(sequence)
        while dart >= 0 and unused[edge := dart if dart < num_edges else dart - num_edges]:
            unused[edge] = False
            sequence.append(dart)
            dart = followers[dart]
        if len(sequence) > begin:
            lengths.append(len(sequence) - begin)
    return sequence, lengths
