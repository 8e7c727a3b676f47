"""Whether a surface falls apart because vertices at one place are not one."""

from __future__ import annotations

from torch import Tensor

from .._graph import face_components
from .._names import PlacedError
from .._one_mesh import one_mesh
from ..repair.seams import coincident_edges
from ..topology import Topology


def check_welded(vertices: Tensor, topology: Topology, count: int) -> None:
    """Checks that a surface does not have more components than its mesh is to have faces, for want of welding.

    Every component would be meshed by itself, as every triangle of a file without shared vertices. Nothing is said of
    vertices that are not finite.

    Raises:
        ShapeError: if it has, and is not one mesh.
        MeshError: if it has, and edges of its boundary coincide; with some of these, and what to do.
    """
    labels = face_components(topology.to("cpu"))
    components = int(labels.max()) + 1 if len(labels) else 0
    if components <= count:
        return
    points = one_mesh(vertices, topology)
    if not bool(points.isfinite().all()) or (seams := coincident_edges(points, topology)) is None:
        return
    words = f"the surface has {components} components, more than the {count} face(s) asked for; "
    remedy = " torchfair.repair_mesh(..., weld=True) (--weld) makes one edge of each pair."
    raise PlacedError(words, seams.parts, remedy)
