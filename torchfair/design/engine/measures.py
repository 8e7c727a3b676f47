"""Numbers of a mesh while it moves and once it rests, and values on its vertices and faces."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import torch
from torch import Tensor

from ...energies import angle_variation_per_edge, normal_variation, total_absolute_curvature
from ...geometry import ReferenceSurface, corner_angles, edge_lengths, planarity
from ...measuring import worst_edges
from ...stars import StarKind, classify_stars, pyramid_self_intersections
from ...topology import Topology
from ..containers import Array, pack

STAR_NAMES = ("convex", "good saddle", "bad saddle", "neither", "boundary", "isolated")


def edge_bytes(vertices: Tensor, topology: Topology) -> tuple[Array, float]:
    """``l |a|`` of all edges (E,) as uint8, and what 255 stands for; boundary edges have 0."""
    values = angle_variation_per_edge(vertices, topology)
    scale = float(values.max()) if values.numel() else 0.0
    result = np.zeros(topology.num_edges, np.uint8)
    if scale > 0.0:
        result[: topology.num_interior_edges] = (values * (255.0 / scale)).round().clamp(0.0, 255.0).to(torch.uint8)
    return result, scale


def live_numbers(vertices: Tensor, topology: Topology, handles: Mapping[int, Any], worst: int) -> dict[str, Any]:
    """What is measured while the mesh moves; lengths in the unit of the vertices, angles in degrees."""
    energy = float(normal_variation(vertices, topology))
    curvature = float(total_absolute_curvature(vertices, topology))
    polygons = topology.face_sizes > 3
    chosen, targets = list(handles), torch.tensor(list(handles.values()), dtype=torch.float64).reshape(-1, 3)
    away = torch.linalg.vector_norm(vertices[chosen] - targets, dim=1)
    return {
        "E": _finite(energy),
        "C": _finite(curvature),
        "E_over_C": _finite(energy / curvature if curvature > 0.0 else math.nan),
        "planarity": _finite(float(planarity(vertices, topology)[polygons].max())) if bool(polygons.any()) else 0.0,
        "smallest_angle": _finite(math.degrees(float(corner_angles(vertices, topology).min()))),
        "handle_distance": _finite(float(away.max())) if chosen else 0.0,
        "mean_edge": _finite(float(edge_lengths(vertices, topology).mean())),
        "worst": [
            {
                "edge": edge.edge,
                "vertices": list(edge.vertices),
                "length": edge.length,
                "angle": edge.dihedral_angle_degrees,
                "value": edge.angle_variation,
            }
            for edge in worst_edges(vertices, topology, worst)
        ],
    }


class Deviation:
    """Distances between a mesh and the surface that it comes from.

    Args:
        vertices: (R, 3) of the surface.
        topology: Its connectivity.
    """

    def __init__(self, vertices: Tensor, topology: Topology) -> None:
        self._points = vertices[topology.valences > 0]
        self._surface = ReferenceSurface(vertices, topology)

    def there(self, vertices: Tensor) -> Tensor:
        """(V,) from vertices (V, 3) to the surface."""
        return self._surface.closest(vertices).distances

    def back(self, vertices: Tensor, topology: Topology) -> float:
        """The largest from a vertex of the surface to the mesh."""
        return float(ReferenceSurface(vertices, topology).closest(self._points).distances.max())


def view(name: str, number: int, vertices: Tensor, topology: Topology, deviation: Deviation) -> bytes:
    """The container of a view."""
    legend, arrays = _VIEWS[name](vertices, topology, deviation)
    return pack({"type": "view", "view": name, "topology": number, "legend": legend}, arrays)


_View = tuple[dict[str, Any], dict[str, Array]]


def _stars(vertices: Tensor, topology: Topology, deviation: Deviation) -> _View:
    classes = classify_stars(vertices, topology)
    values = np.full(topology.num_vertices, STAR_NAMES.index("neither"), np.uint8)
    masks = {
        "convex": classes.is_kind(StarKind.CONVEX),
        "good saddle": classes.good,
        "bad saddle": classes.bad_saddles,
        "boundary": classes.is_kind(StarKind.EXCLUDED),
        "isolated": topology.valences == 0,
    }
    for name, mask in masks.items():
        values[mask.numpy()] = STAR_NAMES.index(name)
    crossings = pyramid_self_intersections(vertices, topology).clamp(0, 255).to(torch.uint8).numpy()
    legend = {"words": "stars", "unit": "", "least": 0, "most": len(STAR_NAMES) - 1, "names": list(STAR_NAMES)}
    return legend, {"values": values, "crossings": crossings}


def _distances(vertices: Tensor, topology: Topology, deviation: Deviation) -> _View:
    values = deviation.there(vertices) / float(edge_lengths(vertices, topology).mean())
    return _scalar("distance from where it started", "mean edges", values)


def _planarity(vertices: Tensor, topology: Topology, deviation: Deviation) -> _View:
    return _scalar("distance of diagonals", "mean edges of the face", planarity(vertices, topology))


def _scalar(words: str, unit: str, values: Tensor) -> _View:
    shown = values.nan_to_num(0.0, 0.0, 0.0).to(torch.float32).numpy()
    most = float(shown.max()) if shown.size else 0.0
    return {"words": words, "unit": unit, "least": 0.0, "most": most}, {"values": shown}


_VIEWS: Mapping[str, Callable[[Tensor, Topology, Deviation], _View]] = {
    "stars": _stars,
    "deviation": _distances,
    "planarity": _planarity,
}


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
