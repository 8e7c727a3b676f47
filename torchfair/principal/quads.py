r"""Triangle meshes with the combinatorics of principal-symmetric ones, from quad meshes (paper section 6).

Where quads follow principal directions, "suitable diagonals" make two triangles of each::

        o-----o-----o-----o     the edges of one family, drawn across, become principal; all quads between two of
        | \   | \   | \   |     their polylines are cut alike, so that every vertex gets one diagonal on either side
        o-----o-----o-----o     and two opposite principal edges among six; and the next row is cut the other way,
        |   / |   / |   / |     since otherwise each row would lean a little more than the one before
        o-----o-----o-----o
"""

from __future__ import annotations

import torch
from torch import Tensor

from .._graph import connected_in_two_colours, edge_numbers, face_components
from .._names import PlacedError, few
from ..errors import MeshError
from ..topology import Topology
from .principal_edges import PrincipalEdges


def triangles_from_quads(vertices: Tensor, topology: Topology, seed_edge: int | None = None) -> PrincipalEdges:
    """The triangle mesh of a quad mesh cut by diagonals in alternating rows, with its principal edges.

    These are a family of the edges of quads: edges opposite to each other in a quad belong together, and so do those
    that go straight on at a vertex of valence 4. Vertices keep their numbers and places. Diagonals lean to one side and
    to the other, so polylines are sheared by half an edge against each other: see :func:`half_shifted`.

    Args:
        vertices: (V, 3) positions, which choose between the two families if no edge is given: taken is the one whose
            polylines bend less out of the surface. Near parabolic curves only that can be principal, see
            :func:`torchfair.formfinding.principal_symmetric`.
        topology: a mesh of quads.
        seed_edge: number of an edge that is to be principal, in ``topology.edges``. The other components of the mesh,
            if there are any, choose for themselves.

    Returns:
        The principal edges. Their topology is that of the triangles, two for each quad in the order of the quads.

    Raises:
        MeshError: if a face is not a quad; there is no such edge; edges cannot be told apart in two families, which
            vertices of odd valence forbid; or rows cannot alternate, because an odd number of them closes up, around a
            vertex of valence 6 or around the mesh.
    """
    quads = _require_quads(topology)
    turned = _chosen(vertices, topology, _families(topology), seed_edge)
    principal = _edges_of(topology, turned)
    start = turned ^ _leans(topology, principal)
    a, b, c, d = torch.where(start[:, None], quads.roll(-1, 1), quads).unbind(1)
    triangles = torch.stack([a, b, c, a, c, d], dim=1).view(-1, 3)
    cut = Topology.from_faces(triangles, topology.num_vertices)
    mask = torch.zeros(cut.num_edges, dtype=torch.bool, device=topology.device)
    mask[edge_numbers(cut, topology.edges[principal])] = True
    return PrincipalEdges(cut, mask)


def half_shifted(vertices: Tensor, quads: Topology, edges: PrincipalEdges) -> Tensor:
    """Positions (V, 3) with neighbouring principal polylines shifted against each other by half an edge.

    That takes the shear of the diagonals away: regular vertices move a quarter of an edge towards the side of their
    diagonals, on the parabola through them and their principal neighbours. All others stay.

    Args:
        vertices: (V, 3) positions of the quad mesh.
        quads: its topology.
        edges: of :func:`triangles_from_quads`.
    """
    stars = edges.stars()
    beside = stars.cospherical[:, 0]  # the next after the first principal neighbour
    is_diagonal = edge_numbers(quads, torch.stack([stars.vertices, beside], dim=1)) < 0
    ahead, behind = stars.principal.unbind(1)
    ahead, behind = torch.where(is_diagonal, ahead, behind), torch.where(is_diagonal, behind, ahead)
    x, following, previous = vertices[stars.vertices], vertices[ahead], vertices[behind]
    share = 0.25
    moved = x + 0.5 * share * (following - previous) + 0.5 * share**2 * (following - 2.0 * x + previous)
    return vertices.index_copy(0, stars.vertices, moved)


def _require_quads(topology: Topology) -> Tensor:
    """(F, 4) corners.

    Raises:
        MeshError: if a face is not a quad.
    """
    wrong = torch.nonzero(topology.face_sizes != 4).squeeze(1).tolist()
    if wrong or not topology.num_faces:
        words = f"{len(wrong)} face(s) are not quads: faces "
        raise PlacedError(words, few("face", wrong), ". Remesh, or take a triangle mesh.")
    return topology.corners.view(-1, 4)


def _families(topology: Topology) -> Tensor:
    """(F,) bool: with which pair of its sides a quad belongs to a family that goes on from quad to quad."""
    sides = _sides(topology)
    turned, broken = two_colours(topology.num_faces, topology.interior_edge_faces, (sides.sum(1) % 2).bool())
    if broken.numel():
        odd = ~topology.is_boundary_vertex & (topology.valences % 2 == 1)
        culprits = torch.nonzero(odd).squeeze(1).tolist()
        where = ["around vertices ", *few("vertex", culprits), ", whose valence is odd"]
        raise PlacedError(
            "the edges are no two families ", where if culprits else "around a handle or a hole",
            ": principal edges would have to turn there. Cut the mesh into parts without them, or move these vertices "
            "to the boundary."
        )  # fmt: skip
    return turned


def _edges_of(topology: Topology, turned: Tensor) -> Tensor:
    """(E,) bool: the edges of a family: sides 0 and 2 of a quad, or 1 and 3 where it is turned."""
    side = torch.arange(topology.corners.shape[0], device=topology.device) % 2 == 1
    mask = torch.zeros(topology.num_edges, dtype=torch.bool, device=topology.device)
    mask[topology.corner_edges[side == turned[topology.corner_faces]]] = True
    return mask


def _leans(topology: Topology, principal: Tensor) -> Tensor:
    """(F,) bool: which of its diagonals cuts each quad; the same along rows, the other one in the next row."""
    change = principal[: topology.num_interior_edges]
    lean, broken = two_colours(topology.num_faces, topology.interior_edge_faces, change)
    if broken.numel():
        faces = broken.tolist()
        raise PlacedError(
            "rows of quads cannot be cut in turn, because an odd number of them closes up: faces ", few("face", faces),
            ". Take the other family of edges, or a mesh with another row."
        )  # fmt: skip
    return lean


def _sides(topology: Topology) -> Tensor:
    """(I, 2) which side of its left and of its right quad every interior edge is; side k runs from corner k on."""
    edges, corners = topology.corner_edges, torch.arange(topology.corners.shape[0], device=topology.device)
    interior = edges < topology.num_interior_edges
    is_right = topology.corners != topology.edges[edges, 0]
    sides = torch.zeros(topology.num_interior_edges, 2, dtype=torch.int64, device=topology.device)
    sides[edges[interior], is_right[interior].long()] = corners[interior] % 4
    return sides


def _chosen(vertices: Tensor, topology: Topology, turned: Tensor, seed_edge: int | None) -> Tensor:
    """The family (F,) that holds the seed in its component; in others, and without a seed, the one that bends less."""
    components = face_components(topology)
    other = _bends_less(vertices, topology, turned, components)
    if seed_edge is not None:
        if not 0 <= seed_edge < topology.num_edges:
            raise MeshError(f"seed_edge: no such edge: {seed_edge}; the mesh has {topology.num_edges}")
        corner = int(torch.nonzero(topology.corner_edges == seed_edge)[0])
        other[components[corner // 4]] = not bool(_edges_of(topology, turned)[seed_edge])
    return turned ^ other[components]


def _bends_less(vertices: Tensor, topology: Topology, turned: Tensor, components: Tensor) -> Tensor:
    """For every component, whether the other family bends less out of the surface: mean squared normal curvatures."""
    bends = vertices.new_zeros(2, int(components.max()) + 1)
    if 4 not in topology.rings_by_valence:
        return bends[0] > bends[1]
    v, rings = topology.rings_by_valence[4]
    mask, x, ring = _edges_of(topology, turned), vertices[v], vertices[rings]
    normals = torch.linalg.cross(ring[:, 2] - ring[:, 0], ring[:, 3] - ring[:, 1])
    normals = normals / torch.linalg.vector_norm(normals, dim=1, keepdim=True).clamp_min(1e-300)
    owner = torch.zeros(topology.num_vertices, dtype=torch.int64)
    owner[topology.corners] = components[topology.corner_faces]
    for step in range(2):
        ahead, behind = ring[:, step], ring[:, step + 2]
        curvatures = ((ahead + behind - 2.0 * x) * normals).sum(1) / (ahead - behind).square().sum(1).clamp_min(1e-300)
        is_other = ~mask[edge_numbers(topology, torch.stack([v, rings[:, step]], dim=1))]
        bends.index_put_((is_other.long(), owner[v]), curvatures.square(), accumulate=True)
    return bends[0] > bends[1]


def two_colours(count: int, pairs: Tensor, differ: Tensor) -> tuple[Tensor, Tensor]:
    """Two colours of things 0..count-1 such that the two of each pair have different ones exactly where they are to.

    Args:
        count: how many things.
        pairs: (n, 2).
        differ: (n,) bool.

    Returns:
        (count,) bool; and the things that can have neither, since an odd number of changes leads back to them.
    """
    plain, coloured = torch.from_numpy(connected_in_two_colours(pairs.cpu().numpy(), differ.cpu().numpy(), count))
    return plain > coloured, torch.nonzero(plain == coloured).squeeze(1)
