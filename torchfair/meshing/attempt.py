"""One attempt at a mesh of a surface that is cut open: map, cells, and their verification."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
from scipy.spatial import KDTree

from ..boundary import boundary_corners
from ..errors import MeshError
from ..fields.frames import Floats
from ..settings.meshing_settings import MeshingSettings
from .boundary_cells import Compact, compact, tidy_boundary
from .boundary_runs import find_runs
from .crease_runs import crease_lines
from .creases import Creases
from .cut_cells import cut_cells
from .cut_graph import CutGraph
from .failed_attempt import FailedAttemptError
from .lattice import Lattice
from .off_lines import off_the_lines
from .piece_mesh import PieceMesh
from .plan import Plan
from .seams import find_seams
from .slit_faces import without_slits
from .sound_map import sound_map
from .surface import DesignSurface
from .tracing import Cells, trace_cells
from .verification import shape_of, verified_topology, verify_corners, verify_creases

_SHORTEST_RUN = 1.5  # spacings
_APART = 1.5  # spacings
_MOST_TURN = math.radians(5.0)  # of edges of quads, where short ones are collapsed at the boundary


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
    found = sound_map(surface, graph, seams, lattice, spacings, [*runs, *itertools.chain(*lines.runs)])
    try:
        cells = trace_cells(found, off_the_lines(found, runs, lines), corners & ~graph.nodes, lines)
        near = spacings[KDTree(frames.centres).query(cells.positions)[1]] if surface.sizes else spacings[:1]
        most = math.inf if lattice.has_rows else _MOST_TURN
        whole = compact(tidy_boundary(cells, near.min(1), lattice.cell * near.prod(1), most))
        faces, size, shape = whole.faces, len(whole.positions), shape_of(surface.topology)
        verify_creases(verified_topology(faces, size, shape), whole.creases, creases)
        rows = _rows(cells, whole)
        cut = cut_cells(whole.positions, faces, rows) if lattice.has_rows else without_slits(whole.positions, faces)
        if cut is not faces:
            verified_topology(cut, size, shape)
        verify_corners(whole.positions, cut)
    except MeshError as error:
        raise FailedAttemptError(str(error)) from None
    singular = np.flatnonzero(graph.charges)
    places, charges = frames.points[singular], graph.charges[singular]
    sharp = frames.points[frames.edges[creases.edges]]
    return PieceMesh(whole.positions, cut, rows, whole.creases, sharp, places, charges)


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
