"""What is to follow principal directions in a mesh: edges, and in lattices with rows what stands across these."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from ..fields.frames import Bools, Floats, Ints
from ..topology import Topology

_MEDIANS = 0.5  # weight of angles of medians beside those of edges on rows: 1 turns rows away, 0 leaves E above C


@dataclass(frozen=True, eq=False)
class Steps:
    """Differences of vertices, with the places where their directions are read.

    Attributes:
        differences: (S, V) of vertices.
        middles: (S, V) means of vertices.
        weights: (S,) of angles.
        edges: (I,) bool: which inner edges are among them.
    """

    differences: sp.csr_matrix
    middles: sp.csr_matrix
    weights: Floats
    edges: Bools

    @classmethod
    def of(cls, topology: Topology, rows: set[tuple[int, int]] | None) -> Steps:
        """All inner edges; or those on rows, and medians.

        Medians lead from the middle of the side on a row to the opposite corner, in triangles with one such side. Where
        they are orthogonal to rows, rows are shifted by half an edge against each other.

        Args:
            topology: of the mesh, triangles where there are rows.
            rows: edges on rows, the smaller vertex first.
        """
        edges = topology.interior_edges.numpy()
        if rows is None:
            return cls._from(incidence(edges, topology.num_vertices), np.ones(len(edges)), np.ones(len(edges), bool))
        on_row = np.array([(a, b) in rows for a, b in np.sort(topology.edges.numpy(), axis=1).tolist()], bool)
        medians = _medians(topology, on_row)
        chosen = on_row[: len(edges)]
        along = incidence(edges[chosen], topology.num_vertices)
        weights = np.repeat([1.0, _MEDIANS], [along.shape[0], medians.shape[0]])
        return cls._from(sp.csr_matrix(sp.vstack([along, medians])), weights, chosen)

    @classmethod
    def _from(cls, differences: sp.csr_matrix, weights: Floats, edges: Bools) -> Steps:
        return cls(differences, sp.csr_matrix(abs(differences) / 2), weights, edges)


def incidence(edges: Ints, count: int) -> sp.csr_matrix:
    """(E, V) differences of the ends of edges (E, 2) of so many vertices, second less first."""
    entries = np.repeat([-1.0, 1.0], len(edges)), (np.tile(np.arange(len(edges)), 2), edges.T.ravel())
    return sp.csr_matrix(entries, shape=(len(edges), count))


def _medians(topology: Topology, on_row: Bools) -> sp.csr_matrix:
    sides = on_row[topology.corner_edges.numpy()].reshape(-1, 3)
    one = np.flatnonzero(sides.sum(1) == 1)
    first = sides[one].argmax(1)
    a, b, c = (topology.triangles.numpy()[one, (first + k) % 3] for k in range(3))
    at = np.tile(np.arange(len(one)), 3), np.concatenate([a, b, c])
    return sp.csr_matrix((np.repeat([-0.5, -0.5, 1.0], len(one)), at), shape=(len(one), topology.num_vertices))
