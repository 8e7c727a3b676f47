"""A polygon mesh as it comes from a file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import torch
from numpy.typing import ArrayLike
from torch import Tensor

from .._names import FROM_ZERO, Names
from .._short_repr import short_repr
from ..errors import MeshError, ShapeError
from ..topology import Topology
from .obj_attributes import ObjAttributes
from .rhino_parts import RhinoParts

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class PolygonMesh:
    """Positions and connectivity together, for files, the command line and other programs.

    Everything else in torchfair takes ``vertices`` and ``topology`` apart, so that one topology serves many
    vertex tensors: ``vertices, topology = mesh``.

    Attributes:
        vertices: (V, 3) float64 positions in the unit of the file.
        topology: connectivity.
        repairs: what a repair did to the mesh of the file, in words; empty if nothing.
        notes: what is to be known of the mesh or the file beside, in words.
        names: what vertices and faces are called in the file, for messages.
        vertex_map: (V of the file,) number of each vertex of the file in this mesh, -1 where it was dropped; None if
            all are there in the order of the file.
        attributes: groups, materials, texture coordinates and the like of an OBJ file, or unit, layers and names of a
            3DM or DXF file, for :func:`save_mesh`; None without.
    """

    vertices: Tensor
    topology: Topology
    repairs: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    names: Names = FROM_ZERO
    vertex_map: Tensor | None = None
    attributes: ObjAttributes | RhinoParts | None = None

    __repr__ = short_repr

    def __post_init__(self) -> None:
        self.topology.check_vertices(self.vertices)

    def __iter__(self) -> Iterator[Any]:
        """Lets ``vertices, topology = mesh`` take it apart."""
        return iter((self.vertices, self.topology))

    @classmethod
    def from_arrays(
        cls, points: ArrayLike | Tensor, corners: ArrayLike, offsets: ArrayLike | None = None
    ) -> PolygonMesh:
        """A mesh from the arrays of another program; what comes in is copied.

        Args:
            points: (V, 3) positions, a tensor, an array or a list.
            corners: (H,) vertices of the faces, face after face; without offsets (F, k), all faces with k corners, or
                a list of faces.
            offsets: (F + 1,) where each face begins in ``corners``, and its length at last.

        Raises:
            MeshError: the faces are no oriented manifold mesh (:func:`torchfair.repair_mesh` mends what can be
                mended), or the arrays do not fit together.
            ShapeError: the points are no (V, 3) numbers.

        Example:
            >>> from torchfair import PolygonMesh
            >>> mesh = PolygonMesh.from_arrays([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2, 3]])
            >>> vertices, topology = mesh
            >>> vertices.shape, topology.num_edges
            (torch.Size([4, 3]), 4)
        """
        if isinstance(points, Tensor):
            given = points.detach().to("cpu", torch.float64, copy=True)
        else:
            given = torch.from_numpy(np.array(points, dtype=np.float64))
        if given.ndim != 2 or given.shape[1] != 3:
            raise ShapeError("points", "numbers (V, 3)", tuple(given.shape))
        if offsets is None:
            return cls(given, Topology.from_faces(corners, len(given)))
        packed, starts = _integers("corners", corners), _integers("offsets", offsets)
        if not starts.size or starts[0] != 0 or starts[-1] != packed.size or (np.diff(starts) < 0).any():
            raise MeshError(
                f"offsets must begin with 0, never fall and end with the number of corners, {packed.size}; there are "
                f"{starts.size}, from {starts[:1].tolist()} to {starts[-1:].tolist()}"
            )
        return cls(given, Topology.from_packed_faces(packed, starts, len(given)))

    def to_arrays(self) -> tuple[Floats, Ints, Ints]:
        """Points (V, 3), corners (H,) and offsets (F + 1,) as :meth:`from_arrays` takes them, copied."""
        tensors = (self.vertices.detach(), self.topology.corners, self.topology.face_offsets)
        points, corners, offsets = (tensor.cpu().numpy().copy() for tensor in tensors)
        return points, corners, offsets


def _integers(name: str, values: ArrayLike) -> Ints:
    numbers = np.asarray(values)
    if numbers.ndim != 1 or not (np.issubdtype(numbers.dtype, np.integer) or not numbers.size):
        raise MeshError(f"{name} must be one row of whole numbers, got {numbers.dtype} {numbers.shape}")
    return numbers.astype(np.int64)
