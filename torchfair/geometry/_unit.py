"""A unit of length in which products of lengths neither overflow nor vanish."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from .._joined_tables import Elements
from .._remembered import is_remembering, remembered
from ..topology import Topology

_FINE = 14  # binary digits: parts of a mesh that may be so much smaller than its extent
_TARGET = 10  # the extent, as a power of two, in the unit that is chosen


def ordinary_extents(dtype: torch.dtype) -> tuple[float, float]:
    """Extents of meshes that are computed with as they are: from 0.02 to 7e7 in float32, 5e-65 to 2e75 in float64.

    Between them, no fourth power of an edge overflows, nor does one vanish beside the bound of degenerate faces.
    """
    limits = torch.finfo(dtype)
    low = limits.tiny**0.25 / limits.eps**0.5 * 2.0**_FINE
    high = limits.max**0.25 / 2.0**6
    return (low, high) if low < high else (0.0, math.inf)


def unit_of(vertices: Tensor) -> Tensor:
    """(*batch,) a power of two to divide the ``vertices`` (*batch, V, 3) of every mesh by; 1 for ordinary extents.

    Nothing is differentiated through it.
    """
    positions = vertices.detach()
    if not positions.shape[-2]:
        return positions.new_ones(positions.shape[:-2])
    coordinates = positions.mT.contiguous()  # twice as fast as reductions over rows
    return _unit((coordinates.amax(-1) - coordinates.amin(-1)).amax(-1), *ordinary_extents(vertices.dtype))


@remembered
def in_its_unit(vertices: Tensor) -> tuple[Tensor, Tensor]:
    """``vertices`` (*batch, V, 3) divided by their :func:`unit_of`, and that unit (*batch, 1).

    Values of the scaled mesh, one a vertex, an edge or a face, are to be multiplied by the unit as often as they are
    lengths.
    """
    unit = unit_of(vertices)[..., None]
    if is_remembering() and bool((unit == 1.0).all()):
        return vertices, unit  # the same values, for which the same is known
    return vertices / unit[..., None], unit


def in_their_units(vertices: Tensor, topology: Topology, of: Elements) -> tuple[Tensor, Tensor]:
    """Like :func:`in_its_unit`, with a unit for each of several joined meshes: that of every element, (*batch, N)."""
    if not topology.is_joined:
        return in_its_unit(vertices)
    units = units_of(vertices.detach().mT, topology.vertex_meshes, topology.num_meshes)
    scaled = vertices / topology.spread(units, "vertices")[..., None]
    return scaled, topology.spread(units, of)


def units_of(coordinates: Tensor, meshes: Tensor, num_meshes: int) -> Tensor:
    """(*batch, n) the units of n meshes, of positions (*batch, 3, V) with the mesh (V,) of each."""
    index = meshes.expand(coordinates.shape)
    least = coordinates.new_full((*coordinates.shape[:-1], num_meshes), torch.inf)
    lower = least.scatter_reduce(-1, index, coordinates, "amin")
    upper = (-least).scatter_reduce(-1, index, coordinates, "amax")
    return _unit((upper - lower).amax(-2), *ordinary_extents(coordinates.dtype))


def _unit(extents: Tensor, low: float, high: float) -> Tensor:
    """1 where an extent is ordinary, zero or no number; else what makes it about ``2 ** _TARGET``."""
    beyond = (extents > high) | ((extents < low) & (extents > 0.0))
    powers = torch.floor(torch.log2(extents)) - _TARGET
    least = math.log2(torch.finfo(extents.dtype).tiny) + 4.0
    return torch.exp2(torch.where(beyond, powers.clamp(min=least), 0.0))


def bring_to_unit(positions: Tensor, meshes: Tensor | None, num_meshes: int) -> Tensor:
    """Divides ``positions`` (3, B, V), coordinates first, in place, and returns the unit (B,).

    Where there is a mesh (V,) of each vertex, the units (B, n) of the n meshes.
    """
    if meshes is not None:
        units = units_of(positions.movedim(0, 1), meshes, num_meshes)
        positions.mul_(units.reciprocal().index_select(-1, meshes))
        return units
    if not positions.shape[-1]:
        return positions.new_ones(positions.shape[1])
    low, high = ordinary_extents(positions.dtype)
    unit = _unit((positions.amax(-1) - positions.amin(-1)).amax(0), low, high)
    positions.mul_(unit.reciprocal()[:, None])
    return unit
