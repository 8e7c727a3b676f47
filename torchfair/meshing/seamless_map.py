"""A map to the plane whose lines of whole numbers follow the field and fit together over the cuts."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from ..fields.frames import FaceFrames, Floats, Ints
from ..fields.matchings import QUARTER
from ..linear import LinearSolver, RslabDirect, ScipyDirect
from .cut_graph import CutGraph
from .integers import IntegerSplit, real_form
from .seams import ROTATIONS, Seams
from .separation import gaps, separate_vectors
from .whole_optimum import WholeOptimum, real_optimum, whole_optimum

WANTED = np.array([1.0, 0.0, 0.0, 1.0])
"""Jacobian of a map as wanted: gradients of the first coordinate along and across the field, then of the second."""

_TRIED = 16  # whole vectors, until no triangle is turned over
_NEAR = 2.5  # spacings: singular vertices within that are kept apart
_THIN = 0.05  # of the area wanted, below which triangles are counted as nearly turned over


@dataclass(frozen=True, eq=False)
class SeamlessMap:
    """Coordinates of a mesh in which the lines of whole numbers are the lines of the new mesh.

    Attributes:
        frames, graph, seams: the mesh, cut open.
        values: (N,) complex coordinates of copies; whole at singular vertices.
        areas: (F,) of the triangles in the plane, over those wanted; negative where turned over.
    """

    frames: FaceFrames
    graph: CutGraph
    seams: Seams
    values: np.ndarray
    areas: Floats

    @property
    def flips(self) -> Ints:
        """Numbers of the triangles that are turned over or have no area."""
        return np.flatnonzero(self.areas <= 1e-9)

    @property
    def is_sound(self) -> bool:
        """Whether the map is one to one near every point."""
        return not len(self.flips) and not len(self.branches)

    @cached_property
    def branches(self) -> Ints:
        """Numbers of the inner vertices around which the plane is not covered as often as their index says."""
        around = self.values[self.seams.copies]
        ahead = np.roll(around, -1, axis=1) - around
        angles = np.angle(-np.roll(ahead, 1, axis=1) * ahead.conj())
        total = np.bincount(self.frames.triangles.ravel(), angles.ravel(), len(self.frames.points))
        off = np.abs(total / QUARTER - (4 - self.graph.charges)) > 0.5
        return np.flatnonzero(off & ~self.frames.is_boundary & (self.frames.topology.valences.numpy() > 0))

    @cached_property
    def translations(self) -> np.ndarray:
        """(I,) complex whole translations over the cut edges, 0 elsewhere."""
        copies, (f, g), (i, j) = self.seams.copies, self.frames.faces.T, self.frames.corners.T
        turn = np.array(ROTATIONS)[self.graph.quarters]
        steps = self.values[copies[g, (j + 1) % 3]] - turn * self.values[copies[f, i]]
        return np.where(self.graph.cut, np.rint(steps.real) + 1j * np.rint(steps.imag), 0)


def _direct() -> LinearSolver:
    return RslabDirect(mixed=False) if RslabDirect.available() else ScipyDirect()


@dataclass(frozen=True, eq=False)
class MapProblem:
    """Least squares for the gradients of a seamless map, factorised once.

    Attributes:
        frames, graph, seams, split: the mesh, cut open, and its unknowns.
        shear: (2, 2) from whole coordinates to those whose gradients follow the field.
        density: (F, 2) gradients wanted along and across the field, one over lengths.
        anisotropy: (F,) weight of the wrong direction of gradients over that of their lengths.
        solver, real_solver: for free values, and for all where whole numbers may be any; they keep their analysis from
            one problem to the next that differs in density and weights only. Both factor in double precision: one has
            as many right-hand sides as there are whole numbers, the other is nearly singular.
    """

    frames: FaceFrames
    graph: CutGraph
    seams: Seams
    split: IntegerSplit
    shear: Floats
    density: Floats
    anisotropy: Floats
    solver: LinearSolver = field(default_factory=_direct)
    real_solver: LinearSolver = field(default_factory=_direct)

    def candidates(self) -> list[SeamlessMap]:
        """Maps with whole numbers near the real optimum, the best first: less turned over, then nearer.

        There is one only if it has nothing turned over.
        """
        optimum = self._optimum
        if not len(optimum.target):
            return [self.map_of(optimum.parts(optimum.target))]
        near = _NEAR * float(np.median(self.density.prod(1))) ** -0.5
        between = real_form(gaps(self.frames, self.graph, self.seams, near))
        rows, offsets = optimum.seen_by(between)
        found = []
        for vector in separate_vectors(optimum.metric, optimum.target, rows, offsets)[:_TRIED]:
            found.append(self.map_of(optimum.parts(vector)))
            if found[-1].is_sound:
                return [found[-1]]
        return sorted(found, key=badness)

    @cached_property
    def real_jacobians(self) -> Floats:
        """(4, F) of the optimum whose whole numbers may be any numbers, rows as in :meth:`jacobians`."""
        parts = real_optimum(*self._rows(), self.split, self.real_solver)
        return np.asarray(self.jacobians(np.arange(len(self.density))) @ parts).reshape(4, -1)

    @cached_property
    def _optimum(self) -> WholeOptimum:
        return whole_optimum(*self._rows(), self.split, self.solver)

    def map_of(self, parts: Floats) -> SeamlessMap:
        """The map whose copies have real and imaginary parts (2N,) in turn."""
        values = parts[::2] + 1j * parts[1::2]
        at_singular = self.graph.nodes[self.seams.vertex]
        values[at_singular] = np.rint(values[at_singular].real) + 1j * np.rint(values[at_singular].imag)
        return SeamlessMap(self.frames, self.graph, self.seams, values, self.relative_areas(values))

    def relative_areas(self, values: np.ndarray) -> Floats:
        """(F,) signed areas of triangles in the plane over those wanted."""
        a, b, c = values[self.seams.copies].T
        doubled = ((b - a).conj() * (c - a)).imag * np.linalg.det(self.shear)
        return np.asarray(doubled / (2 * self.frames.areas * self.density.prod(1)))

    def _rows(self) -> tuple[sp.csr_matrix, Floats]:
        """Least squares of the Jacobians of all faces."""
        faces = np.arange(len(self.density))
        weights = np.sqrt(self.frames.areas / self.frames.areas.mean() * self.weights(faces))
        return (sp.diags(weights.ravel()) @ self.jacobians(faces)).tocsr(), (weights * WANTED[:, None]).ravel()

    def weights(self, faces: Ints) -> Floats:
        """(4, n) of the rows of :meth:`jacobians`: those of wrong directions over those of wrong lengths."""
        one, other = np.ones(len(faces)), self.anisotropy[faces]
        return np.stack([one, other, other, one])

    def jacobians(self, faces: Ints) -> sp.csr_matrix:
        """(4n, 2N) gradients over those wanted: of the first coordinate along and across, then of the second."""
        count = len(faces)
        turned = self.frames.gradients[faces] * np.exp(-1j * self.graph.angles[faces])[:, None]
        face, corner = np.repeat(np.arange(count), 3), self.seams.copies[faces].ravel()
        entries = []
        for row, coordinate in enumerate((0, 0, 1, 1)):
            part = turned.imag if row % 2 else turned.real
            scaled = part / self.density[faces, coordinate][:, None]
            for k in np.flatnonzero(self.shear[coordinate]):
                entries.append((row * count + face, 2 * corner + k, (scaled * self.shear[coordinate, k]).ravel()))
        rows, columns, values = (np.concatenate(part) for part in zip(*entries, strict=True))
        return sp.csr_matrix((values, (rows, columns)), shape=(4 * count, 2 * len(self.seams.vertex)))


def badness(found: SeamlessMap) -> tuple[int, float]:
    """How far a map is from one to one near every point: triangles turned over and branches, then thin ones."""
    return len(found.flips) + len(found.branches), float(np.maximum(_THIN - found.areas, 0).sum())
