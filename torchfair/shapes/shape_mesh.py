"""A mesh together with the analytic surface it is inscribed in."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from torchfair.errors import MeshError
from torchfair.topology import Topology

from .._short_repr import short_repr
from ._checks import is_integer_from
from .surface import Surface

Direction = Literal["u", "v"]
Points = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ShapeMesh:
    """Vertices on an analytic surface, faces oriented like its normals.

    Attributes:
        vertices: (V, 3) float64 positions on the surface.
        topology: connectivity; faces run counterclockwise seen from the side of the surface normal.
        parameters: (V, 2) float64 parameters u, v. In periodic directions each vertex has one value of a
            period, so faces across the seam span a jump.
        surface: the surface.
    """

    vertices: Tensor
    topology: Topology
    parameters: Tensor
    surface: Surface

    __repr__ = short_repr

    @property
    def normals(self) -> Tensor:
        """(V, 3) unit normals of the surface at the vertices."""
        return self.surface.normal(*self.parameters.unbind(-1))

    @property
    def principal_curvatures(self) -> Tensor:
        """(V, 2) principal curvatures of the surface at the vertices, signed, the larger first."""
        return self.surface.principal_curvatures(*self.parameters.unbind(-1))

    @property
    def principal_directions(self) -> Tensor:
        """(V, 2, 3) unit principal directions of the surface at the vertices, in the order of the curvatures."""
        return self.surface.principal_directions(*self.parameters.unbind(-1))

    def edges_along(self, direction: Direction) -> Tensor:
        """(E,) bool: edges on a parameter line, ``"u"`` for those along which v is constant.

        On principal quads either family, on principal triangles the principal edges. Edges that end in a pole
        run along v.
        """
        constant = _axis(direction, other=True)
        values = self.parameters[self.topology.edges, constant]
        low, high = self.surface.domain[constant]
        same = (values[:, 0] - values[:, 1]).abs() <= 1e-9 * (high - low)
        at_pole = self._is_pole[self.topology.edges].any(1)
        return same & ~at_pole if direction == "u" else same | at_pole

    @property
    def _is_pole(self) -> Tensor:
        v, (start, end) = self.parameters[:, 1], self.surface.domain[1]
        at_start, at_end = (
            (v - value).abs() <= 1e-12 * (end - start) if is_pole else torch.zeros_like(v, dtype=torch.bool)
            for value, is_pole in zip((start, end), self.surface.poles, strict=True)
        )
        return at_start | at_end


def _axis(direction: str, *, other: bool = False) -> int:
    """Column of the parameters; errors on anything but "u" and "v"."""
    if direction not in ("u", "v"):
        raise MeshError(f'direction must be "u" or "v", got {direction!r}')
    return ("u", "v").index(direction) ^ other


def build_mesh(surface: Surface, parameters: Points, faces: object) -> ShapeMesh:
    """The mesh with the given vertex parameters ``(V, 2)`` and faces."""
    tensor = torch.from_numpy(np.ascontiguousarray(parameters, np.float64))
    topology = Topology.from_faces(faces, num_vertices=len(tensor))
    return ShapeMesh(surface.position(tensor[:, 0], tensor[:, 1]), topology, tensor, surface)


def check_count(name: str, value: int, least: int, why: str) -> None:
    """Raises MeshError unless ``value`` is an integer of at least ``least``."""
    if not is_integer_from(least, value):
        raise MeshError(f"{name} must be an integer of at least {least} ({why}), got {value!r}")
