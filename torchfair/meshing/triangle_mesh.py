"""A triangle lattice along principal directions, with its principal edges."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from torch import Tensor

from ..principal import PrincipalEdges
from ..topology import Topology
from .mesh_creases import MeshCreases


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """Triangles of which one edge in three follows principal curvature lines.

    Attributes:
        vertices: (V, 3), in the dtype and on the device of the surface.
        principal: the principal edges, with the topology.
        singular_points: (n, 3) where the directions are singular.
        singular_indices: (n,) their index there: 1/2 where three triangles meet, -1/2 where nine do.
        creases: the edges along creases of the surface.
        report: what was measured, by name; see :func:`principal_triangles`.
        notes: what was done beyond what was asked for, in words.
    """

    vertices: Tensor
    principal: PrincipalEdges
    singular_points: Tensor
    singular_indices: Tensor
    creases: MeshCreases
    report: dict[str, Any]
    notes: list[str] = field(default_factory=list)

    @property
    def topology(self) -> Topology:
        """Triangles."""
        return self.principal.topology
