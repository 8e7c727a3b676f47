"""Who is beside whom in a polygon mesh: index tensors only, built and checked once."""

from __future__ import annotations

import hashlib
import itertools
from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np
import torch
from torch import Tensor

from . import _connectivity
from ._loading import safe_to_load
from ._names import PlacedError, few
from ._tables import cached_table
from .errors import MeshError, ShapeError

_EAGER_TABLES = ("face_sizes", "is_triangular", "is_quadrangular", "faces_by_size", "next_corners", "valences",
                 "is_boundary_vertex")  # fmt: skip


@safe_to_load
@dataclass(frozen=True, eq=False, repr=False)
class Topology:
    r"""Connectivity of an oriented manifold polygon mesh, with or without boundary.

    Build it with :meth:`from_faces`. It holds no positions: one topology serves any number of vertex
    tensors ``(*batch, V, 3)``. All tensors are int64 (masks are bool) and live on :attr:`device`.

    Packed lists (faces, rings, loops) are a flat tensor with an offset tensor: item ``i`` is
    ``flat[offsets[i]:offsets[i + 1]]``.

    Edges are numbered with interior edges first, then boundary edges, each group sorted by its two vertex
    numbers. Edge ``(v, w)`` has its left face on the side that is traversed ``v -> w`` counterclockwise::

              v ------ left face above, traversed v -> w
              |        right face below
              w

    Attributes:
        num_vertices: V, isolated vertices included.
        corners: (H,) vertex at every face corner, face after face.
        face_offsets: (F+1,) first corner of each face.
        corner_faces: (H,) face of each corner.
        corner_edges: (H,) edge from a corner to the next corner of its face.
        edges: (E, 2) vertices ``v, w`` of every edge.
        interior_edge_faces: (I, 2) left and right face of the interior edges.
        ring_vertices, ring_offsets: (R,) and (V+1,) neighbours of each vertex, counterclockwise; around a boundary
            vertex from the boundary edge with the surface on its left to the other one.
        loop_vertices, loop_offsets: (B,) and (L+1,), boundary loops with the surface on the left.
    """

    num_vertices: int
    corners: Tensor
    face_offsets: Tensor
    corner_faces: Tensor
    corner_edges: Tensor
    edges: Tensor
    interior_edge_faces: Tensor
    ring_vertices: Tensor
    ring_offsets: Tensor
    loop_vertices: Tensor
    loop_offsets: Tensor

    def __post_init__(self) -> None:
        # Tables that quantities read are filled now: one that is first read inside nested function transforms
        # would keep a tensor that belongs to the transform.
        if self.device.type != "meta":
            for name in _EAGER_TABLES:
                getattr(self, name)

    @classmethod
    def from_faces(cls, faces: object, num_vertices: int | None = None) -> Topology:
        """Topology of ``faces``.

        Args:
            faces: ``(F, k)`` integer array or tensor, or a sequence of index sequences of any lengths.
            num_vertices: V; by default one more than the largest index.

        Raises:
            MeshError: naming the first few offending elements and the remedy, if a face has fewer than
                three corners or a repeated one, an index is out of range, an edge has more than two faces
                or is traversed twice in one direction, or the faces around a vertex form several fans.
                :func:`torchfair.repair_mesh` mends what can be mended.
        """
        return cls.from_packed_faces(*_connectivity.pack_faces(faces), num_vertices)

    @classmethod
    @torch.inference_mode(False)
    def from_packed_faces(
        cls, corners: _connectivity.Ints, face_offsets: _connectivity.Ints, num_vertices: int | None = None
    ) -> Topology:
        """Like :meth:`from_faces`, from numpy arrays (copied) as in attributes ``corners`` and ``face_offsets``."""
        half = _connectivity.build_half_edges(corners.copy(), face_offsets.copy(), num_vertices)
        edges = _connectivity.build_edges(half)
        ring, ring_offsets = _connectivity.build_rings(half, edges)
        loops, loop_offsets = _connectivity.build_boundary_loops(half, edges)
        arrays = {
            "corners": half.corners,
            "face_offsets": half.offsets,
            "corner_faces": half.faces,
            "corner_edges": edges.corner_edges,
            "edges": edges.vertices,
            "interior_edge_faces": edges.faces,
            "ring_vertices": ring,
            "ring_offsets": ring_offsets,
            "loop_vertices": loops,
            "loop_offsets": loop_offsets,
        }
        tensors = {name: torch.from_numpy(np.ascontiguousarray(a, np.int64)) for name, a in arrays.items()}
        return cls(num_vertices=half.num_vertices, **tensors)

    def __getstate__(self) -> dict[str, object]:
        """What copies and pickles hold: no tables that are made of it."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    def __setstate__(self, state: dict[str, object]) -> None:
        self.__dict__.update(state)
        self.__post_init__()

    # ---- sizes -----------------------------------------------------------------------------------------

    @property
    def num_faces(self) -> int:
        """F."""
        return self.face_offsets.shape[0] - 1

    @property
    def num_edges(self) -> int:
        """E, boundary edges included."""
        return self.edges.shape[0]

    @property
    def num_interior_edges(self) -> int:
        """I, edges with a face on either side; they carry the numbers 0..I-1."""
        return self.interior_edge_faces.shape[0]

    @property
    def device(self) -> torch.device:
        """Where the index tensors live."""
        return self.edges.device

    @cached_table
    def face_sizes(self) -> Tensor:
        """(F,) number of corners."""
        return self.face_offsets.diff()

    @cached_table
    def is_triangular(self) -> bool:
        """Whether every face is a triangle."""
        return bool((self.face_sizes == 3).all())

    @cached_table
    def is_quadrangular(self) -> bool:
        """Whether every face has four corners."""
        return bool((self.face_sizes == 4).all())

    def __repr__(self) -> str:
        kind = "triangle" if self.is_triangular else "quad" if self.is_quadrangular else "polygon"
        return (
            f"Topology({kind} mesh: {self.num_vertices} vertices, {self.num_edges} edges "
            f"({self.num_edges - self.num_interior_edges} on the boundary), {self.num_faces} faces)"
        )

    @cached_table
    def fingerprint(self) -> str:
        """Checksum of the faces and of V, equal where faces and corners are equal in equal order."""
        digest = hashlib.sha256(str(self.num_vertices).encode())
        for tensor in (self.corners, self.face_offsets):
            digest.update(tensor.cpu().numpy().tobytes())
        return digest.hexdigest()

    # ---- edges -----------------------------------------------------------------------------------------

    @property
    def interior_edges(self) -> Tensor:
        """(I, 2) vertices ``v, w``."""
        return self.edges[: self.num_interior_edges]

    @property
    def boundary_edges(self) -> Tensor:
        """(E-I, 2) vertices ``v, w``, the surface on the left."""
        return self.edges[self.num_interior_edges :]

    @cached_table
    def triangles(self) -> Tensor:
        """(F, 3) faces of a triangle mesh.

        Raises:
            MeshError: if a face is not a triangle.
        """
        self.require_triangles()
        return self.corners.view(-1, 3)

    @cached_table
    def edge_flaps(self) -> Tensor:
        """(I, 4) vertices ``v, w, a, b`` of each interior edge of a triangle mesh.

        ``v, w`` are the edge, ``a`` is opposite in the left face and ``b`` opposite in the right face.

        Raises:
            MeshError: if a face is not a triangle.
        """
        triangles = self.triangles
        v, w = self.interior_edges.unbind(1)
        opposite = triangles[self.interior_edge_faces].sum(-1) - (v + w)[:, None]
        return torch.stack([v, w, opposite[:, 0], opposite[:, 1]], dim=1)

    # ---- faces -----------------------------------------------------------------------------------------

    @cached_table
    def next_corners(self) -> Tensor:
        """(H,) the next corner of the same face, counterclockwise."""
        following = torch.arange(1, self.corners.shape[0] + 1, device=self.device)
        following[self.face_offsets[1:] - 1] = self.face_offsets[:-1]
        return following

    @cached_table
    def faces_by_size(self) -> dict[int, tuple[Tensor, Tensor]]:
        """Faces grouped by number of corners, ``{k: (face numbers (n,), corners (n, k))}``."""
        groups: dict[int, tuple[Tensor, Tensor]] = {}
        for size in torch.unique(self.face_sizes).tolist():
            numbers = torch.nonzero(self.face_sizes == size).squeeze(1)
            columns = torch.arange(size, device=self.device)
            groups[size] = (numbers, self.corners[self.face_offsets[numbers, None] + columns])
        return groups

    def face_lists(self) -> list[list[int]]:
        """Faces as lists of vertex numbers, in order."""
        flat, offsets = self.corners.tolist(), self.face_offsets.tolist()
        return [flat[a:b] for a, b in itertools.pairwise(offsets)]

    # ---- vertices --------------------------------------------------------------------------------------

    @cached_table
    def valences(self) -> Tensor:
        """(V,) number of edges at each vertex; 0 for isolated vertices."""
        return self.ring_offsets.diff()

    @cached_table
    def is_boundary_vertex(self) -> Tensor:
        """(V,) bool."""
        mask = torch.zeros(self.num_vertices, dtype=torch.bool, device=self.device)
        mask[self.loop_vertices] = True
        return mask

    @cached_table
    def rings_by_valence(self) -> dict[int, tuple[Tensor, Tensor]]:
        """Interior vertices grouped by valence, ``{k: (vertices (n,), ring (n, k))}``, rings counterclockwise."""
        interior = ~self.is_boundary_vertex & (self.valences > 0)
        groups: dict[int, tuple[Tensor, Tensor]] = {}
        for valence in torch.unique(self.valences[interior]).tolist():
            vertices = torch.nonzero(interior & (self.valences == valence)).squeeze(1)
            columns = torch.arange(valence, device=self.device)
            groups[valence] = (vertices, self.ring_vertices[self.ring_offsets[vertices, None] + columns])
        return groups

    def boundary_loops(self) -> list[Tensor]:
        """Boundary loops as vertex tensors, the surface on the left, each starting at its smallest vertex."""
        return list(torch.split(self.loop_vertices, self.loop_offsets.diff().tolist()))

    # ---- moving and checking ---------------------------------------------------------------------------

    @torch.inference_mode(False)
    def map_tensors(self, function: Callable[[Tensor], Tensor]) -> Topology:
        """A copy with ``function`` applied to every index tensor (used to move devices)."""
        changed = {f.name: function(getattr(self, f.name)) for f in fields(self) if f.name != "num_vertices"}
        return Topology(self.num_vertices, **changed)

    def to(self, device: torch.device | str) -> Topology:
        """The same topology with its tensors on ``device``."""
        return self.map_tensors(lambda tensor: tensor.to(device))

    def require_triangles(self) -> None:
        """Raises MeshError naming the first faces that are not triangles."""
        if not self.is_triangular:
            others = torch.nonzero(self.face_sizes != 3).squeeze(1).tolist()
            raise PlacedError(
                f"a triangle mesh is needed, but {len(others)} face(s) are not triangles: faces ",
                few("face", others),
                ". Triangulate them first.",
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
