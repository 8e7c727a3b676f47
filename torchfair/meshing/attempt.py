"""One attempt at a mesh: field, cut, map, cells, and their verification."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..boundary import boundary_corners
from ..errors import MeshError
from ..fields import Directions, direction_field, matchings, merge_singularities, vertex_charges
from ..fields.frames import Floats, Ints
from .boundary_cells import compact, tidy_boundary
from .boundary_runs import BoundaryRun, find_runs, inward_moves
from .crossings import off_the_lines
from .cut_graph import CutGraph, cut_open
from .integers import split_integers
from .lattice import Lattice
from .seamless_map import MapProblem, SeamlessMap
from .seams import find_seams
from .settings import MeshingSettings
from .surface import DesignSurface
from .tracing import trace_cells
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
        singular_places, singular_charges: of the field.
    """

    positions: Floats
    faces: list[list[int]]
    singular_places: Floats
    singular_charges: Ints


def attempt(
    surface: DesignSurface, directions: Directions, lattice: Lattice, plan: Plan, settings: MeshingSettings
) -> PieceMesh:
    """Meshes a component as planned.

    Raises:
        FailedAttemptError: if that gives no valid mesh.
    """
    frames = surface.frames
    angles = direction_field(frames, directions, plan.smoothing, lattice.symmetry)
    matched = matchings(frames, angles, lattice.symmetry)
    if lattice.symmetry == 4:
        radius = settings.merging * plan.spacing
        angles, matched = merge_singularities(frames, angles, matched, directions, plan.smoothing, radius)
    charges = vertex_charges(frames, angles, matched)
    graph = cut_open(frames, angles, matched, charges)
    runs = find_runs(frames, graph, settings.boundary_angle, _SHORTEST_RUN * plan.spacing) if plan.align else []
    corners = boundary_corners(surface.vertices, surface.topology, settings.corner_angle).numpy()
    found = _map(surface, graph, lattice, plan, runs)
    inward = inward_moves(found.seams, found.values, frames.triangles, runs)
    try:
        cells = trace_cells(found, off_the_lines(found, inward), corners)
        area = lattice.cell * plan.spacing**2
        positions, faces = compact(*tidy_boundary(cells, plan.spacing, area))
        verified_topology(faces, len(positions), shape_of(surface.topology))
    except FailedAttemptError:
        raise
    except MeshError as error:
        raise FailedAttemptError(str(error)) from None
    singular = np.flatnonzero(charges)
    return PieceMesh(positions, faces, frames.points[singular], charges[singular])


def _map(surface: DesignSurface, graph: CutGraph, lattice: Lattice, plan: Plan, runs: list[BoundaryRun]) -> SeamlessMap:
    """A map that is one to one near every point."""
    frames = surface.frames
    seams = find_seams(frames, graph)
    count = len(frames.triangles)
    problem = MapProblem(
        frames=frames,
        graph=graph,
        seams=seams,
        split=split_integers(frames, graph, seams, runs, 0.5 + 0.5j),
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
