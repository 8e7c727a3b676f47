"""A good direction to look from when nobody says one."""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from torch import Tensor

from ..geometry import face_area_vectors
from ..topology import Topology

_ELEVATION = math.radians(38)
_AZIMUTH = math.radians(32)  # from the direction in which the long side is seen at full length
_SNAP = math.cos(math.radians(35))
_LEVEL = 0.2  # component of a unit vector below which its sign does not tell up from down
_OPEN = 0.3  # |sum of area vectors| / area, above which a mesh counts as a roof or wall rather than a closed body


class ViewDirection(NamedTuple):
    """Where to look from.

    Attributes:
        towards_eye: ``(3,)`` unit vector from the mesh to the eye.
        up: ``(3,)`` unit vector that appears vertical.
    """

    towards_eye: Tensor
    up: Tensor


def view_direction(vertices: Tensor, topology: Topology) -> ViewDirection:
    """A three-quarter view of one mesh ``(V, 3)`` from above.

    *Up* is the average face normal of an open mesh, the direction of least extent of a closed flat one, else z;
    within 35 degrees of a coordinate axis it is that axis. It points to positive coordinates (z, or y if it is
    nearly level in z) whatever the orientation of the faces. The eye is 38 degrees above the horizon and 32 degrees
    off the middle of the long side; of the four such places the one from which the largest part of the surface shows
    the same side. Meshes without area are seen as if they were symmetric about z. The result is float64 on the CPU.
    """
    area_vectors, areas, spread = _shape(vertices, topology)
    return _three_quarter(area_vectors, spread, _up(area_vectors, areas, spread))


def three_quarter_view(vertices: Tensor, topology: Topology, up: Tensor) -> ViewDirection:
    """The same of one mesh ``(V, 3)`` with another direction up, a unit vector (3,) float64."""
    area_vectors, _, spread = _shape(vertices, topology)
    return _three_quarter(area_vectors, spread, up)


def _shape(vertices: Tensor, topology: Topology) -> tuple[Tensor, Tensor, Tensor]:
    """Area vectors, areas, and second moments of the area."""
    points = vertices.detach().to("cpu", torch.float64)
    topology = topology.to("cpu")
    points = torch.where(torch.isfinite(points), points, 0)
    area_vectors = face_area_vectors(points, topology)
    areas = torch.linalg.vector_norm(area_vectors, dim=-1)
    centres = points.new_zeros(topology.num_faces, 3).index_add_(0, topology.corner_faces, points[topology.corners])
    return area_vectors, areas, _spread(centres / topology.face_sizes[:, None], areas)


def _three_quarter(area_vectors: Tensor, spread: Tensor, up: Tensor) -> ViewDirection:
    directions = _three_quarter_directions(up, spread)
    facing = area_vectors @ directions.T
    one_sided = facing.sum(0).abs() / facing.abs().sum(0).clamp(min=torch.finfo(torch.float64).tiny)
    return ViewDirection(directions[int((one_sided * 200).round().argmax())], up)


def _spread(centres: Tensor, areas: Tensor) -> Tensor:
    """``(3, 3)`` second moments of the area about its centroid."""
    weights = areas / areas.sum().clamp(min=torch.finfo(areas.dtype).tiny)
    offsets = centres - weights @ centres
    return (offsets * weights[:, None]).T @ offsets


def _up(area_vectors: Tensor, areas: Tensor, spread: Tensor) -> Tensor:
    normal = area_vectors.sum(0)
    length = torch.linalg.vector_norm(normal)
    moments, axes = torch.linalg.eigh(spread)
    vertical = torch.tensor([0.0, 0, 1], dtype=torch.float64)
    if length > _OPEN * areas.sum() and length > 0:
        up = normal / length
        if up[0].abs() > _SNAP:  # a wall: x is never up
            return vertical
    elif moments[0] < 0.5 * moments[1]:
        up = axes[:, 0]
    else:
        return vertical
    dominant = int(up.abs().argmax())
    if up[dominant].abs() > _SNAP:
        return torch.eye(3, dtype=torch.float64)[dominant]
    deciding = next(axis for axis in (2, 1, 0) if up[axis].abs() > _LEVEL)
    return torch.where(up[deciding] < 0, -up, up)


def _three_quarter_directions(up: Tensor, spread: Tensor) -> Tensor:
    """``(4, 3)`` directions to the eye, on all sides of the long axis."""
    side = torch.eye(3, dtype=torch.float64)[up.abs().argmin()]
    first = torch.linalg.cross(up, side)
    first = first / torch.linalg.vector_norm(first)
    plane = torch.stack([first, torch.linalg.cross(up, first)])
    moments, axes = torch.linalg.eigh(plane @ spread @ plane.T)
    long_axis = plane[0] if moments[0] > 0.9 * moments[1] else axes[:, 1] @ plane
    long_axis = long_axis * torch.sign(long_axis[long_axis.abs().argmax()])
    across = torch.linalg.cross(long_axis, up)
    turns = [(1, 1), (1, -1), (-1, 1), (-1, -1)]
    level = torch.stack([a * math.cos(_AZIMUTH) * across + b * math.sin(_AZIMUTH) * long_axis for a, b in turns])
    return math.cos(_ELEVATION) * level + math.sin(_ELEVATION) * up
