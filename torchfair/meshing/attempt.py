"""One attempt at a mesh of a surface that is cut open: map, cells, and their verification."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..boundary import boundary_corners
from ..errors import MeshError
from ..fields.frames import Floats, Ints
from .boundary_cells import Compact, compact, tidy_boundary
from .boundary_runs import BoundaryRun, find_runs, inward_moves
from .crossings import off_the_lines
from .cut_graph import CutGraph
from .integers import split_integers
from .lattice import Lattice
from .seamless_map import MapProblem, SeamlessMap
from .seams import find_seams
from .settings import MeshingSettings
from .surface import DesignSurface
from .tracing import Cells, trace_cells
from .untangling import untangled
from .verification import shape_of, verified_topology

_ANISOTROPY = 30.0  # of the map: 1 triples the angles to directions, 300 wins little and stretches edges
_UNTANGLED = 3  # maps, the best first
_SHORTEST_RUN = 1.5  # spacings


@dataclass(frozen=True)
class Plan:
    """What one attempt does.

    Attributes:
        spacing: length of edges.
        smoothing: length over which directions are smoothed.
        align: whether boundary runs become lines.
    """

    spacing: float
    smoothing: float
    align: bool


class FailedAttemptError(MeshError):
    """No valid mesh came out of an attempt.

    Attributes:
        vertex: number of a vertex of the surface that was given where it went wrong, -1 if unknown.
        place: where that is.
    """

    def __init__(self, message: str, vertex: int = -1, place: Floats | None = None) -> None:
        super().__init__(message)
        self.vertex, self.place = vertex, place


@dataclass(frozen=True, eq=False)
class PieceMesh:
    """The mesh of one component.

    Attributes:
        positions: (N, 3).
        faces: nodes counterclockwise.
        rows: pairs of nodes, edges with the second coordinate constant.
        singular_places, singular_charges: of the field.
    """

    positions: Floats
    faces: list[list[int]]
    rows: set[tuple[int, int]]
    singular_places: Floats
    singular_charges: Ints


def attempt(
    surface: DesignSurface, graph: CutGraph, lattice: Lattice, plan: Plan, settings: MeshingSettings
) -> PieceMesh:
    """Meshes a component as planned, cut open with the field of the plan.

    Raises:
        FailedAttemptError: if that gives no valid mesh.
    """
    frames = surface.frames
    runs: list[BoundaryRun] = []
    if plan.align:
        shortest = _SHORTEST_RUN * plan.spacing
        runs = find_runs(frames, graph, settings.boundary_angle, shortest, lattice.aligned)
    corners = boundary_corners(surface.vertices, surface.topology, settings.corner_angle).numpy()
    found = _map(surface, graph, lattice, plan, runs)
    inward = inward_moves(found.seams, found.values, frames.triangles, runs)
    try:
        cells = trace_cells(found, off_the_lines(found, inward), corners)
        area = lattice.cell * plan.spacing**2
        whole = compact(tidy_boundary(cells, plan.spacing, area))
        verified_topology(whole.faces, len(whole.positions), shape_of(surface.topology))
    except MeshError as error:
        raise FailedAttemptError(str(error)) from None
    singular = np.flatnonzero(graph.charges)
    places, charges = frames.points[singular], graph.charges[singular]
    return PieceMesh(whole.positions, whole.faces, _rows(cells, whole), places, charges)


def _rows(cells: Cells, whole: Compact) -> set[tuple[int, int]]:
    """Pairs of nodes that are ends of an edge on a line with the second coordinate constant."""
    pairs = [
        (face[side], face[(side + 1) % len(face)])
        for face, on in zip(cells.faces, cells.coordinates, strict=True)
        for side in range(len(face))
        if on[side] == 1
    ]
    numbered = np.sort(whole.number[np.array(pairs, np.int64).reshape(-1, 2)], axis=1)
    return {(int(a), int(b)) for a, b in numbered if 0 <= a < b}


def _map(surface: DesignSurface, graph: CutGraph, lattice: Lattice, plan: Plan, runs: list[BoundaryRun]) -> SeamlessMap:
    """A map that is one to one near every point."""
    frames = surface.frames
    seams = find_seams(frames, graph)
    count = len(frames.triangles)
    problem = MapProblem(
        frames=frames,
        graph=graph,
        seams=seams,
        split=split_integers(frames, graph, seams, runs),
        shear=lattice.matrix,
        density=np.tile(1 / (plan.spacing * np.array(lattice.spacings)), (count, 1)),
        anisotropy=np.full(count, _ANISOTROPY),
    )
    best: SeamlessMap | None = None
    for candidate in problem.candidates()[:_UNTANGLED]:
        best = untangled(problem, candidate)
        if best.is_sound:
            return best
    assert best is not None
    vertices = best.branches if len(best.branches) else frames.triangles[best.flips[0]]
    raise _failure(surface, int(vertices[0]))


def _failure(surface: DesignSurface, vertex: int) -> FailedAttemptError:
    place = surface.frames.points[vertex]
    known = np.flatnonzero(surface.numbers.numpy() >= 0)
    nearest = known[np.argmin(((surface.frames.points[known] - place) ** 2).sum(1))]
    return FailedAttemptError("triangles are turned over", int(surface.numbers[nearest]), place)
