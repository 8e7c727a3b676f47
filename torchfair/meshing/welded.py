"""Whether a surface falls apart because vertices at one place are not one."""

from __future__ import annotations

from torch import Tensor

from .._names import PlacedError
from ..repair.seams import coincident_edges
from ..topology import Topology


def check_welded(vertices: Tensor, topology: Topology, components: int, count: int) -> None:
    """Checks that a surface does not have more components than its mesh is to have faces, for want of welding.

    Every component would be meshed by itself, as every triangle of a file without shared vertices.

    Raises:
        MeshError: if it has, and edges of its boundary coincide; with some of these, and what to do.
    """
    if components <= count or (seams := coincident_edges(vertices, topology)) is None:
        return
    words = f"the surface has {components} components, more than the {count} face(s) asked for; "
    raise PlacedError(
        words, seams.parts, " torchfair.repair_mesh(..., weld=True) (--weld) makes one edge of each pair."
    )
