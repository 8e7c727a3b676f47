"""Several meshes as one tensor of vertices and one joined topology."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import torch
from torch import Tensor

from .._loading import safe_to_load
from .._shown import shown
from ..errors import MeshError, ShapeError
from ..topology import Manifold, Topology


class Mesh(Protocol):
    """What has vertices and a topology, such as :class:`~torchfair.PolygonMesh` and the meshes of shapes."""

    @property
    def vertices(self) -> Tensor:
        """(V, 3)."""

    @property
    def topology(self) -> Topology:
        """Connectivity."""


@safe_to_load
@dataclass(frozen=True, eq=False)
class MeshBatch:
    """Meshes of different connectivity, as energies take them: ``energy(batch.vertices)`` has one value for each.

    It is a sequence of pairs ``(vertices, topology)``, one per mesh. Vertices keep their derivatives. Make it with
    :meth:`of`, :meth:`from_padded`, :func:`collate` in a ``DataLoader``, or from other libraries
    (:mod:`torchfair.conversions`).

    Attributes:
        vertices: (*batch, V, 3) positions, mesh after mesh; leading dimensions are states of all meshes.
        topology: from :meth:`Topology.join`.

    Raises:
        ShapeError: if the vertices do not fit the topology.
        MeshError: if the topology is not a joined one.

    Example:
        >>> from torchfair import NormalVariation
        >>> from torchfair.batches import MeshBatch
        >>> from torchfair.shapes import icosphere
        >>> batch = MeshBatch.of([icosphere(1), icosphere(2)])
        >>> NormalVariation(batch.topology)(batch.vertices).shape
        torch.Size([2])
    """

    vertices: Tensor
    topology: Topology

    def __post_init__(self) -> None:
        if not self.topology.is_joined:
            raise MeshError("MeshBatch takes a joined topology. Give MeshBatch.of([(vertices, topology)]) one mesh.")
        self.topology.check_vertices(self.vertices)

    @classmethod
    def of(cls, meshes: Iterable[Mesh | tuple[Tensor, Topology]]) -> MeshBatch:
        """A batch of meshes, each a pair ``(vertices (*batch, V, 3), topology)`` or an object that has both.

        Raises:
            ShapeError: naming the mesh whose vertices do not fit its topology, or do not go with those of the first.
            MeshError: if something else is among them, or the topologies cannot be joined.
        """
        pairs = [_pair(mesh, number) for number, mesh in enumerate(meshes)]
        for number, (vertices, topology) in enumerate(pairs):
            _check(vertices, topology, pairs[0][0], number)
        topology = Topology.join(topology for _, topology in pairs)
        parts = [vertices for vertices, _ in pairs] or [torch.zeros(0, 3)]
        return cls(torch.cat(parts, -2), topology)

    @classmethod
    def from_padded(
        cls, vertices: Tensor, faces: Tensor, num_vertices: Sequence[int] | Tensor | None = None
    ) -> MeshBatch:
        """A batch from rectangular tensors, as many libraries hold it.

        Args:
            vertices: (n, V, 3), each mesh padded to V vertices.
            faces: (n, F, k) vertex numbers within each mesh, padded with -1: whole rows for faces that are not there,
                ends of rows for faces with fewer corners. Or (F, k), the same for all.
            num_vertices: (n,) vertices that are there; by default all V, those that no face uses being isolated.

        Raises:
            ShapeError: if the shapes do not go together.
            MeshError: naming the mesh, for whatever :meth:`Topology.from_faces` refuses.
        """
        if vertices.ndim != 3 or vertices.shape[-1] != 3 or not vertices.is_floating_point():
            raise ShapeError("vertices", "a floating tensor (n, V, 3)", shown(vertices))
        count, most = vertices.shape[:2]
        if faces.ndim not in (2, 3) or (faces.ndim == 3 and faces.shape[0] != count) or faces.is_floating_point():
            raise ShapeError("faces", f"an integer tensor ({count}, F, k) or (F, k)", shown(faces))
        sizes = [most] * count if num_vertices is None else [int(size) for size in num_vertices]
        if len(sizes) != count or not all(0 <= size <= most for size in sizes):
            raise ShapeError("num_vertices", f"{count} numbers from 0 to {most}", sizes)
        every = faces if faces.ndim == 3 else faces.expand(count, *faces.shape)
        return mesh_from_lists([part[:size] for part, size in zip(vertices, sizes, strict=True)], list(every))

    def padded(self) -> tuple[Tensor, Tensor]:
        """Vertices (n, most vertices, 3), padded with 0, and faces (n, most faces, most corners), padded with -1.

        Raises:
            ShapeError: if the vertices have leading dimensions.
        """
        if self.vertices.ndim != 2:
            raise ShapeError("vertices", "(V, 3), without leading dimensions", shown(self.vertices))
        topology = self.topology
        vertex = _places(topology.vertex_meshes, len(self))
        points = self.vertices.new_zeros(len(self), max(topology.mesh_sizes, default=0), 3)
        points = points.index_put((topology.vertex_meshes, vertex), self.vertices)
        face = _places(topology.face_meshes, len(self))
        rows, columns = (int(t.max()) if t.numel() else 0 for t in (face + 1, topology.face_sizes))
        faces = torch.full((len(self), rows, columns), -1, dtype=torch.int64, device=topology.device)
        own = topology.corners - vertex_starts(topology)[topology.vertex_meshes[topology.corners]]
        column = torch.arange(topology.corners.shape[0], device=topology.device)
        column = column - topology.face_offsets[topology.corner_faces]
        faces[topology.face_meshes[topology.corner_faces], face[topology.corner_faces], column] = own
        return points, faces

    # ---- a sequence of meshes --------------------------------------------------------------------------

    def __len__(self) -> int:
        return self.topology.num_meshes

    def __iter__(self) -> Iterator[tuple[Tensor, Topology]]:
        parts = torch.split(self.vertices, self.topology.mesh_sizes, -2) if len(self) else ()
        return iter(list(zip(parts, self.topology.meshes, strict=True)))

    def __getitem__(self, number: int | slice) -> tuple[Tensor, Topology] | MeshBatch:
        """One mesh as a pair, or a batch of some."""
        pairs = list(self)
        return MeshBatch.of(pairs[number]) if isinstance(number, slice) else pairs[number]

    def with_vertices(self, vertices: Tensor) -> MeshBatch:
        """The same meshes with other positions (*batch, V, 3)."""
        return replace(self, vertices=vertices)

    # ---- moving ----------------------------------------------------------------------------------------

    def to(self, *args: Any, **kwargs: Any) -> MeshBatch:
        """Vertices as ``Tensor.to`` gives them, and the topology on their device."""
        vertices = self.vertices.to(*args, **kwargs)
        return MeshBatch(vertices, self.topology.to(vertices.device))

    def cpu(self) -> MeshBatch:
        """The same in the memory of the CPU."""
        return MeshBatch(self.vertices.cpu(), self.topology.cpu())

    def cuda(self, device: torch.device | str | int | None = None) -> MeshBatch:
        """The same on a GPU, the current one by default."""
        return MeshBatch(self.vertices.cuda(device), self.topology.cuda(device))

    def pin_memory(self) -> MeshBatch:
        """The same in page-locked memory; ``DataLoader(pin_memory=True)`` calls this."""
        return MeshBatch(self.vertices.pin_memory(), self.topology.pin_memory())

    def __repr__(self) -> str:
        return f"MeshBatch({len(self)} meshes, vertices {shown(self.vertices)}, {self.topology!r})"


def mesh_from_lists(
    vertices: Sequence[Tensor], faces: Sequence[object], *, manifold: Manifold = "vertices"
) -> MeshBatch:
    """A batch of meshes from lists of vertices (V, 3) and of faces in any form of :meth:`Topology.from_faces`.

    Raises:
        MeshError: naming the mesh, for whatever :meth:`Topology.from_faces` refuses.
    """
    if len(vertices) != len(faces):
        raise ShapeError("faces", f"{len(vertices)} of them, as many as vertices", len(faces))
    meshes = []
    for number, (points, some) in enumerate(zip(vertices, faces, strict=True)):
        try:
            topology = Topology.from_faces(some, points.shape[0], manifold=manifold)
        except MeshError as error:
            raise MeshError(f"mesh {number}: {error}") from None
        meshes.append((points, topology.to(points.device)))
    return MeshBatch.of(meshes)


def vertex_starts(topology: Topology) -> Tensor:
    """(n,) first vertex of each mesh of a joined topology."""
    assert topology.mesh_offsets is not None
    return topology.mesh_offsets[:-1]


def _places(meshes: Tensor, count: int) -> Tensor:
    """Place of each element within its mesh; elements lie mesh by mesh."""
    sizes = torch.zeros(count, dtype=torch.int64, device=meshes.device).index_add_(0, meshes, torch.ones_like(meshes))
    return torch.arange(meshes.shape[0], device=meshes.device) - (sizes.cumsum(0) - sizes)[meshes]


def taken_apart(mesh: object) -> tuple[Tensor, Topology] | None:
    """Vertices and topology of a pair of both, or of an object that has them; None of anything else."""
    if isinstance(mesh, Sequence) and len(mesh) == 2:
        vertices, topology = mesh
    else:
        vertices, topology = getattr(mesh, "vertices", None), getattr(mesh, "topology", None)
    return (vertices, topology) if isinstance(vertices, Tensor) and isinstance(topology, Topology) else None


def _pair(mesh: object, number: int) -> tuple[Tensor, Topology]:
    pair = taken_apart(mesh)
    if pair is None:
        raise MeshError(
            f"mesh {number} is neither a pair (vertices, topology) nor has attributes of these names: "
            f"{type(mesh).__name__}"
        )
    return pair


def _check(vertices: Tensor, topology: Topology, first: Tensor, number: int) -> None:
    lead, dtype = first.shape[:-2], first.dtype
    try:
        topology.check_vertices(vertices)
    except ShapeError as error:
        raise ShapeError(f"vertices of mesh {number}", f"(*batch, {topology.num_vertices}, 3)", str(error)) from None
    if vertices.shape[:-2] != lead or vertices.dtype != dtype:
        expected = f"leading dimensions {tuple(lead)} and {dtype}, as those of mesh 0"
        raise ShapeError(f"vertices of mesh {number}", expected, f"{tuple(vertices.shape)} {vertices.dtype}")
