"""What ``torchfair measure`` prints: quantities under their headings, the worst edges and panels."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

from .._names import FROM_ZERO, Names

if TYPE_CHECKING:
    from ..measuring import EdgeMeasures, PanelMeasures, Quantity

_UNITS = {
    "length": "length units of the file",
    "area": "square length units of the file",
    "1 / length": "1 / length unit of the file",
}
LABELS = {
    "vertices": "vertices",
    "isolated_vertices": "vertices without a face",
    "edges": "edges",
    "boundary_edges": "edges on the boundary",
    "faces": "faces",
    "triangles": "triangles among them",
    "quads": "quads among them",
    "degenerate_faces": "faces without area",
    "boundary_loops": "boundary loops",
    "components": "connected components",
    "euler_characteristic": "Euler characteristic",
    "normal_variation": "E   normal variation       sum l l*",
    "angle_variation": "E'  angle variation        sum l |a|",
    "total_mean_curvature": "    total mean curvature   1/2 sum l a",
    "total_absolute_curvature": "C   absolute curvature     by the normal cycle",
    "total_absolute_curvature_corrected": "C   corrected              by vertex normals",
    "total_frobenius_curvature": "C2  Frobenius curvature    sum sqrt(k1^2 + k2^2)",
    "willmore_energy": "    Willmore energy        integral of (k1 + k2)^2 / 4",
    "umbrella_fairness": "    umbrella fairness",
    "polyline_fairness": "    polyline fairness",
    "area": "area",
    "mean_edge_length": "mean edge length",
    "shortest_edge_length": "shortest edge",
    "longest_edge_length": "longest edge",
    "largest_dihedral_angle_degrees": "largest |dihedral angle|",
    "smallest_corner_angle_degrees": "smallest corner angle",
    "largest_planarity": "largest planarity (diagonal distance / mean edge)",
    "largest_conical_deviation": "farthest from conical (miss / offset distance)",
    "angle_defect_sum_degrees": "sum of angle defects",
    "judged_vertices": "vertices with a complete gradient",
    "largest_tangential_gradient": "largest tangential gradient of E",
    "mean_tangential_gradient": "mean tangential gradient of E",
    "tangential_imbalance": "imbalance (sum of these / sum of l* around vertices)",
    "largest_reference_distance": "largest distance from the reference",
}
_NAME = 25  # columns of a label before its formula


def format_quantities(quantities: list[Quantity]) -> str:
    """The quantities as lines of text under their headings; counts and pure numbers go without a unit."""
    labels = [_label(quantity) for quantity in quantities]
    width = max(map(len, labels))
    lines = []
    group = None
    for quantity, label in zip(quantities, labels, strict=True):
        if quantity.group != group:
            group = quantity.group
            lines += ["", group]
        unit = "" if quantity.unit == "dimensionless" else f"  {unit_of(quantity)}"
        lines.append(f"  {label:<{width}}  {_number(quantity.value):>12}{unit}")
    return "\n".join(lines)


def format_edges(edges: Sequence[EdgeMeasures], names: Names = FROM_ZERO) -> str:
    """The edges as a table."""
    title = (
        f"worst edges (vertices as in the file, from {names.first}; l and l |a| in length units of the file, a in "
        "degrees, positive where convex)"
    )
    rows = (
        (" - ".join(map(names.vertex, edge.vertices)),
         (edge.length, edge.dihedral_angle_degrees, edge.angle_variation), edge.position)
        for edge in edges
    )  # fmt: skip
    return _table(title, ("vertices", "l", "a", "l |a|", "middle"), rows)


def format_panels(panels: Sequence[PanelMeasures], names: Names = FROM_ZERO) -> str:
    """The panels as a table."""
    title = (
        f"worst panels (numbers as in the file, from {names.first}; planarity is diagonal distance / mean edge; "
        "largest kink to a neighbour in degrees)"
    )
    rows = (
        (names.face(panel.face), (panel.planarity, panel.area, panel.largest_kink_degrees), panel.position)
        for panel in panels
    )
    return _table(title, ("panel", "planarity", "area", "kink", "centre"), rows)


def _table(title: str, columns: Sequence[str], rows: Iterable[tuple[str, Iterable[Any], Iterable[float]]]) -> str:
    """Name, three numbers and a place in every row."""
    name, *heads, place = columns
    lines = ["", title, f"  {name:>19} {' '.join(f'{head:>12}' for head in heads)}  {place} x y z"]
    for named, numbers, position in rows:
        cells = " ".join(f"{_number(x):>12}" for x in numbers)
        lines.append(f"  {named:>19} {cells}  {' '.join(map(_number, position))}")
    return "\n".join(lines)


def _label(quantity: Quantity) -> str:
    """What a quantity is called in the table; an energy per area by the name of the energy, without its formula."""
    if quantity.unit == "1 / length":
        return LABELS[quantity.key.removesuffix("_per_area")][:_NAME].rstrip()
    return LABELS[quantity.key]


def unit_of(quantity: Quantity) -> str:
    """The unit of a quantity, in words."""
    return _UNITS.get(quantity.unit, quantity.unit)


def _number(value: float | int | None) -> str:
    """Six significant digits, whole counts in full, a dash where nothing is defined."""
    if value is None:
        return "-"
    return str(value) if isinstance(value, int) else f"{value:.6g}"
