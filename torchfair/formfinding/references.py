"""Surfaces that jobs stay close to: meshes or functions, in the unit in which the job is solved."""

from __future__ import annotations

import torch
from torch import Tensor

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


def distances_from(reference: Reference, points: Tensor) -> Tensor:
    """(N,) distances of ``points`` (N, 3) from the reference."""
    if isinstance(reference, ReferenceSurface):
        return reference.closest(points).distances
    positions, _ = closest_on(reference)(points)
    distances: Tensor = torch.linalg.vector_norm(points - positions, dim=1)
    return distances
