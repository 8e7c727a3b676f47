"""Start surfaces from boundary curves alone: a disk in one curve, an annulus between two, more holes between more."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import torch
from torch import Tensor

from ...boundary import boundary_turning
from ...curves import ClosedCurve
from ...errors import MeshError
from ...geometry import corner_angles, dihedral_angles, face_area_vectors
from ...self_intersections import self_intersections
from ...topology import Topology
from .starting.lattices import hexagonal_disk, staggered_annulus
from .starting.patch import Patch
from .starting.rims import refuse_crossing_rims
from .starting.spanning import spanning_patches

_LEAST_ANGLE = math.radians(15.0)  # of a start
_STEEPEST = math.radians(100.0)  # between neighbouring faces
_COUNT = 0.1  # relative


class _Start(NamedTuple):
    vertices: Tensor
    topology: Topology
    regular: bool


def start_surface(curves: Sequence[ClosedCurve], count: int = 1000) -> tuple[Tensor, Topology]:
    """A triangle mesh of about ``count`` vertices between given boundary curves, without folds where that can be.

    Regular triangles where they do: in one curve a disk around a centre, all inner vertices of valence 6; between two
    an annulus of staggered rows, the second curve either way round. Where faces of these would turn over, be flat, or
    run through each other, even triangles: over the plan, if the curves are seen from somewhere without crossings
    (curves inside others are holes there, and no part of the mesh can meet another one); on the surface of least area
    between points of the rim (one curve); on the band of least area (two); on the convex hull (several). Boundary
    vertices are evenly spaced, more closely where the rim is narrow, corners among them.

    No angle is below 15 degrees, or half the sharpest corner of a rim, where a way is found to that; otherwise it is
    the best that is found. That may run through itself, as where a rim is a knot: see
    :func:`~torchfair.self_intersections.self_intersections`; jobs that start from it say so.

    Args:
        curves: Closed curves that do not meet.
        count: Wanted number of vertices, met within a tenth unless the rims need more.

    Returns:
        vertices (V, 3) float64, topology. Faces run counterclockwise with the first curve, so normals of a disk
        point to where that is seen to run counterclockwise.

    Raises:
        MeshError: no curve, a count below 7, curves that cross, touch or repeat themselves or each other, or no
            surface is found.

    Example:
        >>> import math
        >>> import torch
        >>> from torchfair.curves import ClosedCurve
        >>> from torchfair.formfinding import start_surface
        >>> turn = torch.linspace(0, 2 * math.pi, 25)[:-1].double()
        >>> curve = ClosedCurve(torch.stack([turn.cos(), turn.sin(), 0.3 * torch.cos(2 * turn)], dim=1))
        >>> vertices, topology = start_surface([curve], 60)
        >>> topology.loop_offsets.tolist()[-1] == int(topology.is_boundary_vertex.sum())
        True
    """
    if count < 7:
        raise MeshError(f"a start surface needs at least 7 vertices, got count = {count}")
    if not curves:
        raise MeshError("a start surface is made from one boundary curve or several, got none: give curves, or a mesh")
    refuse_crossing_rims(curves)
    best, least = None, -math.inf
    for start in _candidates(curves, count):
        worth = _worth(start, count)
        if worth >= 1.0:
            return start.vertices, start.topology
        if worth > least:
            best, least = start, worth
    if best is None:
        raise MeshError(
            f"no start surface is found between these {len(curves)} curves: they are neither seen from one side "
            "without crossings nor on a common convex hull. Give a mesh to start from"
        )
    return best.vertices, best.topology


def _candidates(curves: Sequence[ClosedCurve], count: int) -> Iterator[_Start]:
    if len(curves) == 1:
        yield _Start(*hexagonal_disk(curves[0], count), True)
    elif len(curves) == 2:
        yield _Start(*staggered_annulus(curves[0], curves[1], count), True)
    for patch in spanning_patches(curves, count):
        yield _Start(torch.from_numpy(patch.points), _oriented(patch), False)


def _oriented(patch: Patch) -> Topology:
    """Faces that have the edges of the first curve in its direction."""
    faces = torch.from_numpy(patch.faces)
    on_rim = torch.from_numpy(patch.rims == 0)
    topology = Topology.from_faces(faces, len(patch.points))
    parameters = torch.from_numpy(patch.parameters)
    for loop in topology.boundary_loops():
        if bool(on_rim[loop[0]]):
            ahead = torch.remainder(parameters[loop.roll(-1)] - parameters[loop] + 0.5, 1.0) - 0.5
            return topology if float(ahead.sum()) > 0.0 else Topology.from_faces(faces.flip(1), len(patch.points))
    return topology


def _worth(start: _Start, count: int) -> float:
    """At least 1 for a start that will do, less for others, the less the worse."""
    vertices, topology, regular = start
    sharpest = math.pi - float(boundary_turning(vertices, topology).max())  # no triangle there has a larger angle
    wanted = min(_LEAST_ANGLE, 0.5 * sharpest)
    worth = min(1.0, float(corner_angles(vertices, topology).min()) / wanted)
    if regular and abs(topology.num_vertices / count - 1.0) > _COUNT:
        worth = min(worth, 0.9)
    if regular and _seen_from_one_side(vertices, topology):
        return worth
    steepest = float(dihedral_angles(vertices, topology).abs().max()) if topology.num_interior_edges else 0.0
    worth = min(worth, 1.0 - (steepest - _STEEPEST)) if steepest > _STEEPEST else worth
    return worth - 1.0 if len(self_intersections(vertices, topology)) else worth


def _seen_from_one_side(vertices: Tensor, topology: Topology) -> bool:
    """Whether no face of a disk turns over as it is seen along its area vector: then none meets another one."""
    areas = face_area_vectors(vertices, topology)
    return len(topology.boundary_loops()) == 1 and bool((areas @ areas.sum(0) > 0.0).all())
