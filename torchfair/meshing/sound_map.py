"""A seamless map that is one to one, by those that are tried one after the other."""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from ..fields.frames import Floats, Ints
from .boundary_runs import BoundaryRun
from .cut_graph import CutGraph
from .failed_attempt import FailedAttemptError
from .integers import split_integers
from .lattice import Lattice
from .relaxation import loosened, stretched
from .seamless_map import MapProblem, SeamlessMap, badness
from .seams import Seams
from .surface import DesignSurface
from .untangling import is_hopeless, untangled

_ANISOTROPY = 30.0  # of the map: 1 triples the angles to directions, 300 wins little and stretches edges
_UNTANGLED = 2  # maps, the best first
_NEARLY = 16  # triangles turned over and branches that are left: with more no second map is tried
_ROOM = 2.0  # singular points and corners of creases over the cells asked for: each lies on a point of its own
_FEW = 50  # of them are tried however few cells there are
_MOST_WHOLE = 2000  # whole numbers: the nearest ones are searched for with dense matrices of that size


def sound_map(
    surface: DesignSurface,
    graph: CutGraph,
    seams: Seams,
    lattice: Lattice,
    spacings: Floats,
    runs: list[BoundaryRun],
) -> SeamlessMap:
    """A map that is one to one near every point.

    Args:
        surface: that is mapped.
        graph: where it is cut open, with its field.
        seams: what the cut makes of its corners.
        lattice: of the plane.
        spacings: (F, 2) lengths of edges along the field and across, but for those of the lattice.
        runs: of the boundary and of creases, that become lines.

    Raises:
        FailedAttemptError: if triangles stay turned over, with the place; or at once, where more singular points and
            corners of creases are to be kept than such a mesh has room for, or a search would not end.
    """
    frames = surface.frames
    count = len(frames.triangles)
    split = split_integers(frames, graph, seams, runs)
    density = 1 / (spacings * lattice.spacings)
    nodes = np.flatnonzero(graph.nodes)
    crowd = _too_many(len(nodes), float(frames.areas @ density.prod(1)), split.basis.shape[1])
    if crowd:
        if not len(nodes):
            raise FailedAttemptError(crowd, hopeless=True)
        raise _failure(surface, _densest(frames.points, nodes), crowd, hopeless=True)
    problem = MapProblem(
        frames=frames,
        graph=graph,
        seams=seams,
        split=split,
        shear=lattice.matrix,
        density=density,
        anisotropy=np.full(count, _ANISOTROPY),
    )
    problem = stretched(problem)
    best = _untangled(problem)
    if not best.is_sound and not is_hopeless(best) and (looser := loosened(problem, density)) is not problem:
        best = _untangled(looser)
    if best.is_sound:
        return best
    vertices = best.branches if len(best.branches) else frames.triangles[best.flips[0]]
    raise _failure(surface, int(vertices[0]), "triangles are turned over", hopeless=is_hopeless(best))


def _too_many(nodes: int, cells: float, whole: int) -> str:
    """In words that nodes do not find room in cells, or are too many to be rounded together; empty where they do."""
    if nodes > _ROOM * cells + _FEW:
        return f"the surface has {nodes} singular points and corners of creases, too many for {cells:.0f} cells"
    if whole > _MOST_WHOLE:
        return f"{whole} whole numbers are to be found for singular points, creases and holes, more than {_MOST_WHOLE}"
    return ""


def _densest(points: Floats, nodes: Ints) -> int:
    """The node that is nearest to another; one alone is that one."""
    if len(nodes) == 1:
        return int(nodes[0])
    gaps = np.asarray(KDTree(points[nodes]).query(points[nodes], 2)[0])
    return int(nodes[np.argmin(gaps[:, 1])])


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


def _failure(surface: DesignSurface, vertex: int, words: str, *, hopeless: bool) -> FailedAttemptError:
    place = surface.frames.points[vertex]
    known = np.flatnonzero(surface.numbers.numpy() >= 0)
    nearest = known[np.argmin(((surface.frames.points[known] - place) ** 2).sum(1))]
    return FailedAttemptError(words, int(surface.numbers[nearest]), place, hopeless=hopeless)
