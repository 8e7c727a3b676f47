"""Everything that ``torchfair measure`` says about a mesh."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import torch
from torch import Tensor

from .. import energies, geometry
from ..geometry.planarity import planarity
from ..topology import Topology

LENGTH = "length units of the file"
AREA = "square length units of the file"
PER_LENGTH = "1 / length unit of the file"
DEGREES = "degrees"
NUMBER = "dimensionless"

_ENERGIES = {
    "normal_variation": ("E   normal variation       sum l l*", LENGTH),
    "angle_variation": ("E'  angle variation        sum l |a|", LENGTH),
    "total_mean_curvature": ("    total mean curvature   1/2 sum l a", LENGTH),
    "total_absolute_curvature": ("C   absolute curvature     sum |k1| + |k2|", LENGTH),
    "total_absolute_curvature_corrected": ("C   the same, corrected    by vertex normals", LENGTH),
    "total_frobenius_curvature": ("C2  Frobenius curvature    sum sqrt(k1^2 + k2^2)", LENGTH),
    "umbrella_fairness": ("    umbrella fairness", AREA),
    "polyline_fairness": ("    polyline fairness", AREA),
}


@dataclass(frozen=True)
class Quantity:
    """One measured number.

    Attributes:
        key: in JSON.
        label: in the table.
        value: None where it is not defined (no edges, no area).
        unit: in words.
        group: heading in the table.
    """

    key: str
    label: str
    value: float | int | None
    unit: str
    group: str


@dataclass(frozen=True)
class EdgeMeasures:
    """One edge.

    Attributes:
        edge: its number in the topology.
        vertices: numbers of its ends.
        length: in length units of the file.
        dihedral_angle_degrees: signed, positive where convex.
        angle_variation: ``l |a|``, in length units of the file.
    """

    edge: int
    vertices: tuple[int, int]
    length: float
    dihedral_angle_degrees: float
    angle_variation: float


def measure_mesh(vertices: Tensor, topology: Topology) -> list[Quantity]:
    """All quantities of one mesh ``(V, 3)``, in the order of the table."""
    return [*_counts(vertices, topology), *_energies(vertices, topology), *_shape(vertices, topology)]


def worst_edges(vertices: Tensor, topology: Topology, count: int) -> list[EdgeMeasures]:
    """The ``count`` interior edges with the largest ``l |a|``, largest first, ties by edge number."""
    values = energies.angle_variation_per_edge(vertices, topology)
    chosen = values.argsort(descending=True, stable=True)[:count]
    columns = (
        chosen,
        topology.interior_edges[chosen],
        geometry.edge_lengths(vertices, topology)[chosen],
        geometry.dihedral_angles(vertices, topology)[chosen].rad2deg(),
        values[chosen],
    )
    rows = zip(*(column.tolist() for column in columns), strict=True)
    return [EdgeMeasures(edge, (ends[0], ends[1]), *numbers) for edge, ends, *numbers in rows]


def _counts(vertices: Tensor, topology: Topology) -> list[Quantity]:
    used = int((topology.valences > 0).sum())
    counts = {
        "vertices": ("vertices", topology.num_vertices),
        "isolated_vertices": ("vertices without a face", topology.num_vertices - used),
        "edges": ("edges", topology.num_edges),
        "boundary_edges": ("edges on the boundary", topology.num_edges - topology.num_interior_edges),
        "faces": ("faces", topology.num_faces),
        "triangles": ("triangles among them", int((topology.face_sizes == 3).sum())),
        "quads": ("quads among them", int((topology.face_sizes == 4).sum())),
        "degenerate_faces": ("faces without area", int(geometry.degenerate_faces(vertices, topology).sum())),
        "boundary_loops": ("boundary loops", topology.loop_offsets.shape[0] - 1),
        "components": ("connected components", count_components(topology)),
        "euler_characteristic": ("Euler characteristic", used - topology.num_edges + topology.num_faces),
    }
    return [Quantity(key, label, value, NUMBER, "mesh") for key, (label, value) in counts.items()]


def count_components(topology: Topology) -> int:
    """Number of connected pieces; isolated vertices do not count."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    start, stop = topology.edges.cpu().numpy().T
    size = topology.num_vertices
    graph = coo_array((torch.ones(len(start)).numpy(), (start, stop)), shape=(size, size))
    pieces, _ = connected_components(graph, directed=False)
    return int(pieces) - int((topology.valences == 0).sum())


def _energy(key: str) -> Callable[[Tensor, Topology], Tensor]:
    if key == "total_absolute_curvature_corrected":
        return partial(energies.total_absolute_curvature, estimator="corrected")
    function: Callable[[Tensor, Topology], Tensor] = getattr(energies, key)
    return function


def _energies(vertices: Tensor, topology: Topology) -> list[Quantity]:
    area = float(geometry.face_areas(vertices, topology).sum())
    values = {key: float(_energy(key)(vertices, topology)) for key in _ENERGIES}
    rows = [Quantity(key, label, values[key], unit, "energies") for key, (label, unit) in _ENERGIES.items()]
    for key in (key for key, (_, unit) in _ENERGIES.items() if unit == LENGTH):
        label = _ENERGIES[key][0][:25].rstrip()
        per_area = values[key] / area if area > 0 else None
        rows.append(Quantity(f"{key}_per_area", label, per_area, PER_LENGTH, "energies per area"))
    return rows


def _shape(vertices: Tensor, topology: Topology) -> list[Quantity]:
    lengths = geometry.edge_lengths(vertices, topology)
    angles = geometry.dihedral_angles(vertices, topology).abs()
    corners = geometry.corner_angles(vertices, topology)
    deviation = planarity(vertices, topology)
    total_defect = geometry.angle_defects(vertices, topology).sum()
    any_length, any_angle, any_corner, any_face = (bool(x.numel()) for x in (lengths, angles, corners, deviation))
    rows = (
        ("area", "area", float(geometry.face_areas(vertices, topology).sum()), AREA),
        ("mean_edge_length", "mean edge length", float(lengths.mean()) if any_length else None, LENGTH),
        ("shortest_edge_length", "shortest edge", float(lengths.min()) if any_length else None, LENGTH),
        ("longest_edge_length", "longest edge", float(lengths.max()) if any_length else None, LENGTH),
        (
            "largest_dihedral_angle_degrees",
            "largest |dihedral angle|",
            math.degrees(float(angles.max())) if any_angle else None,
            DEGREES,
        ),
        (
            "smallest_corner_angle_degrees",
            "smallest corner angle",
            math.degrees(float(corners.min())) if any_corner else None,
            DEGREES,
        ),
        (
            "largest_planarity",
            "largest planarity (diagonal distance / mean edge)",
            float(deviation.max()) if any_face else None,
            NUMBER,
        ),
        ("angle_defect_sum_degrees", "sum of angle defects", math.degrees(float(total_defect)), DEGREES),
    )
    return [Quantity(key, label, value, unit, "shape") for key, label, value, unit in rows]
