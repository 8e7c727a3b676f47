"""One attempt at a mesh of a surface that is cut open: map, cells, and their verification."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial import KDTree

from ..boundary import boundary_corners
from ..errors import MeshError
from ..fields.frames import Floats, Ints
from ..settings.meshing_settings import MeshingSettings
from .boundary_cells import Compact, compact, tidy_boundary
from .boundary_runs import BoundaryRun, find_runs
from .crease_runs import crease_lines
from .creases import Creases
from .cut_cells import cut_cells
from .cut_graph import CutGraph
from .integers import split_integers
from .lattice import Lattice
from .off_lines import off_the_lines
from .pose import Pose
from .relaxation import loosened, stretched
from .seamless_map import MapProblem, SeamlessMap, badness
from .seams import Seams, find_seams
from .surface import DesignSurface
from .tracing import Cells, trace_cells
from .untangling import is_hopeless, untangled
from .verification import shape_of, verified_topology, verify_corners, verify_creases

_ANISOTROPY = 30.0  # of the map: 1 triples the angles to directions, 300 wins little and stretches edges
_UNTANGLED = 2  # maps, the best first
_NEARLY = 16  # triangles turned over and branches that are left: with more no second map is tried
_SHORTEST_RUN = 1.5  # spacings
_APART = 1.5  # spacings
_MOST_TURN = math.radians(5.0)  # of edges of quads, where short ones are collapsed at the boundary


@dataclass(frozen=True)
class Plan:
    """What one attempt does.

    Attributes:
        spacing: length of edges.
        smoothing: length over which directions are smoothed.
        align: whether boundary runs and creases become lines.
        creases: whether they are kept.
        even: where positive, rows follow crosses, see :func:`even_crosses`: the weight of lengths in it.
        apart: (n, 3) places near which creases do not become lines.
    """

    spacing: float
    smoothing: float
    align: bool
    creases: bool = True
    even: float = 0.0
    apart: Floats = field(default_factory=lambda: np.zeros((0, 3)))


class FailedAttemptError(MeshError):
    """No valid mesh came out of an attempt.

    Attributes:
        vertex: number of a vertex of the surface that was given where it went wrong, -1 if unknown.
        place: where that is.
        hopeless: whether so much was wrong that a spacing a little different will not do, nor one crease less.
    """

    def __init__(self, message: str, vertex: int = -1, place: Floats | None = None, *, hopeless: bool = False) -> None:
        super().__init__(message)
        self.vertex, self.place, self.hopeless = vertex, place, hopeless


@dataclass(frozen=True, eq=False)
class PieceMesh:
    """The mesh of one component.

    Attributes:
        positions: (N, 3).
        faces: nodes counterclockwise; of lattices with rows triangles.
        rows: pairs of nodes, edges with the second coordinate constant.
        creases: (C, 2) nodes of the edges along creases.
        sharp: (n, 2, 3) ends of the edges of the surface that they stand for.
        singular_places, singular_charges: of the field.
    """

    positions: Floats
    faces: list[list[int]]
    rows: set[tuple[int, int]]
    creases: Ints
    sharp: Floats
    singular_places: Floats
    singular_charges: Ints

    def moved(self, pose: Pose) -> PieceMesh:
        """The same where the surface was before it was placed."""
        positions, places = pose.back(self.positions), pose.back(self.singular_places)
        sharp = pose.back(self.sharp.reshape(-1, 3)).reshape(self.sharp.shape)
        return replace(self, positions=positions, singular_places=places, sharp=sharp)


def attempt(
    surface: DesignSurface, creases: Creases, graph: CutGraph, lattice: Lattice, plan: Plan, settings: MeshingSettings
) -> PieceMesh:
    """Meshes a component with creases as planned, cut open with the field of the plan.

    Raises:
        FailedAttemptError: if that gives no valid mesh.
    """
    frames = surface.frames
    seams = find_seams(frames, graph)
    spacings = _spacings(surface, graph, plan)
    shortest, components = _SHORTEST_RUN * spacings.max(1), lattice.aligned if plan.align else ()
    far = creases.away_from(frames.points, plan.apart, _APART * plan.spacing)
    lines = crease_lines(frames, graph, seams, creases, far, settings.boundary_angle, shortest, components)
    graph = replace(graph, nodes=graph.nodes | lines.pinned)
    runs = find_runs(frames, graph, settings.boundary_angle, shortest, components) if settings.align_boundary else []
    corners = boundary_corners(surface.vertices, surface.topology, settings.corner_angle).numpy() | creases.corners
    found = _map(surface, graph, seams, lattice, spacings, [*runs, *itertools.chain(*lines.runs)])
    try:
        cells = trace_cells(found, off_the_lines(found, runs, lines), corners & ~graph.nodes, lines)
        near = spacings[KDTree(frames.centres).query(cells.positions)[1]] if surface.sizes else spacings[:1]
        most = math.inf if lattice.has_rows else _MOST_TURN
        whole = compact(tidy_boundary(cells, near.min(1), lattice.cell * near.prod(1), most))
        faces, size, shape = whole.faces, len(whole.positions), shape_of(surface.topology)
        verify_creases(verified_topology(faces, size, shape), whole.creases, creases)
        rows = _rows(cells, whole)
        if lattice.has_rows:
            faces = cut_cells(whole.positions, faces, rows)
            verified_topology(faces, size, shape)
        verify_corners(whole.positions, faces)
    except MeshError as error:
        raise FailedAttemptError(str(error)) from None
    singular = np.flatnonzero(graph.charges)
    places, charges = frames.points[singular], graph.charges[singular]
    sharp = frames.points[frames.edges[creases.edges]]
    return PieceMesh(whole.positions, faces, rows, whole.creases, sharp, places, charges)


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


def _spacings(surface: DesignSurface, graph: CutGraph, plan: Plan) -> Floats:
    """(F, 2) lengths of edges along the field and across, but for those of the lattice."""
    if surface.sizes is None:
        return np.full((len(surface.frames.areas), 2), plan.spacing)
    return np.asarray(plan.spacing * np.exp(surface.sizes.along(graph.angles)))


def _map(
    surface: DesignSurface, graph: CutGraph, seams: Seams, lattice: Lattice, spacings: Floats, runs: list[BoundaryRun]
) -> SeamlessMap:
    """A map that is one to one near every point."""
    frames = surface.frames
    count = len(frames.triangles)
    problem = MapProblem(
        frames=frames,
        graph=graph,
        seams=seams,
        split=split_integers(frames, graph, seams, runs),
        shear=lattice.matrix,
        density=1 / (spacings * lattice.spacings),
        anisotropy=np.full(count, _ANISOTROPY),
    )
    wanted, problem = problem.density, stretched(problem)
    best = _untangled(problem)
    if not best.is_sound and not is_hopeless(best) and (looser := loosened(problem, wanted)) is not problem:
        best = _untangled(looser)
    if best.is_sound:
        return best
    vertices = best.branches if len(best.branches) else frames.triangles[best.flips[0]]
    raise _failure(surface, int(vertices[0]), is_hopeless(best))


def _untangled(problem: MapProblem) -> SeamlessMap:
    """The first map that is one to one near every point, or the last that was tried; a hopeless one as it is."""
    candidates = problem.candidates()
    found = candidates[0]
    tried: list[SeamlessMap] = []
    for candidate in [] if is_hopeless(found) else candidates[:_UNTANGLED]:
        if any(np.array_equal(candidate.flips, other.flips) for other in tried):
            continue  # whole numbers far from what is turned over change nothing there
        tried.append(candidate)
        found = untangled(problem, candidate)
        if found.is_sound or badness(found)[0] > _NEARLY:
            break
    return found


def _failure(surface: DesignSurface, vertex: int, hopeless: bool) -> FailedAttemptError:
    place = surface.frames.points[vertex]
    known = np.flatnonzero(surface.numbers.numpy() >= 0)
    nearest = known[np.argmin(((surface.frames.points[known] - place) ** 2).sum(1))]
    return FailedAttemptError("triangles are turned over", int(surface.numbers[nearest]), place, hopeless=hopeless)
