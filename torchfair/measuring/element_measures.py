"""What single panels and edges measure, for tables and lists of the worst."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import torch
from torch import Tensor

from .. import geometry
from .._one_mesh import one_mesh
from .._ranges import ranges
from .._remembered import remembering
from ..energies import angle_variation_per_edge
from ..errors import ShapeError
from ..settings.fair_settings import FairSettings
from ..topology import Topology

PLANAR = FairSettings.planar_tolerance
"""Planarity below which a panel is called planar: what the job that lowers E keeps planar by default."""
NEARLY_PLANAR = FairSettings.planar_reach
"""Planarity below which a panel is called nearly planar: what that job does not make less planar."""
_CREASE = FairSettings.crease_angle
_FLAT = math.radians(0.01)


@dataclass(frozen=True)
class PanelMeasures:
    """One face.

    Attributes:
        face: its number in the topology.
        vertices: numbers of its corners.
        position: mean of its corners, in the unit of the vertices.
        area: in the square of that unit.
        planarity: largest distance of its diagonals over its mean edge, see :func:`torchfair.geometry.planarity`.
        longest_edge: in the unit of the vertices.
        largest_kink_degrees: largest angle to the normal of a neighbour, without sign; None without neighbours.
        kind: ``"triangle"``, ``"planar"`` (planarity below 1e-3), ``"nearly planar"`` (below 5e-3), ``"warped"``, or
            ``"no area"``.
    """

    face: int
    vertices: tuple[int, ...]
    position: tuple[float, float, float]
    area: float
    planarity: float
    longest_edge: float
    largest_kink_degrees: float | None
    kind: str


@dataclass(frozen=True)
class EdgeMeasures:
    """One edge.

    Attributes:
        edge: its number in the topology.
        vertices: numbers of its ends.
        position: its middle, in the unit of the vertices.
        length: in the unit of the vertices.
        dihedral_angle_degrees: signed, positive where convex; None on the boundary.
        angle_variation: ``l |a|``, in the unit of the vertices; None on the boundary.
        kind: ``"boundary"``, ``"flat"`` (below 0.01 degrees), ``"crease"`` (above 40 degrees), ``"convex"`` or
            ``"concave"``.
    """

    edge: int
    vertices: tuple[int, int]
    position: tuple[float, float, float]
    length: float
    dihedral_angle_degrees: float | None
    angle_variation: float | None
    kind: str


def panel_measures(vertices: Tensor, topology: Topology, faces: Tensor | None = None) -> list[PanelMeasures]:
    """Measures of faces, all of them in their order by default.

    Args:
        vertices: positions ``(V, 3)`` in any length unit.
        topology: connectivity; any polygons, mixed.
        faces: ``(n,)`` numbers of faces.

    Raises:
        ShapeError: if ``vertices`` are not one mesh that fits the topology.
    """
    vertices = one_mesh(vertices, topology)
    chosen = torch.arange(topology.num_faces) if faces is None else faces.cpu()
    if not len(chosen):
        return []
    kinks = _largest_kinks(vertices, topology)
    warps = geometry.planarity(vertices, topology)
    longest = vertices.new_zeros(topology.num_faces).scatter_reduce(
        0, topology.corner_faces, geometry.edge_lengths(vertices, topology)[topology.corner_edges], "amax"
    )
    columns = (geometry.face_areas(vertices, topology), warps, longest, kinks)
    numbers = torch.stack(columns, dim=1).cpu()[chosen].tolist()
    centres = geometry.face_centres(vertices, topology).cpu()[chosen].tolist()
    degenerate = geometry.degenerate_faces(vertices, topology).cpu()[chosen].tolist()
    starts, sizes = (part.cpu()[chosen].numpy() for part in (topology.face_offsets[:-1], topology.face_sizes))
    corners = iter(topology.corners.cpu().numpy()[ranges(starts, sizes)].tolist())
    rings = [tuple(itertools.islice(corners, size)) for size in sizes.tolist()]
    rows = []
    for face, ring, place, (area, warp, edge, kink), flat in zip(
        chosen.tolist(), rings, centres, numbers, degenerate, strict=True
    ):
        kind = "no area" if flat else _panel_kind(len(ring), warp)
        angle = None if kink < 0 else math.degrees(kink)
        rows.append(PanelMeasures(face, ring, (place[0], place[1], place[2]), area, warp, edge, angle, kind))
    return rows


def edge_measures(vertices: Tensor, topology: Topology, edges: Tensor | None = None) -> list[EdgeMeasures]:
    """Measures of edges, all of them in their order by default: interior ones first.

    Args:
        vertices: positions ``(V, 3)`` in any length unit.
        topology: connectivity; any polygons, mixed.
        edges: ``(n,)`` numbers of edges.

    Raises:
        ShapeError: if ``vertices`` are not one mesh that fits the topology.
    """
    vertices = one_mesh(vertices, topology)
    chosen = torch.arange(topology.num_edges) if edges is None else edges.cpu()
    lengths = geometry.edge_lengths(vertices, topology).cpu()
    angles = torch.full_like(lengths, math.nan)
    angles[: topology.num_interior_edges] = geometry.dihedral_angles(vertices, topology).cpu()
    ends = topology.edges.cpu()[chosen]
    middles = vertices.cpu()[ends].mean(1).tolist()
    rows = []
    for edge, pair, place, length, angle in zip(
        chosen.tolist(), ends.tolist(), middles, lengths[chosen].tolist(), angles[chosen].tolist(), strict=True
    ):
        inner = edge < topology.num_interior_edges
        degrees, bend = (math.degrees(angle), length * abs(angle)) if inner else (None, None)
        place3 = (place[0], place[1], place[2])
        rows.append(EdgeMeasures(edge, (pair[0], pair[1]), place3, length, degrees, bend, _edge_kind(angle, inner)))
    return rows


def worst_edges(vertices: Tensor, topology: Topology, count: int) -> list[EdgeMeasures]:
    """The ``count`` interior edges with the largest ``l |a|``, largest first, ties by edge number.

    Args:
        vertices: positions ``(V, 3)`` in any length unit.
        topology: connectivity; any polygons, mixed.
        count: at most so many, 0 or more.

    Raises:
        ShapeError: if ``vertices`` are not one mesh that fits the topology, or ``count`` is negative.
    """
    vertices = one_mesh(vertices, topology)
    with remembering():
        return edge_measures(vertices, topology, _largest(angle_variation_per_edge(vertices, topology), count))


def worst_panels(vertices: Tensor, topology: Topology, count: int) -> list[PanelMeasures]:
    """The ``count`` polygons that are farthest from planar, the worst first; those that are planar are left out.

    Args:
        vertices: positions ``(V, 3)`` in any length unit.
        topology: connectivity; any polygons, mixed.
        count: at most so many, 0 or more.

    Raises:
        ShapeError: if ``vertices`` are not one mesh that fits the topology, or ``count`` is negative.
    """
    vertices = one_mesh(vertices, topology)
    with remembering():
        warps = geometry.planarity(vertices, topology)
        order = _largest(warps, count)
        return panel_measures(vertices, topology, order[warps[order] >= PLANAR])


def _largest(values: Tensor, count: int) -> Tensor:
    """Numbers of the ``count`` largest values, the largest first, equal ones by their numbers."""
    if count < 0:
        raise ShapeError("count", "0 or more", count)
    if 0 < count < len(values):  # sorted are only those among which the largest are
        least = values.topk(count).values[-1]
        some = torch.nonzero(~(values < least)).squeeze(1)  # NaN counts as large
        return some[values[some].argsort(descending=True, stable=True)[:count]]
    return values.argsort(descending=True, stable=True)[:count]


def _largest_kinks(vertices: Tensor, topology: Topology) -> Tensor:
    """(F,) largest angle without sign at an interior edge of each face, -1 where there is none."""
    angles = geometry.dihedral_angles(vertices, topology).abs()
    left, right = topology.interior_edge_faces.unbind(1)
    kinks = vertices.new_full((topology.num_faces,), -1.0)
    return kinks.scatter_reduce(0, left, angles, "amax").scatter_reduce(0, right, angles, "amax")


def _panel_kind(corners: int, planarity: float) -> str:
    if corners == 3:
        return "triangle"
    return "planar" if planarity < PLANAR else "nearly planar" if planarity < NEARLY_PLANAR else "warped"


def _edge_kind(angle: float, inner: bool) -> str:
    if not inner:
        return "boundary"
    if abs(angle) > _CREASE:
        return "crease"
    return "flat" if abs(angle) < _FLAT else "convex" if angle > 0 else "concave"
