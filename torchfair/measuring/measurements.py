"""Energies, curvature, area, lengths and angles of one mesh, each with its unit."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Literal

from torch import Tensor

from .. import energies, geometry
from .._graph import count_components
from .._one_mesh import one_mesh
from .._remembered import remembering
from ..topology import Topology

Unit = Literal["length", "area", "1 / length", "degrees", "dimensionless"]

_ENERGIES: dict[str, Unit] = {
    "normal_variation": "length",
    "angle_variation": "length",
    "total_mean_curvature": "length",
    "total_absolute_curvature": "length",
    "total_absolute_curvature_corrected": "length",
    "total_frobenius_curvature": "length",
    "willmore_energy": "dimensionless",
    "umbrella_fairness": "area",
    "polyline_fairness": "area",
}


@dataclass(frozen=True)
class Quantity:
    """One measured number.

    Attributes:
        key: name in snake_case, the same in every report.
        value: None where it is not defined (no edges, no area).
        unit: ``"length"``, that of the vertices; ``"area"``, its square; ``"1 / length"``; ``"degrees"``;
            ``"dimensionless"``.
        group: ``"mesh"``, ``"energies"``, ``"energies per area"``, ``"shape"``, or ``"on the reference surface"`` for
            those of :class:`torchfair.measuring.Stationarity`.
    """

    key: str
    value: float | int | None
    unit: Unit
    group: str


def measure_mesh(vertices: Tensor, topology: Topology) -> list[Quantity]:
    """All quantities of one mesh: counts, energies, energies per area, shape.

    Example::

        numbers = {quantity.key: quantity.value for quantity in measure_mesh(vertices, topology)}
        numbers["normal_variation"], numbers["smallest_corner_angle_degrees"]

    Args:
        vertices: positions ``(V, 3)`` in any length unit.
        topology: connectivity; any polygons, mixed.

    Returns:
        The quantities, always the same ones in the same order. Values that are not defined, such as the mean length
        of no edges, are None. Faces without area and isolated vertices are counted and have no other influence.

    Raises:
        ShapeError: if ``vertices`` are not one mesh that fits the topology.
    """
    vertices = one_mesh(vertices, topology)
    with remembering():
        return [*_counts(vertices, topology), *_energies(vertices, topology), *_shape(vertices, topology)]


def _counts(vertices: Tensor, topology: Topology) -> list[Quantity]:
    used = int((topology.valences > 0).sum())
    counts = {
        "vertices": topology.num_vertices,
        "isolated_vertices": topology.num_vertices - used,
        "edges": topology.num_edges,
        "boundary_edges": topology.num_edges - topology.num_interior_edges,
        "faces": topology.num_faces,
        "triangles": int((topology.face_sizes == 3).sum()),
        "quads": int((topology.face_sizes == 4).sum()),
        "degenerate_faces": int(geometry.degenerate_faces(vertices, topology).sum()),
        "boundary_loops": topology.loop_offsets.shape[0] - 1,
        "components": count_components(topology),
        "euler_characteristic": used - topology.num_edges + topology.num_faces,
    }
    return [Quantity(key, value, "dimensionless", "mesh") for key, value in counts.items()]


def _energy(key: str) -> Callable[[Tensor, Topology], Tensor]:
    if key == "total_absolute_curvature_corrected":
        return partial(energies.total_absolute_curvature, estimator="corrected")
    function: Callable[[Tensor, Topology], Tensor] = getattr(energies, key)
    return function


def _energies(vertices: Tensor, topology: Topology) -> list[Quantity]:
    area = float(geometry.face_areas(vertices, topology).sum())
    values = {key: float(_energy(key)(vertices, topology)) for key in _ENERGIES}
    rows = [Quantity(key, values[key], unit, "energies") for key, unit in _ENERGIES.items()]
    for key in (key for key, unit in _ENERGIES.items() if unit == "length"):
        per_area = values[key] / area if area > 0 else None
        rows.append(Quantity(f"{key}_per_area", per_area, "1 / length", "energies per area"))
    return rows


def _shape(vertices: Tensor, topology: Topology) -> list[Quantity]:
    lengths = geometry.edge_lengths(vertices, topology)
    angles = geometry.dihedral_angles(vertices, topology).abs()
    corners = geometry.corner_angles(vertices, topology)
    deviation = geometry.planarity(vertices, topology)
    conical = geometry.conical_deviations(vertices, topology)
    total_defect = geometry.angle_defects(vertices, topology).sum()
    any_length, any_angle, any_corner, any_face = (bool(x.numel()) for x in (lengths, angles, corners, deviation))
    rows: tuple[tuple[str, float | None, Unit], ...] = (
        ("area", float(geometry.face_areas(vertices, topology).sum()), "area"),
        ("mean_edge_length", float(lengths.mean()) if any_length else None, "length"),
        ("shortest_edge_length", float(lengths.min()) if any_length else None, "length"),
        ("longest_edge_length", float(lengths.max()) if any_length else None, "length"),
        ("largest_dihedral_angle_degrees", math.degrees(float(angles.max())) if any_angle else None, "degrees"),
        ("smallest_corner_angle_degrees", math.degrees(float(corners.min())) if any_corner else None, "degrees"),
        ("largest_planarity", float(deviation.max()) if any_face else None, "dimensionless"),
        ("largest_conical_deviation", float(conical.max()) if any_face else None, "dimensionless"),
        ("angle_defect_sum_degrees", math.degrees(float(total_defect)), "degrees"),
    )
    return [Quantity(*row, "shape") for row in rows]
