"""The whole numbers of a seamless map, and its values as combinations of them and of free values."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from ..fields.frames import FaceFrames, Ints
from .boundary_runs import BoundaryRun
from .cut_graph import CutGraph
from .integer_kernel import Row, integer_kernel
from .seams import Seams


@dataclass(frozen=True, eq=False)
class IntegerSplit:
    """Values of copies, real and imaginary parts in turn: ``free @ x + whole @ (basis @ y) + fixed``.

    Attributes:
        free: (2N, n) of the free real values x.
        whole: (2N, m) of the whole numbers z: two for each node, then for each path, one for each run.
        basis: (m, k) every allowed z is ``basis @ y`` with whole y.
        fixed: (2N,) what holds the map where nothing else does.
    """

    free: sp.csr_matrix
    whole: sp.csr_matrix
    basis: Ints
    fixed: np.ndarray

    @cached_property
    def moves(self) -> sp.csr_matrix:
        """(2N, k) of y."""
        return (self.whole @ sp.csr_matrix(self.basis.astype(float))).tocsr()

    @cached_property
    def real(self) -> sp.csr_matrix:
        """(2N, n + k) of x and y as real values, one after the other."""
        return sp.hstack([self.free, self.moves]).tocsr()


def split_integers(frames: FaceFrames, graph: CutGraph, seams: Seams, runs: list[BoundaryRun]) -> IntegerSplit:
    """Separates free values from whole numbers.

    Args:
        frames: of the triangles.
        graph: the cut.
        seams: its copies.
        runs: edges on lines of whole numbers.
    """
    return _Splitter(frames, graph, seams, runs).split()


class _Splitter:
    def __init__(self, frames: FaceFrames, graph: CutGraph, seams: Seams, runs: list[BoundaryRun]) -> None:
        self.frames, self.graph, self.seams, self.runs = frames, graph, seams, runs
        self.nodes = np.flatnonzero(graph.nodes)
        self.place = {int(vertex): 2 * number for number, vertex in enumerate(self.nodes)}
        self.first_path = 2 * len(self.nodes)
        self.first_run = self.first_path + 2 * graph.num_paths
        self.count = self.first_run + len(runs)

    def split(self) -> IntegerSplit:
        values, steps = (real_form(m) for m in self.seams.matrices(len(self.frames.points), self.graph.num_paths))
        ties, rows = self._ties(values, steps)
        rows += self._closures()
        held, pins = self._gauge(set(ties))
        basis = integer_kernel(rows + pins, self.count)
        unknowns = values.shape[1]
        free = np.ones(unknowns, bool)
        free[list(ties) + held] = False
        entries = [(unknown, number, factor) for unknown, row in ties.items() for number, factor in row.items()]
        tied = _sparse(entries, (unknowns, self.count))
        paths = sp.csr_matrix(
            (steps.data, steps.indices + self.first_path, steps.indptr), (len(self.seams.vertex) * 2, self.count)
        )
        fixed = np.zeros(unknowns)
        fixed[held] = 0.5  # of a mesh that may be moved as a whole
        return IntegerSplit(values[:, np.flatnonzero(free)], (values @ tied + paths).tocsr(), basis, values @ fixed)

    def _ties(self, values: sp.csr_matrix, steps: sp.csr_matrix) -> tuple[dict[int, Row], list[Row]]:
        """Values at nodes and on runs by whole numbers; and what holds where a value is on several, or on one twice."""
        ties: dict[int, Row] = {2 * v + k: {at + k: 1} for v, at in self.place.items() for k in (0, 1)}
        rows: list[Row] = []
        for number, run in enumerate(self.runs):
            faces, corners = np.array(run.corners).T
            for at in (2 * self.seams.copies[faces, corners] + run.component).tolist():
                unknown, sign = int(values.indices[at]), int(values.data[at])  # one entry a row
                row = {self.first_run + number: sign}
                terms = slice(steps.indptr[at], steps.indptr[at + 1])
                for path, factor in zip(steps.indices[terms].tolist(), steps.data[terms].tolist(), strict=True):
                    row[self.first_path + path] = -sign * int(factor)
                if unknown in ties:
                    rows.append(_difference(row, ties[unknown]))
                else:
                    ties[unknown] = row
        return ties, rows

    def _closures(self) -> list[Row]:
        rows: list[Row] = []
        for vertex, own, terms in self.seams.closures:
            parts = [(own, self.place[vertex])] if own else []
            parts += [(factor, self.first_path + 2 * path) for path, factor in terms.items()]
            rows += [
                {at: round(f.real) for f, at in parts if f.real}
                | {at + 1: -round(f.imag) for f, at in parts if f.imag},
                {at + 1: round(f.real) for f, at in parts if f.real} | {at: round(f.imag) for f, at in parts if f.imag},
            ]
        return [row for row in rows if row]

    def _gauge(self, tied: set[int]) -> tuple[list[int], list[Row]]:
        """Free unknowns that are held, and whole numbers that are zero, so that the map has one place."""
        if len(self.nodes):
            return [], [{0: 1}, {1: 1}]
        if any(self.graph.quarters[edge] for edge in self.graph.paths):
            return [], []  # it turns about a point of its own
        held, pins = [], []
        distance = ((self.frames.points - self.frames.centres.mean(0)) ** 2).sum(1)
        middle = int(np.argmin(np.where(self.frames.is_boundary, np.inf, distance)))
        for component in (0, 1):
            numbers = [number for number, run in enumerate(self.runs) if run.component == component]
            if numbers:
                pins.append({self.first_run + numbers[0]: 1})
            elif 2 * middle + component not in tied:
                held.append(2 * middle + component)
        return held, pins


def real_form(matrix: sp.csr_matrix) -> sp.csr_matrix:
    """A complex matrix on vectors of real and imaginary parts in turn."""
    block = sp.kron(matrix.real, np.eye(2)) + sp.kron(matrix.imag, np.array([[0.0, -1.0], [1.0, 0.0]]))
    result: sp.csr_matrix = sp.csr_matrix(block)
    result.eliminate_zeros()
    return result


def _difference(first: Row, second: Row) -> Row:
    total = dict(first)
    for unknown, value in second.items():
        total[unknown] = total.get(unknown, 0) - value
    return {unknown: value for unknown, value in total.items() if value}


def _sparse(entries: list[tuple[int, int, int]], shape: tuple[int, int]) -> sp.csr_matrix:
    rows, columns, values = zip(*entries, strict=True) if entries else ((), (), ())
    return sp.csr_matrix((np.asarray(values, float), (rows, columns)), shape=shape)
