r"""Edge families of triangle meshes: parallel edges of a lattice, followed from triangle to triangle.

In a lattice of equilateral triangles two triangles with a common edge make a parallelogram, whose opposite sides
are parallel::

          a ------ v          v->w is side i of the left triangle (v, w, a) and side j of the right one (w, v, b);
         / left   / \         w->a is parallel to v->b, a->v to b->w: side k on the left to side k + j - i (mod 3)
        /    \   /   \        on the right.
       w ---- edge -- b

So a family is a number of Z/3 for every triangle, the side that belongs to the family, with a known difference
across each interior edge. The differences around a vertex of valence k add up to zero if k is divisible by three,
and to a shift of all three families if not.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from .._graph import connected
from ..topology import Topology

Ints = npt.NDArray[np.int64]


class Differences(NamedTuple):
    """What changes across the interior edges of a triangle mesh.

    Attributes:
        faces: (I, 2) left and right face.
        shifts: (I,) side of the right face minus parallel side of the left face, 0, 1 or 2.
        edge_sides: (E, 2) which side of the left and of the right face each edge is, -1 where there is no face.
        side_edges: (F, 3) the edges of each face; side k runs from corner k to the next.
    """

    faces: Ints
    shifts: Ints
    edge_sides: Ints
    side_edges: Ints


def differences(topology: Topology) -> Differences:
    """The differences of a triangle mesh.

    Raises:
        MeshError: if a face is not a triangle.
    """
    topology.require_triangles()
    edges, side_edges = topology.edges.cpu().numpy(), topology.corner_edges.cpu().numpy()
    corners = topology.corners.cpu().numpy()
    edge_sides = np.full((len(edges), 2), -1)
    is_right = (corners != edges[side_edges, 0]).astype(np.int64)
    edge_sides[side_edges, is_right] = np.arange(len(corners)) % 3
    interior = edge_sides[: topology.num_interior_edges]
    shifts = (interior[:, 1] - interior[:, 0]) % 3
    return Differences(topology.interior_edge_faces.cpu().numpy(), shifts, edge_sides, side_edges.reshape(-1, 3))


def spread(rule: Differences, faces: Ints, sides: Ints, costs: npt.NDArray[np.float64] | None = None) -> Ints:
    """Carries sides of some faces to all faces that are connected with them.

    Args:
        rule: the differences of the mesh.
        faces: (n,) faces to start from.
        sides: (n,) their sides, 0, 1 or 2.
        costs: (I,) positive costs of the interior edges; the path from the start to any face is part of a tree of
            least cost. Without costs paths are the shortest ones.

    Returns:
        (F,) side of each face, -1 where no path leads. Edges beside which sides disagree are those of :func:`seams`.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import breadth_first_order, minimum_spanning_tree

    root = len(rule.side_edges)  # one more node, joined to all faces to start from
    joined = np.concatenate([rule.faces, np.stack([np.full_like(faces, root), faces], axis=1)])
    weights = (
        np.ones(len(joined)) if costs is None else np.append(costs, np.full(len(faces), 1e-9 * costs.min(initial=1)))
    )
    joined = joined.astype(np.int32)  # SciPy before 1.15 takes no other kind
    graph = coo_array((weights, joined.T), shape=(root + 1, root + 1)).tocsr()
    if costs is not None:
        graph = minimum_spanning_tree(graph)
    order, parents = breadth_first_order(graph, root, directed=False)
    parents = np.where(parents < 0, np.arange(root + 1), parents)
    change = np.zeros(root + 1, np.int64)
    left, right = rule.faces.T
    for parent, child, shift in ((left, right, rule.shifts), (right, left, -rule.shifts)):
        used = np.flatnonzero(parents[child] == parent)
        change[child[used]] = shift[used]
    started = parents[faces] == root
    change[faces[started]] = sides[started]
    while not (parents == parents[parents]).all():
        change = (change + change[parents]) % 3
        parents = parents[parents]
    reached = np.zeros(root + 1, np.bool_)
    reached[order] = True
    return np.where(reached, change % 3, -1)[:root]


def seams(rule: Differences, sides: Ints) -> Ints:
    """Interior edges beside which the sides (F,) of two faces are not parallel; faces without a side do not count."""
    left, right = sides[rule.faces].T
    return np.flatnonzero((left >= 0) & (right >= 0) & ((left + rule.shifts - right) % 3 != 0))


def mark(rule: Differences, sides: Ints) -> npt.NDArray[np.bool_]:
    """(E,) the edges that are the side of a face beside them."""
    marked = np.zeros(len(rule.edge_sides), np.bool_)
    known = np.flatnonzero(sides >= 0)
    marked[rule.side_edges[known, sides[known]]] = True
    return marked


def sides_of(rule: Differences, marked: npt.NDArray[np.bool_]) -> Ints:
    """(F,) a side for each face: the marked one where there is just one, elsewhere carried over from such faces."""
    of_face = marked[rule.side_edges]
    clear = np.flatnonzero(of_face.sum(1) == 1)
    return spread(rule, clear, of_face[clear].argmax(1))


def face_components(rule: Differences) -> tuple[Ints, int]:
    """(F,) number of the component that each face is in, connected across edges; and how many there are."""
    components = connected(rule.faces, len(rule.side_edges))
    return components, int(components.max(initial=-1)) + 1
