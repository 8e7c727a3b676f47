"""What comes out of a repair."""

from __future__ import annotations

from dataclasses import dataclass

from torch import Tensor

from .._names import Sentence
from .._short_repr import short_repr
from ..topology import Topology


@dataclass(frozen=True, eq=False)
class RepairedMesh:
    """Result of :func:`repair_mesh`.

    Attributes:
        vertices: (*batch, V', 3) the vertices that are used, in their old order, and copies of some behind them.
        topology: connectivity of the repaired mesh; faces that are left keep their order.
        kept_vertices: (V',) old number of each vertex, or of the vertex that it is a copy of.
        kept_faces: (F',) old number of each face.
        kept_corners: (H',) old number of each corner (counted face after face); -1 for a corner that was put in.
        vertex_map: (V,) new number of each old vertex: where it was merged into another one, that of the other; -1
            where it was dropped. Of a vertex that was split, the copy that its first face uses.
        flipped_faces: (n,) old numbers of the faces that were turned over.
        sentences: what was done, with the places in old numbers.
    """

    vertices: Tensor
    topology: Topology
    kept_vertices: Tensor
    kept_faces: Tensor
    kept_corners: Tensor
    vertex_map: Tensor
    flipped_faces: Tensor
    sentences: tuple[Sentence, ...]

    __repr__ = short_repr

    @property
    def messages(self) -> list[str]:
        """What was done, one sentence each; empty if nothing had to be done."""
        return [sentence.told() for sentence in self.sentences]

    @property
    def faces(self) -> list[list[int]]:
        """Faces as lists of new vertex numbers; a flipped face keeps its first corner."""
        return self.topology.face_lists()
