"""A seamless map that is one to one, by those that are tried one after the other."""

from __future__ import annotations

import numpy as np

from ..fields.frames import Floats
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
_MOST_WHOLE = 1000  # whole numbers: the nearest ones are searched for with dense matrices of that size


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
            corners of creases are to be kept than a mesh of that spacing has vertices, or a search ends in time for.
    """
    frames = surface.frames
    count = len(frames.triangles)
    split = split_integers(frames, graph, seams, runs)
    density = 1 / (spacings * lattice.spacings)
    _check_room(int(graph.nodes.sum()), float(frames.areas @ density.prod(1)), split.basis.shape[1])
    problem = MapProblem(
        frames=frames,
        graph=graph,
        seams=seams,
        split=split,
        shear=lattice.matrix,
        density=density,
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


def _check_room(nodes: int, cells: float, whole: int) -> None:
    """Raises a hopeless :class:`FailedAttemptError` where nodes do not find room in cells, or are too many to round."""
    found = f"the surface has {nodes} singular points and corners of creases"
    if nodes > _ROOM * max(cells, 1.0) + _FEW:
        raise FailedAttemptError(f"{found}, too many for {cells:.0f} cells", hopeless=True)
    if whole > _MOST_WHOLE:
        words = f"{found}, {whole} whole numbers together, more than {_MOST_WHOLE}"
        raise FailedAttemptError(words, hopeless=True)


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
