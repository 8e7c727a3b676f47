"""What principal meshing returns."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from torch import Tensor

from .._short_repr import short_repr
from ..topology import Topology
from .components import ReadSurface
from .mesh_creases import MeshCreases


@dataclass(frozen=True, eq=False)
class QuadMesh:
    """A mesh along principal directions.

    Attributes:
        vertices: (V, 3), in the dtype and on the device of the surface.
        topology: quads inside; at the boundary polygons too.
        singular_points: (n, 3) where the field is singular.
        singular_indices: (n,) its index there: 1/4 where three quads meet, -1/4 where five do.
        surface: what it was made from, with the principal directions that were found.
        creases: the edges along creases of the surface.
        report: what was measured, by name; see :func:`principal_quads`.
        notes: what was done beyond what was asked for, in words.
    """

    vertices: Tensor
    topology: Topology
    singular_points: Tensor
    singular_indices: Tensor
    surface: ReadSurface = field(repr=False)
    creases: MeshCreases
    report: dict[str, Any]
    notes: list[str] = field(default_factory=list)

    __repr__ = short_repr
