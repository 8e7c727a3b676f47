"""When C says nothing: folds, which it does not see."""

from __future__ import annotations

import math
from collections.abc import Mapping

import torch
from torch import Tensor

from ..energies import normal_variation, total_absolute_curvature
from ..geometry import dihedral_angles, face_areas
from ..self_intersections import self_intersections
from ..topology import Topology

_LARGEST_RATIO = 3.0  # of E to C: good meshes have 1 to 2, those whose edges cross ridges 2.5
LARGEST_DIHEDRAL = 150.0  # degrees
_ROUNDING = 1e-7
_FLAT = 0.02  # of the root of the area: E of meshes that are flat to rounding


def is_flat(energy: float, area: float) -> bool:
    """Whether an E or E' is no more than rounding on a mesh of that area."""
    return energy <= _ROUNDING * math.sqrt(area)


def explained_variation(curvature: float, area: float) -> float:
    """The largest E that goes with a C and an area where nothing is folded, in the unit of both E and C."""
    return _LARGEST_RATIO * curvature + _FLAT * math.sqrt(area)


def fold_measures(vertices: Tensor, topology: Topology) -> dict[str, float]:
    """What tells whether one mesh (V, 3) is folded; :func:`curvature_doubts` says it in words.

    C adds signed bending within a star, so zigzags cancel, and a mesh that is folded flat measures 0. E does not.

    Returns:
        ``total_absolute_curvature``, ``normal_variation`` (length); ``area``; ``largest_dihedral_angle_degrees``,
        without sign; ``self_intersections``, the number of pairs of faces that meet without being neighbours.
    """
    curvature = float(total_absolute_curvature(vertices, topology))
    area = float(face_areas(vertices, topology).sum())
    angles = dihedral_angles(vertices, topology).abs()
    return {
        "total_absolute_curvature": curvature,
        "normal_variation": float(normal_variation(vertices, topology)),
        "area": area,
        "largest_dihedral_angle_degrees": math.degrees(float(angles.max())) if angles.numel() else 0.0,
        "self_intersections": count_meetings(vertices, topology),
    }


def count_meetings(vertices: Tensor, topology: Topology) -> int:
    """Pairs of faces that run through each other, see :func:`torchfair.self_intersections`.

    Faces that only lie side by side without being joined, with one or two corners at the same places, are left out:
    they are neighbours in an unwelded mesh.
    """
    pairs = self_intersections(vertices, topology)
    points = vertices.detach().cpu().numpy()
    corners, offsets = topology.corners.cpu().numpy(), topology.face_offsets.cpu().numpy()

    def places(face: int) -> set[tuple[float, ...]]:
        return set(map(tuple, points[corners[offsets[face] : offsets[face + 1]]].tolist()))

    known = {face: places(face) for face in torch.unique(pairs).tolist()}
    return sum(len(known[one] & known[other]) not in (1, 2) for one, other in pairs.tolist())


def curvature_doubts(measures: Mapping[str, float]) -> list[str]:
    """Reasons not to trust C, in words; empty where there are none.

    Args:
        measures: From :func:`fold_measures`, or of the same names.

    Example::

        for doubt in curvature_doubts(fold_measures(vertices, topology)):
            print("C is not to be trusted:", doubt)
    """
    doubts = []
    energy = measures["normal_variation"]
    if energy > explained_variation(measures["total_absolute_curvature"], measures["area"]):
        doubts.append(f"E = {energy:.4g} is more than {_LARGEST_RATIO:g} times C: bending cancels within stars")
    angle = measures["largest_dihedral_angle_degrees"]
    if angle > LARGEST_DIHEDRAL:
        doubts.append(f"a dihedral angle of {angle:.4g} degrees: the mesh is folded there")
    if measures["self_intersections"]:
        doubts.append(f"{measures['self_intersections']} pair(s) of faces run through each other")
    return doubts
