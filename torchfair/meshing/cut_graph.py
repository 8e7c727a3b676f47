"""A mesh cut open along paths, so that directions can be combed and a map to the plane has one value."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import dijkstra

from ..fields.frames import Bools, FaceFrames, Floats, Ints
from ..fields.matchings import QUARTER


class PathEdge(NamedTuple):
    """Place of a cut edge: the number of its path, and whether the path runs along the edge, not against it."""

    path: int
    along: bool


@dataclass(frozen=True, eq=False)
class CutGraph:
    """Where a mesh is cut, and directions combed on what is left, which is a disk.

    Attributes:
        angles: (F,) angles of directions that agree over all edges but the cut ones.
        quarters: (I,) quarter turns over edges, 0 to 3, 0 where there is no cut.
        cut: (I,) bool.
        charges: (V,) four times the index.
        paths: place of every cut edge; all edges of a path turn alike.
        num_paths: their number.
        nodes: (V,) bool: vertices that become points of the lattice, singular ones among them.
    """

    angles: Floats
    quarters: Ints
    cut: Bools
    charges: Ints
    paths: dict[int, PathEdge]
    num_paths: int
    nodes: Bools


def cut_open(frames: FaceFrames, angles: Floats, matched: Ints, charges: Ints) -> CutGraph:
    """Cuts a connected mesh along a tree of shortest paths between its singular vertices, boundaries and handles.

    Args:
        frames: of the triangles.
        angles: (F,) of the field.
        matched: (I,) quarter turns over edges.
        charges: (V,) of the vertices.
    """
    tree, parents = _dual_tree(frames)
    turned = _turned_along(frames, parents, matched)
    f, g = frames.faces.T
    quarters = matched + turned[g] - turned[f]
    singular = charges != 0
    cut = ~tree
    _prune(frames, cut, singular)
    paths, count = _paths(frames, cut, singular)
    return CutGraph(angles + QUARTER * turned, quarters % 4, cut, charges, paths, count, singular)


def dual_graph(frames: FaceFrames) -> sp.csr_matrix:
    """(F, F) distances of the centres of faces that share an edge."""
    f, g = frames.faces.T
    count = len(frames.triangles)
    lengths = np.linalg.norm(frames.centres[f] - frames.centres[g], axis=1)
    return sp.csr_matrix((np.r_[lengths, lengths], (np.r_[f, g], np.r_[g, f])), shape=(count, count))


def _dual_tree(frames: FaceFrames) -> tuple[Bools, Ints]:
    """Edges of a tree of shortest paths over the faces from the middle, and (F,) edges to parents, -1 at the root."""
    f, g = frames.faces.T
    centres = frames.centres
    middle = int(np.argmin(((centres - frames.areas @ centres / frames.areas.sum()) ** 2).sum(1)))
    before = dijkstra(dual_graph(frames), True, np.array(middle), True)[1]
    number = np.full(len(centres), -1)
    edges = np.arange(len(f))
    towards_g, towards_f = before[g] == f, before[f] == g
    number[g[towards_g]] = edges[towards_g]
    number[f[towards_f]] = edges[towards_f]
    tree = np.zeros(len(f), bool)
    tree[number[number >= 0]] = True
    return tree, number


def _turned_along(frames: FaceFrames, parents: Ints, matched: Ints) -> Ints:
    """(F,) quarter turns of faces against the root of a tree, with which its edges match.

    Args:
        frames: of the triangles.
        parents: (F,) edges of the tree, see :func:`_dual_tree`.
        matched: (I,) quarter turns over edges.
    """
    face, inner = np.arange(len(parents)), parents >= 0
    edge, child = parents[inner], face[inner]
    is_left = frames.faces[edge, 0] == child
    above = face.copy()
    above[child] = frames.faces[edge].sum(1) - child
    turned = np.zeros(len(parents), np.int64)
    turned[child] = np.where(is_left, matched[edge], -matched[edge])
    while (above[above] != above).any():  # twice as far up each time, the root has no turns to add
        turned, above = turned + turned[above], above[above]
    return turned


def _prune(frames: FaceFrames, cut: Bools, singular: Bools) -> None:
    """Takes loose ends off the cut, in place: those that reach neither a singular vertex nor the boundary."""
    stays = singular | frames.is_boundary
    left = np.flatnonzero(cut)
    while True:
        ends = frames.edges[left]
        loose = (np.bincount(ends.ravel(), minlength=len(stays)) == 1) & ~stays
        gone = loose[ends].any(1)
        if not gone.any():
            return
        cut[left[gone]] = False
        left = left[~gone]


def _paths(frames: FaceFrames, cut: Bools, singular: Bools) -> tuple[dict[int, PathEdge], int]:
    """Cut edges in runs between nodes: singular and boundary vertices, and those where not two cut edges meet."""
    edges = frames.edges.tolist()
    around: dict[int, list[int]] = defaultdict(list)
    cut_edges = np.flatnonzero(cut).tolist()
    for edge in cut_edges:
        for vertex in edges[edge]:
            around[vertex].append(edge)
    is_node = {v: len(at) != 2 or bool(singular[v]) or bool(frames.is_boundary[v]) for v, at in around.items()}
    places: dict[int, PathEdge] = {}
    count = 0
    nodes = [vertex for vertex, is_one in is_node.items() if is_one]
    starts = [(vertex, edge) for vertex in nodes for edge in around[vertex]]
    for vertex, edge in starts + [(edges[edge][0], edge) for edge in cut_edges]:
        if edge in places:
            continue
        here, at = vertex, edge
        while at not in places:
            places[at] = PathEdge(count, edges[at][0] == here)
            here = edges[at][0] + edges[at][1] - here
            if is_node[here]:
                break
            first, second = around[here]
            at = second if first == at else first
        count += 1
    return places, count
