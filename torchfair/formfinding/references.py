"""Surfaces that jobs stay close to: meshes or functions, in the unit in which the job is solved."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from ..errors import MeshError
from ..geometry import ReferenceSurface, closest_on
from ..geometry.reference import Reference, ReferenceFunction
from ..normalisation import Normalisation
from ..topology import Topology
from .checks import one_start

GivenReference = tuple[Tensor, Topology] | ReferenceFunction
"""A mesh, or a function that gives closest points and unit normals (:func:`torchfair.geometry.closest_on`)."""


def normalised_reference(reference: GivenReference, unit: Normalisation) -> GivenReference:
    """A reference given in the unit of the input, as the same kind in that of the job.

    Raises:
        ShapeError: vertices of a mesh are not ``(V, 3)``, or it is neither a mesh nor a function.
    """
    if isinstance(reference, tuple):
        return unit.apply(one_start(*reference)), reference[1].to("cpu")
    return _Normalised(reference, unit)


class _Normalised:
    """A function of points in the unit of the job."""

    def __init__(self, function: ReferenceFunction, unit: Normalisation) -> None:
        self._closest, self._unit = closest_on(function), unit

    def __call__(self, points: Tensor) -> tuple[Tensor, Tensor]:
        positions, normals = self._closest(self._unit.invert(points))
        return self._unit.apply(positions), normals


def surface_of(reference: GivenReference) -> Reference:
    """What closest points are sought on.

    Raises:
        MeshError: a mesh has no face, or vertices that are not finite.
    """
    return ReferenceSurface(*reference) if isinstance(reference, tuple) else reference


def refuse_far_reference(
    reference: GivenReference, surface: Reference, vertices: Tensor, topology: Topology, *, most: float
) -> None:
    """Raises MeshError where a reference is too far away to be meant, or the same shape in another unit.

    Args:
        reference: The surface, as it was given.
        surface: The same, as :func:`surface_of` makes it.
        vertices: (V, 3) the start, in the same unit, that of its mean edge.
        topology: Its connectivity; vertices without faces do not count.
        most: Largest distance of a vertex from the reference; infinity allows everything.
    """
    if most == math.inf:
        return
    used = vertices[topology.valences > 0]
    farthest = float(distances_from(surface, used).max())
    words, same = "", False
    if isinstance(reference, tuple):
        words, same = _likely_unit(_extents(reference[0][reference[1].valences > 0]), _extents(used))
    if farthest <= most and not same:
        return
    raise MeshError(
        f"the mesh is up to {farthest:.3g} of its mean edges away from the reference, at most {most:g} are allowed"
        f"{words}. Bring both to one unit and place, or raise reference_distance (infinity allows everything)"
    )


_UNITS = (10.0, 100.0, 1000.0, 25.4, 2.54, 12.0, 3.2808, 304.8, 30.48, 39.37, 36.0)  # metres, feet, inches and parts
_ABOUT, _EXACTLY = 1.25, 1.02


def _extents(points: Tensor) -> Tensor:
    return points.amax(0) - points.amin(0)


def _likely_unit(theirs: Tensor, ours: Tensor) -> tuple[str, bool]:
    """Which factor between units explains two sizes (3,), in words, and whether only the unit seems to differ."""
    ratio = float(torch.linalg.vector_norm(theirs) / torch.linalg.vector_norm(ours))
    if not 0.0 < ratio < math.inf or 1.0 / _ABOUT < ratio < _ABOUT:
        return "", False
    larger, factor = ratio > 1.0, max(ratio, 1.0 / ratio)
    nearest = min(_UNITS, key=lambda unit: abs(math.log(factor / unit)))
    words, off = f"; the reference is {factor:.3g} times as {'large' if larger else 'small'}", factor / nearest
    if not 1.0 / _ABOUT < off < _ABOUT:
        return words, False
    alike = bool(((theirs - ratio * ours).abs() <= (_EXACTLY - 1.0) * float(theirs.max())).all())
    advice = f"{words}, likely another unit: {'divide' if larger else 'multiply'} it by {nearest:g}"
    return advice, alike and 1.0 / _EXACTLY < off < _EXACTLY


def distances_from(reference: Reference, points: Tensor) -> Tensor:
    """(N,) distances of ``points`` (N, 3) from the reference."""
    if isinstance(reference, ReferenceSurface):
        return reference.closest(points).distances
    positions, _ = closest_on(reference)(points)
    distances: Tensor = torch.linalg.vector_norm(points - positions, dim=1)
    return distances
