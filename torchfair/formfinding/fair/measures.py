"""What the job that lowers E reports and promises."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import torch
from torch import Tensor

from ..._names import few_groups, sentence
from ...energies import normal_variation, total_absolute_curvature
from ...energies.angle_variation import lengths_times_angles
from ...geometry import corner_angles, edge_lengths, face_areas, face_normals
from ...geometry.planarity import planarity
from ...normalisation import Normalisation
from ..job.promises import Promise, handle_promise
from .crossing_sides import crossing_sides
from .face_bounds import KEPT_OF_OWN
from .panel_sizes import sizes_of
from .panels import PLANAR_PROMISE
from .problem import FairProblem

_EDGES = "mean edges"
_KEPT_AREA = 0.9  # of that of a sheet with a free boundary
_FREER = "let the boundary glide or be free, raise distance_limit, or choose fewer faces"
_OF_PANELS = "planarity of kept faces"
_TOUCHING = 1e-9  # of the size of a face: corners pressed against a side are off it by rounding
FLAT_PROMISE = 0.02  # degrees between the faces at edges that are kept flat


def fair_measures(vertices: Tensor, start: Tensor, problem: FairProblem, unit: Normalisation) -> dict[str, float]:
    """Energies and promised quantities of one mesh (V, 3), against its start (V, 3), both in the unit of the input.

    Returns:
        ``normal_variation`` (E), ``angle_variation``, ``total_mean_curvature`` and ``total_absolute_curvature``
        (C, the floor of E, measured with the normal cycle), in the length unit of the input;
        ``energy_over_curvature``; ``area``; ``largest_face_area``; ``mean_edge_length``; ``shortest_edge``,
        ``longest_edge``. ``largest_distance`` of vertices from the reference surface and
        ``largest_distance_relative`` (in mean edges of the input), for vertices that glide on a boundary curve
        from the nearer of both; ``largest_distance_back`` from vertices of the reference surface to this one,
        and ``largest_distance_back_relative``; ``largest_boundary_distance`` of gliding vertices from their
        curve. ``smallest_angle_degrees``; ``smallest_area_ratio``, ``largest_area_ratio`` and ``flipped_faces``
        against the start, ``smallest_area_share`` over the mean of the start, ``crossing_faces``, whose sides cross by
        more than rounding, ``smallest_edge_ratio`` of the sides of polygons, ``largest_growth`` against the larger of
        a face's own area and half the mean.
        ``largest_planarity`` of the faces kept planar and ``largest_planarity_of_all`` polygons (diagonal distance over
        mean edge of the face), ``largest_planarity_growth`` of those that are nearly planar. ``largest_fold_degrees``
        of the edges kept flat. ``largest_handle_distance``.
    """
    topology = problem.topology
    normalised = unit.apply(vertices)
    distances = problem.near.distances(normalised)[topology.valences > 0]
    back = problem.near.largest_distance_back(normalised, topology, like_start=problem.near_input)
    areas, lengths = face_areas(vertices, topology), edge_lengths(vertices, topology)
    normals, is_start = face_normals(vertices, topology), vertices is start
    own_areas = areas if is_start else face_areas(start, topology)
    ratios, growth = areas / own_areas, areas / sizes_of(own_areas)
    turned = (normals * (normals if is_start else face_normals(start, topology))).sum(1)
    strayed = vertices.new_zeros(0) if problem.boundary is None else problem.boundary.distances(normalised)
    warps, sides = planarity(vertices, topology), problem.bounds.sides.shares(normalised, topology)
    bends = lengths_times_angles(vertices, topology)
    angle_variation, mean_curvature = (
        float(topology.sum_per_mesh(part, "interior_edges")) for part in (bends.abs(), bends / 2)
    )
    energy, curvature = (
        float(quantity(vertices, topology)) for quantity in (normal_variation, total_absolute_curvature)
    )
    return {
        "normal_variation": energy,
        "angle_variation": angle_variation,
        "total_mean_curvature": mean_curvature,
        "total_absolute_curvature": curvature,
        "energy_over_curvature": energy / curvature if curvature > 0.0 else math.nan,
        "area": float(areas.sum()),
        "largest_face_area": float(areas.max()),
        "longest_edge": float(lengths.max()),
        "mean_edge_length": float(lengths.mean()),  # zero where all shrinks to a point
        "largest_distance": unit.length * float(distances.max()),
        "largest_distance_relative": float(distances.max()) / problem.input_edge,
        "largest_distance_back": unit.length * back,
        "largest_distance_back_relative": back / problem.input_edge,
        "largest_boundary_distance": unit.length * _largest(strayed),
        "smallest_angle_degrees": math.degrees(float(corner_angles(vertices, topology).min())),
        "smallest_area_ratio": float(ratios.min()),
        "largest_area_ratio": float(ratios.max()),
        "smallest_area_share": float(areas.min() / own_areas.mean()),
        "largest_growth": float(growth.max()),
        "smallest_edge_ratio": float(sides.min()) if sides.numel() else 1.0,
        "shortest_edge": float(lengths.min()),
        "flipped_faces": int((turned <= 0.0).sum()),
        "crossing_faces": int(crossing_sides(vertices, topology, _TOUCHING).sum()),
        "largest_planarity": _largest(warps[problem.panels.planar]),
        "largest_planarity_of_all": _largest(warps[topology.face_sizes > 3]),
        "largest_planarity_growth": max(0.0, _largest(problem.panels.nearly.growth(warps))),
        "largest_fold_degrees": math.degrees(_largest(problem.panels.folds(vertices))),
        "largest_handle_distance": unit.length * problem.pulls.farthest(normalised),
    }


def fair_promises(problem: FairProblem, before: Mapping[str, float], after: Mapping[str, float]) -> list[Promise]:
    """What the settings ask of a mesh, and what its measures are."""
    settings = problem.settings
    promises = []
    if not problem.has_other_goals:
        promises.append(Promise("E", before["normal_variation"], after["normal_variation"]))
    promises += _distance_promises(problem, before, after)
    if settings.boundary == "free" and not problem.has_other_goals:
        least, remedy = _KEPT_AREA * before["area"], "it has shrunk, not become smoother: raise free_boundary_weight"
        promises.append(Promise("area", least, after["area"], "at least", remedy=remedy))
    promises += _face_promises(problem, before, after)
    promises += _panel_promises(problem, after)
    if bool(problem.pulls.pulled.any()):
        away, edge = after["largest_handle_distance"], before["mean_edge_length"]
        remedy = "faces would become too small or too thin; allow smaller angles and areas, or pull less"
        promises.append(handle_promise(away, edge, remedy=remedy))
    return promises


def _distance_promises(problem: FairProblem, before: Mapping[str, float], after: Mapping[str, float]) -> list[Promise]:
    """How far the mesh is from the reference, and it from the mesh."""
    settings, promises = problem.settings, []
    bounded = problem.near.limits is not None and not problem.near.design_mode
    if bounded:
        asked = max(settings.distance_limit or 0.0, problem.planarity.distance)
        most, reached = max(asked, before["largest_distance_relative"]), after["largest_distance_relative"]
        remedy = "raise distance_limit, or pull less"
        promises.append(
            Promise("distance from the reference", most, reached, unit=_EDGES, remedy=remedy, of_settings=asked)
        )
    if bounded and problem.near_input:
        asked, reached = settings.distance_back, after["largest_distance_back_relative"]
        most = max(asked, before["largest_distance_back_relative"])
        remedy = "something is cut off: lower crease_angle, refine, or raise distance_back"
        name = "distance of the input from the result"
        promises.append(Promise(name, most, reached, unit=_EDGES, remedy=remedy, of_settings=asked))
    return promises


def _face_promises(problem: FairProblem, before: Mapping[str, float], after: Mapping[str, float]) -> list[Promise]:
    """Angles, areas and sides of faces, and that none is turned over, nor its sides cross."""
    settings, promises = problem.settings, []
    if settings.quality_weight:
        asked = math.degrees(settings.smallest_angle)
        least, reached = min(asked, before["smallest_angle_degrees"]), after["smallest_angle_degrees"]
        promises.append(Promise("smallest angle", least, reached, "at least", "degrees", of_settings=asked))
        area = after["smallest_area_ratio"]
        promises.append(Promise("smallest area against its own", settings.smallest_area, area, "at least"))
        if settings.smallest_area and settings.smallest_share:
            asked, reached = settings.smallest_share, after["smallest_area_share"]
            least = min(asked, KEPT_OF_OWN * before["smallest_area_share"])
            promises.append(Promise("smallest area over the mean", least, reached, "at least", of_settings=asked))
        if problem.bounds.sides.edges.numel():
            edge, name = after["smallest_edge_ratio"], "shortest side of a polygon against its own"
            promises.append(Promise(name, settings.smallest_edge, edge, "at least"))
    if problem.bounds.largest_areas(problem.settings) is not None:
        growth, remedy = after["largest_growth"], "raise largest_area, or allow smaller areas"
        promises.append(Promise("growth of a face, by", settings.largest_area, growth, remedy=remedy))
    if not settings.faces_may_turn:
        remedy = "pull less, in several steps, or allow it: faces_may_turn"
        promises.append(Promise("faces turned over", 0.0, after["flipped_faces"], remedy=remedy))
    if not settings.faces_may_turn and int(problem.topology.face_sizes.max()) > 3:
        most, crossing = before["crossing_faces"], after["crossing_faces"]
        remedy = "hold the boundary, or raise smallest_edge and smallest_area"
        promises.append(Promise("faces that cross themselves", most, crossing, remedy=remedy))
    return promises


def _panel_promises(problem: FairProblem, after: Mapping[str, float]) -> list[Promise]:
    """That panels are planar, or no less so, and edges kept flat."""
    settings, promises = problem.settings, []
    if problem.panels.planar.numel() and settings.planarity_weight:
        promises.append(Promise(_OF_PANELS, PLANAR_PROMISE, after["largest_planarity"], remedy=_FREER))
    if problem.panels.nearly.faces.numel():
        growth = after["largest_planarity_growth"]
        promises.append(
            Promise("growth of the planarity of nearly planar faces", PLANAR_PROMISE, growth, remedy=_FREER)
        )
    if problem.panels.flat.numel() and settings.flat_weight:
        remedy = "let the boundary glide or be free, raise distance_limit, or let them fold: flat none"
        reached = after["largest_fold_degrees"]
        promises.append(Promise("folds of edges kept flat", FLAT_PROMISE, reached, unit="degrees", remedy=remedy))
    return promises


def located(promises: Sequence[Promise], vertices: Tensor, problem: FairProblem) -> list[Promise]:
    """The promises, with the panels of ``vertices`` (V, 3) named that are not planar as promised, the worst first."""
    warps = problem.panels.warps(vertices)
    order = torch.argsort(warps, descending=True, stable=True)[: int((warps > PLANAR_PROMISE).sum())]
    named = [
        (("face", face), f" ({warp:.2g})")
        for face, warp in zip(problem.panels.planar[order[:5]].tolist(), warps[order[:5]].tolist(), strict=True)
    ]
    where = sentence(f"{len(order)} of {len(warps)}: faces ", few_groups(named, len(order)))
    return [replace(p, where=where) if p.name == _OF_PANELS and len(order) else p for p in promises]


def _largest(values: Tensor) -> float:
    return float(values.max()) if values.numel() else 0.0
