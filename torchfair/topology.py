"""Who is beside whom in a polygon mesh: index tensors only, built and checked once."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields
from typing import Any, Literal, get_args

import numpy as np
import torch
from torch import Tensor

from . import _connectivity, _joined_topology
from ._joined_tables import JOINED_TABLES
from ._loading import safe_to_load
from ._packed_tensors import pack, unpack
from ._tables import cached_table, outside_of_transforms
from ._topology_tables import CHEAP_TABLES, FANS, MeshTables
from .errors import MeshError, ShapeError

Manifold = Literal["vertices", "edges"]


@safe_to_load
@dataclass(frozen=True, eq=False, repr=False)
class Topology(MeshTables):
    r"""Connectivity of an oriented manifold polygon mesh, with or without boundary; or of several, joined.

    Build it with :meth:`from_faces`, or with :meth:`join` from others. It holds no positions: one topology serves any
    number of vertex tensors ``(*batch, V, 3)``. All tensors are int64 (masks are bool) and live on :attr:`device`.

    Packed lists (faces, rings, loops) are a flat tensor with an offset tensor: item ``i`` is
    ``flat[offsets[i]:offsets[i + 1]]``. Rings, loops and all that is made of them are worked out when first asked for.

    Edges are numbered with interior edges first, then boundary edges, each group sorted by its two vertex
    numbers. Edge ``(v, w)`` has its left face on the side that is traversed ``v -> w`` counterclockwise::

              v ------ left face above, traversed v -> w
              |        right face below
              w

    Topologies are equal if they have the same faces, corners and vertices in the same order (and are joined of the
    same meshes), on whatever device. Copies and pickles hold one packed tensor.

    Attributes:
        num_vertices: V, isolated vertices included.
        corners: (H,) vertex at every face corner, face after face.
        face_offsets: (F+1,) first corner of each face.
        corner_faces: (H,) face of each corner.
        corner_edges: (H,) edge from a corner to the next corner of its face.
        edges: (E, 2) vertices ``v, w`` of every edge.
        interior_edge_faces: (I, 2) left and right face of the interior edges.
        mesh_offsets: (n+1,) first vertex of each of n joined meshes; None for one mesh.
    """

    num_vertices: int
    corners: Tensor
    face_offsets: Tensor
    corner_faces: Tensor
    corner_edges: Tensor
    edges: Tensor
    interior_edge_faces: Tensor
    mesh_offsets: Tensor | None = None

    def __post_init__(self) -> None:
        # Tables that quantities read are filled now: torch.compile could not make those that depend on values.
        if self.device.type != "meta":
            for name in CHEAP_TABLES + (JOINED_TABLES if self.is_joined else ()):
                getattr(self, name)

    # ---- building --------------------------------------------------------------------------------------

    @classmethod
    def from_faces(cls, faces: object, num_vertices: int | None = None, *, manifold: Manifold = "vertices") -> Topology:
        """Topology of ``faces``.

        Args:
            faces: ``(F, k)`` integer array or tensor, or a sequence of index sequences of any lengths. Corners -1 at
                the end of a row of an array are padding.
            num_vertices: V; by default one more than the largest index.
            manifold: where the mesh is to be a manifold. With ``"edges"`` faces may touch in a vertex without sharing
                an edge there: what needs edges only works (lengths, angles, normals, E and E', areas, umbrellas), and
                what needs rings or boundary loops (stars, C, polylines) refuses with MeshError. It is also the
                quickest way to build: rings are looked at when they are asked for.

        Raises:
            MeshError: naming the first few offending elements and the remedy, if a face has fewer than
                three corners or a repeated one, an index is out of range, an edge has more than two faces
                or is traversed twice in one direction, or (unless ``manifold="edges"``) the faces around a vertex form
                several fans. :func:`torchfair.repair_mesh` mends what can be mended.
        """
        return cls.from_packed_faces(*_connectivity.pack_faces(faces), num_vertices, manifold=manifold)

    @classmethod
    def from_packed_faces(
        cls,
        corners: _connectivity.Ints,
        face_offsets: _connectivity.Ints,
        num_vertices: int | None = None,
        *,
        manifold: Manifold = "vertices",
    ) -> Topology:
        """Like :meth:`from_faces`, from numpy arrays (copied) as in attributes ``corners`` and ``face_offsets``."""
        if manifold not in get_args(Manifold):
            raise MeshError(f'manifold must be "vertices" or "edges", got {manifold!r}')
        return cls._of_own_faces(corners.copy(), face_offsets.copy(), num_vertices, manifold)

    @classmethod
    def _of_own_faces(
        cls,
        corners: _connectivity.Ints,
        face_offsets: _connectivity.Ints,
        num_vertices: int | None,
        manifold: Manifold = "vertices",
    ) -> Topology:
        """Like :meth:`from_packed_faces`, of arrays that nobody else writes to."""
        half = _connectivity.build_half_edges(corners, face_offsets, num_vertices)
        edges = _connectivity.build_edges(half)
        arrays = {
            "corners": half.corners,
            "face_offsets": half.offsets,
            "corner_faces": half.faces,
            "corner_edges": edges.corner_edges,
            "edges": edges.vertices,
            "interior_edge_faces": edges.faces,
        }
        if manifold == "vertices":
            _connectivity.check_fans(half, edges.twins)
        with outside_of_transforms():
            tensors = {name: torch.from_numpy(np.ascontiguousarray(a, np.int64)) for name, a in arrays.items()}
            topology = cls(num_vertices=half.num_vertices, **tensors)
            topology.__dict__.update({"twins": torch.from_numpy(edges.twins), FANS: manifold == "vertices"})
        return topology

    @classmethod
    def join(cls, topologies: Iterable[Topology]) -> Topology:
        """One topology of several meshes side by side, of which each is seen by itself.

        Vertices, faces, and edges of either kind follow each other mesh by mesh; vertices are ``torch.cat`` of those of
        the meshes. Energies, penalties and scores have one value per mesh, ``(*batch, n)``: those of the meshes alone.
        Topologies that are joined already are taken apart first; none at all make a topology of no meshes.
        :class:`~torchfair.batches.MeshBatch` keeps vertices with it, and :attr:`meshes` takes it apart.

        Raises:
            MeshError: if there is anything else among them, or they are on several devices.

        Example:
            >>> import torch
            >>> from torchfair import NormalVariation, Topology
            >>> from torchfair.shapes import icosphere
            >>> meshes = [icosphere(1), icosphere(2)]
            >>> energy = NormalVariation(Topology.join(m.topology for m in meshes))
            >>> energy(torch.cat([m.vertices for m in meshes])).shape
            torch.Size([2])
        """
        parts = _joined_topology.checked_parts(topologies, cls)
        with outside_of_transforms():
            joined = cls(sum(part.num_vertices for part in parts), **_joined_topology.joined_tensors(parts))
        joined.__dict__[FANS] = all(part.has_fans for part in parts)
        return joined

    @cached_table
    def meshes(self) -> tuple[Topology, ...]:
        """The topologies of the meshes that this one is joined of, in order; itself if it is one mesh."""
        if not self.is_joined:
            return (self,)
        parts = tuple(Topology(count, **tensors) for count, tensors in _joined_topology.split_tensors(self))
        for part in parts:
            part.__dict__[FANS] = self.has_fans
        return parts

    # ---- comparing, copying and moving -----------------------------------------------------------------

    def __repr__(self) -> str:
        kind = "triangle" if self.is_triangular else "quad" if self.is_quadrangular else "polygon"
        mesh = f"{self.num_meshes} {kind} meshes" if self.is_joined else f"{kind} mesh"
        return (
            f"Topology({mesh}: {self.num_vertices} vertices, {self.num_edges} edges "
            f"({self.num_edges - self.num_interior_edges} on the boundary), {self.num_faces} faces)"
        )

    @cached_table
    def fingerprint(self) -> str:
        """Checksum of the faces, of V and of what is joined, equal for equal topologies."""
        digest = hashlib.sha256(str(self.num_vertices).encode())
        for tensor in (self.corners, self.face_offsets, self.mesh_offsets):
            if tensor is not None:
                digest.update(tensor.cpu().numpy().tobytes())
        return digest.hexdigest()

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Topology):
            return NotImplemented
        if self is other:
            return True
        if self.num_vertices != other.num_vertices or self.is_joined != other.is_joined:
            return False
        pairs = [(self.corners, other.corners), (self.face_offsets, other.face_offsets)]
        if self.mesh_offsets is not None and other.mesh_offsets is not None:
            pairs.append((self.mesh_offsets, other.mesh_offsets))
        return all(torch.equal(ours, theirs.to(ours.device)) for ours, theirs in pairs)

    def __hash__(self) -> int:
        return hash(self.fingerprint)

    def __getstate__(self) -> dict[str, object]:
        """What copies and pickles hold: one tensor, so that processes share one file; no tables that are made of it."""
        tensors = {f.name: getattr(self, f.name) for f in fields(self) if f.name != "num_vertices"}
        packed = pack({name: tensor for name, tensor in tensors.items() if tensor is not None})
        return {"num_vertices": self.num_vertices, "has_fans": self.has_fans, **packed}

    def __setstate__(self, state: dict[str, object]) -> None:
        known = {"mesh_offsets": None, "num_vertices": state["num_vertices"], FANS: state["has_fans"]}
        self.__dict__.update(known)
        with outside_of_transforms():
            self.__dict__.update(unpack(state))
            self.__post_init__()

    def map_tensors(self, function: Callable[[Tensor], Tensor]) -> Topology:
        """A copy with ``function`` applied to every index tensor (used to move devices)."""
        with outside_of_transforms():
            tensors = {f.name: getattr(self, f.name) for f in fields(self) if f.name != "num_vertices"}
            changed: dict[str, Any] = {
                name: None if tensor is None else function(tensor) for name, tensor in tensors.items()
            }
            moved = Topology(self.num_vertices, **changed)
        moved.__dict__[FANS] = self.has_fans
        return moved

    def to(self, device: torch.device | str) -> Topology:
        """The same topology with its tensors on ``device``; itself where they are there."""
        if self.device == torch.device(device):
            return self
        return self.map_tensors(lambda tensor: tensor.to(device))

    def cpu(self) -> Topology:
        """The same topology in the memory of the CPU."""
        return self.to("cpu")

    def cuda(self, device: torch.device | str | int | None = None) -> Topology:
        """The same topology on a GPU, the current one by default."""
        return self.map_tensors(lambda tensor: tensor.cuda(device))

    def pin_memory(self) -> Topology:
        """The same topology in page-locked memory, from where it goes to a GPU faster; ``DataLoader`` calls this."""
        return self.map_tensors(Tensor.pin_memory)

    # ---- checking --------------------------------------------------------------------------------------

    def require_one_mesh(self, what: str) -> None:
        """Raises MeshError if several meshes are joined; ``what`` cannot take them."""
        if self.is_joined:
            raise MeshError(
                f"{what} takes one mesh, but {self.num_meshes} are joined. Call it for each: "
                "Topology.meshes and MeshBatch take them apart."
            )

    def check_vertices(self, vertices: Tensor) -> None:
        """Raises ShapeError unless ``vertices`` is a floating tensor ``(*batch, V, 3)``. Values are not read."""
        if not isinstance(vertices, Tensor):
            raise self._vertices_error(type(vertices).__name__)
        if vertices.shape[-2:] != (self.num_vertices, 3) or not vertices.is_floating_point():
            raise self._vertices_error(f"{tuple(vertices.shape)} {vertices.dtype}")

    def check_interior_edges(self, edges: Tensor, what: str = "") -> None:
        """Raises MeshError unless ``edges`` (n,) are numbers of interior edges; ``what`` they are for comes first."""
        count = self.num_interior_edges
        wrong = edges[(edges < 0) | (edges >= count)]
        if wrong.numel():
            raise MeshError(f"{what}interior edges are numbered 0 to {count - 1}, got {wrong[:5].tolist()}")

    def _vertices_error(self, actual: str) -> ShapeError:
        # Written only when it is raised: torch.compile cannot format sizes that it holds as symbols.
        return ShapeError("vertices", f"a floating tensor (*batch, {self.num_vertices}, 3)", actual)
