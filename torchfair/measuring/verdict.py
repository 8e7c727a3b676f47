"""One sentence on how smooth a mesh is, how planar its panels are, and where it is worst."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from .._names import FROM_ZERO, Names
from .element_measures import EdgeMeasures, PanelMeasures
from .trust import is_flat

_GRADES = (
    (1.15, "nearly as smooth as its surface allows"),
    (1.5, "fairly smooth, its facets zigzag a little"),
    (2.5, "rough, its facets zigzag"),
    (math.inf, "very rough: facets zigzag, or edges cross ridges"),
)
"""Largest E/C for which these words are said: ours, from meshes that were looked at in a mirror; 1 is the least."""
_PLANAR = 1e-4
_LEAST_SHARE = 0.01  # of all bending, from which on an edge is worth naming


def verdict(
    measures: Mapping[str, float | int | None],
    edges: Sequence[EdgeMeasures],
    panels: Sequence[PanelMeasures],
    doubts: Sequence[str] = (),
    *,
    names: Names = FROM_ZERO,
) -> str:
    """E/C, planarity and the worst places in one sentence.

    Args:
        measures: values by key, of :func:`measure_mesh`.
        edges: the worst ones, see :func:`worst_edges`; empty if none bends.
        panels: the worst ones, see :func:`worst_panels`; empty if all are planar.
        doubts: reasons not to trust C, see :func:`curvature_doubts`.
        names: what vertices and faces are called, such as ``names`` of a mesh that was read.
    """
    parts = [_smoothness(measures, doubts), _planarity(measures, panels, names), _worst(measures, edges, names)]
    return "; ".join(part for part in parts if part) + "."


def _smoothness(measures: Mapping[str, float | int | None], doubts: Sequence[str]) -> str:
    energy, curvature, area = (
        float(measures[key] or 0.0) for key in ("normal_variation", "total_absolute_curvature", "area")
    )
    if not measures["edges"] or measures["edges"] == measures["boundary_edges"]:
        return "no two faces share an edge, so that there is nothing to be smooth"
    if is_flat(energy, area):
        return "the mesh is flat: E is 0, and so is C"
    if doubts or curvature <= 0.0:
        return f"E is {energy:.4g}, and E/C says nothing here (see below)"
    ratio = energy / curvature
    words = next(words for most, words in _GRADES if ratio <= most)
    return f"E/C is {ratio:.3g}: {words}"


def _planarity(measures: Mapping[str, float | int | None], panels: Sequence[PanelMeasures], names: Names) -> str:
    if measures["triangles"] == measures["faces"]:
        return "all panels are triangles"
    largest = float(measures["largest_planarity"] or 0.0)
    if not panels:
        return f"all panels are planar (to {max(largest, _PLANAR):.1g} of their edges)"
    panel = panels[0]
    where = f"panel {names.face(panel.face)} at {_text(panel.position)}"
    return f"panels are up to {largest:.2g} of their edges from planar, most of all {where}"


def _worst(measures: Mapping[str, float | int | None], edges: Sequence[EdgeMeasures], names: Names) -> str:
    total = float(measures["angle_variation"] or 0.0)
    if not edges or not total or is_flat(total, float(measures["area"] or 0.0)):
        return ""
    edge = edges[0]
    share, angle = (edge.angle_variation or 0.0) / total, abs(edge.dihedral_angle_degrees or 0.0)
    if share < _LEAST_SHARE:
        largest = float(measures["largest_dihedral_angle_degrees"] or 0.0)
        return f"no edge bears much more than others; the largest kink is {largest:.3g} degrees"
    ends = " - ".join(map(names.vertex, edge.vertices))
    return f"it bends most at the edge {ends} at {_text(edge.position)}, by {angle:.3g} degrees ({share:.0%} of E')"


def _text(place: Sequence[float]) -> str:
    return " ".join(f"{x:.4g}" for x in place)
