"""The smooth surface that the reflection of a mesh is compared with."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import torch
from torch import Tensor

from .._loading import safe_to_load
from .._one_mesh import one_mesh
from ..errors import TorchfairError
from ..geometry import vertex_normals
from ..shapes.principal_quads import parameter_quads
from ..shapes.surface import Surface
from ..topology import Topology

_CELLS = 160


@safe_to_load
@dataclass(frozen=True, eq=False)
class SmoothReference:
    """A mesh that mirrors with normals blended across its faces, as if it were smooth.

    Attributes:
        vertices: (V, 3) positions.
        topology: connectivity.
        normals: (V, 3) unit normals of the surface at the vertices.
    """

    vertices: Tensor
    topology: Topology
    normals: Tensor

    @classmethod
    def of_mesh(cls, vertices: Tensor, topology: Topology) -> SmoothReference:
        """A mesh (V, 3) with its own vertex normals (:func:`torchfair.geometry.vertex_normals`).

        Raises:
            ShapeError: if ``vertices`` is not one mesh that fits the topology.
            TorchfairError: if a vertex is not finite.
        """
        return cls(one_finite_mesh(vertices, topology), topology, vertex_normals(vertices.detach(), topology))

    @classmethod
    def of_surface(cls, surface: Surface, cells: int = _CELLS) -> SmoothReference:
        """An analytic surface, sampled by ``cells x cells`` quads with its exact normals.

        The direction mirrored between samples is off by the square of the turn of the normal over half a cell: by
        2e-4 for a half turn over 160 cells.

        Raises:
            MeshError: if ``cells`` is too small for the surface to close up.
        """
        mesh = parameter_quads(surface, cells, cells)
        normals = mesh.normals
        blended = vertex_normals(mesh.vertices, mesh.topology)  # at poles, where parameters give none
        exact = torch.isfinite(normals).all(-1, keepdim=True)
        return cls(mesh.vertices, mesh.topology, torch.where(exact, normals, blended))


Reference: TypeAlias = SmoothReference | Surface | tuple[Tensor, Topology]
"""What a mesh can be compared with."""


def smooth_reference(reference: Reference, cells: int = _CELLS) -> SmoothReference:
    """The reference itself, a surface sampled by ``cells x cells`` quads, or a mesh with its vertex normals.

    Raises:
        ShapeError: if the vertices of a mesh are not one mesh that fits its topology.
        TorchfairError: if a vertex is not finite, or for anything else.
    """
    if isinstance(reference, SmoothReference):
        return reference
    if isinstance(reference, Surface):
        return SmoothReference.of_surface(reference, cells)
    if isinstance(reference, tuple) and len(reference) == 2 and isinstance(reference[1], Topology):
        return SmoothReference.of_mesh(*reference)
    raise TorchfairError(
        "reference must be a mesh (vertices, topology), an analytic surface or a SmoothReference, "
        f"got {type(reference).__name__}"
    )


def one_finite_mesh(vertices: Tensor, topology: Topology) -> Tensor:
    """Positions (V, 3) of one mesh, detached.

    Raises:
        ShapeError: if they are a batch, or do not fit the topology.
        TorchfairError: if one is not finite.
    """
    vertices = one_mesh(vertices, topology)
    if not bool(torch.isfinite(vertices).all()):
        raise TorchfairError("a vertex is not finite: pictures need positions without NaN and infinity")
    return vertices
