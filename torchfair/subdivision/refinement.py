"""One subdivision step, or several in one: the fine mesh, the map to it, and what stems from what."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum
from functools import cached_property

import scipy.sparse as sp
import torch
from torch import Tensor

from ..errors import MeshError, ShapeError
from ..geometry._ops import gather, scatter_sum
from ..topology import Topology
from . import _labels


class Origin(IntEnum):
    """What a vertex of the fine mesh stems from."""

    VERTEX = 0
    EDGE = 1
    FACE = 2


@dataclass(frozen=True, eq=False, repr=False)
class Refinement:
    """A finer mesh whose vertices are fixed linear combinations of those of a coarse one.

    Made by :func:`loop`, :func:`catmull_clark`, :func:`hybrid`, :func:`midpoint` and :func:`refine`. Like a
    :class:`Topology` it holds no positions. V, E, F count vertices, edges and faces of the coarse mesh, V', E', F'
    those of the fine one.

    Vertices of the fine mesh after one step: the old ones with their old numbers, then one for every edge in the
    order of ``coarse.edges``, then one for every face that has a vertex in its middle, in the order of the faces.
    The faces of the fine mesh follow the order of their parents and keep their orientation; boundary loops keep
    their order, direction and first vertex.

    Attributes:
        coarse: the mesh that was refined.
        topology: the fine mesh.
        matrix: (V', V) float64 SciPy CSR array. Its rows sum to 1, so it commutes with affine maps.
        face_parents: (F',) coarse face that each fine face lies in.
        vertex_origins: (V', 2) for each fine vertex the kind (:class:`Origin`) and the number of the coarse vertex,
            edge or face that it stems from.
        edge_parents: (E',) coarse edge that each fine edge is a part of; -1 for edges inside coarse faces.
        edge_parallels: (E', 2) coarse edges that a fine edge runs along: its parent twice; in a triangle cut into
            four, the side that it is parallel to, twice; in a quad cut into four, the two opposite sides that it
            lies between. -1, -1 for other edges.
    """

    coarse: Topology
    topology: Topology
    matrix: sp.csr_array
    face_parents: Tensor
    vertex_origins: Tensor
    edge_parents: Tensor
    edge_parallels: Tensor

    def __post_init__(self) -> None:
        _ = self._entries  # now, not while apply is traced

    @cached_property
    def _entries(self) -> tuple[Tensor, Tensor, Tensor]:
        """Rows, columns and weights of the matrix on the device of the topology."""
        entries = self.matrix.tocoo()
        parts = [torch.from_numpy(part) for part in (entries.row, entries.col, entries.data)]
        rows, columns, weights = (part.to(self.coarse.device) for part in parts)
        return rows.long(), columns.long(), weights

    def __repr__(self) -> str:
        return f"Refinement({self.coarse!r} -> {self.topology!r})"

    def apply(self, vertices: Tensor) -> Tensor:
        """Values at the vertices of the fine mesh, ``matrix @ vertices``.

        Args:
            vertices: (*batch, V, d) floating: positions, or anything else that is to be subdivided like them, such
                as parameters; on the device of the topology.

        Returns:
            (*batch, V', d) in the same dtype. Linear and differentiable any number of times. Vertices that stay are
            copied without rounding; NaN spreads to what is computed from it and no farther.

        Raises:
            ShapeError: if ``vertices`` is not a floating tensor (*batch, V, d).
        """
        if not isinstance(vertices, Tensor):
            raise self._error(type(vertices).__name__)
        if vertices.ndim < 2 or vertices.shape[-2] != self.coarse.num_vertices or not vertices.is_floating_point():
            raise self._error(f"{tuple(vertices.shape)} {vertices.dtype}")
        rows, columns, weights = self._entries
        terms = gather(vertices, columns) * weights.to(vertices.dtype)[:, None]
        return scatter_sum(terms, rows, self.topology.num_vertices)

    def _error(self, actual: str) -> ShapeError:
        return ShapeError("vertices", f"a floating tensor (*batch, {self.coarse.num_vertices}, d)", actual)

    def to(self, device: torch.device | str) -> Refinement:
        """The same refinement with its tensors on ``device``; ``matrix`` stays where it is."""
        names = ("coarse", "topology", "face_parents", "vertex_origins", "edge_parents", "edge_parallels")
        return replace(self, **{name: getattr(self, name).to(device) for name in names})

    def then(self, finer: Refinement) -> Refinement:
        """This step and ``finer`` after it, in one. Origins and parents are those in the coarse mesh of this step.

        Raises:
            MeshError: if ``finer`` does not start from the topology that this step leads to.
        """
        if not _same_faces(self.topology, finer.coarse):
            raise MeshError(
                f"{finer!r} does not start where {self!r} ends. Refine the attribute topology of the first step."
            )
        return Refinement(
            coarse=self.coarse,
            topology=finer.topology,
            matrix=sp.csr_array(finer.matrix @ self.matrix),
            face_parents=self.face_parents[finer.face_parents],
            vertex_origins=_labels.compose_origins(self, finer.vertex_origins),
            edge_parents=_labels.look_up(self.edge_parents, finer.edge_parents),
            edge_parallels=_labels.compose_parallels(self.edge_parallels, finer.edge_parallels),
        )

    def carry_vertex_labels(self, labels: Tensor, *, along: Tensor | None = None, fill: float = 0) -> Tensor:
        """Labels of the fine vertices: old vertices keep theirs, new ones get ``fill``.

        So a mask of corners stays on the corners. With ``along``, a mask of edges, a new vertex on one of these edges
        takes the label that both ends of the edge have; so a mask of the vertices of a curve marks the finer curve.

        Args:
            labels: (V, ...) of any dtype.
            along: (E,) bool, edges along which labels pass to new vertices.
            fill: label of the other new vertices.

        Returns:
            (V', ...) of the dtype of ``labels``.

        Raises:
            ShapeError: if ``labels`` does not start with V or ``along`` is not a bool tensor (E,).
        """
        return _labels.carry_vertex_labels(self, labels, along, fill)

    def carry_edge_labels(self, labels: Tensor, *, parallel: bool = False, fill: float = 0) -> Tensor:
        """Labels of the fine edges: parts of an edge have its label, edges inside faces get ``fill``.

        With ``parallel``, edges inside a face go by its sides: in a triangle cut into four an inner edge has the
        label of the side that it is parallel to; in a quad cut into four, the label of the two opposite sides that it
        lies between, if they agree. So one family of a lattice, such as its principal edges, is marked on the finer
        lattice, where without it only every other polyline would be.

        Args:
            labels: (E, ...) of any dtype.
            parallel: whether edges inside faces take the labels of sides that they run along.
            fill: label of the other edges inside faces.

        Returns:
            (E', ...) of the dtype of ``labels``.

        Raises:
            ShapeError: if ``labels`` does not start with E.
        """
        return _labels.carry_edge_labels(self, labels, parallel, fill)

    def carry_face_labels(self, labels: Tensor) -> Tensor:
        """Labels of the fine faces, those of their parents: (F, ...) of any dtype to (F', ...).

        Raises:
            ShapeError: if ``labels`` does not start with F.
        """
        _labels.check_labels(labels, self.coarse.num_faces, "F, the number of faces")
        return labels[self.face_parents]


def _same_faces(a: Topology, b: Topology) -> bool:
    if a is b:
        return True
    same_counts = a.num_vertices == b.num_vertices and a.num_faces == b.num_faces
    return same_counts and torch.equal(a.face_offsets, b.face_offsets) and torch.equal(a.corners, b.corners)
