"""Subdivision of meshes of triangles and quads, each kind by its own scheme."""

from __future__ import annotations

import numpy as np
from torch import Tensor

from ..topology import Topology
from ._arrays import MeshArrays
from ._boundary import Boundary
from ._smooth import VertexWeights, smooth_step
from ._weights import catmull_clark_weights, loop_weights, mixed_weights
from .refinement import Refinement


def hybrid(topology: Topology, *, boundary: Boundary = "curve", corners: Tensor | None = None) -> Refinement:
    """One step in which triangles are cut into four triangles and a face with k > 3 corners into k quads.

    A triangle mesh is subdivided as by :func:`loop`, a mesh without triangles as by :func:`catmull_clark`. In general
    (after Stam and Loop, *Quad/triangle subdivision*, 2003):

    - new vertices in faces with more than three corners are their centroids;
    - on an interior edge each side gives half of the new vertex: a triangle as in Loop's scheme (3/16 of both ends,
      1/8 of the opposite vertex), another face as in Catmull and Clark's (1/8 of both ends, 1/4 of its centroid);
    - interior vertices that see only triangles follow Loop, those that see none follow Catmull and Clark. Elsewhere,
      with n edges and q faces that are not triangles: ``a (1 + n/4)`` of the vertex, ``a/4`` of its neighbours and of
      the centroids of these q faces, where ``1/a = 1 + n/2 + q/4``. This is the average of Stam and Loop after linear
      splitting, without their correction of irregular vertices. Where three triangles meet two quads side by side,
      limits are smooth in normals; what happens at other mixed vertices has not been analysed.

    Args:
        topology: any polygons, mixed, with or without boundary.
        boundary: rule of the boundary, as for :func:`loop`.
        corners: (V,) bool, vertices that stay, as for :func:`loop`.

    Returns:
        The fine mesh of triangles and quads. Isolated vertices stay.

    Raises:
        MeshError: if two triangles have the same three vertices.
        ShapeError: if ``corners`` is not a bool tensor (V,).
        TorchfairError: for another rule of the boundary.
    """
    mesh = MeshArrays(topology)
    centred = mesh.face_sizes > 3
    polygons = np.bincount(mesh.corners[centred[mesh.corner_faces]], minlength=mesh.num_vertices)
    kinds = (loop_weights(mesh.valences), catmull_clark_weights(mesh.valences), mixed_weights(mesh.valences, polygons))
    own, ring, face = (
        np.where(polygons == 0, only_triangles, np.where(polygons == mesh.valences, none, mixed))
        for only_triangles, none, mixed in zip(*kinds, strict=True)
    )
    return smooth_step(topology, mesh, centred, VertexWeights(own, ring, face), boundary, corners)
