"""Catmull-Clark subdivision of polygon meshes."""

from __future__ import annotations

import numpy as np
from torch import Tensor

from ..topology import Topology
from ._arrays import MeshArrays
from ._boundary import Boundary
from ._smooth import smooth_step
from ._weights import catmull_clark_weights
from .refinement import Refinement


def catmull_clark(topology: Topology, *, boundary: Boundary = "curve", corners: Tensor | None = None) -> Refinement:
    """One step of Catmull-Clark subdivision: a face with k corners is cut into k quads (Catmull and Clark 1978).

    New vertices are the centroids f of the faces and, for interior edges, the mean of both ends and the centroids of
    both faces. An interior vertex S with n faces moves to ``(Q + 2 R + (n - 3) S) / n`` with the mean Q of the
    centroids of its faces and the mean R of the middles of its edges.

    Inside, limits are smooth in curvature but at vertices of valence other than 4 and in faces with other than four
    corners; there in normals.

    Args:
        topology: any polygons, mixed, with or without boundary.
        boundary: rule of the boundary, as for :func:`loop`.
        corners: (V,) bool, vertices that stay, as for :func:`loop`.

    Returns:
        The fine mesh with V + E + F vertices and as many quads as the coarse faces have corners.
        Isolated vertices stay.

    Raises:
        ShapeError: if ``corners`` is not a bool tensor (V,).
        TorchfairError: for another rule of the boundary.
    """
    mesh = MeshArrays(topology)
    centred = np.ones(mesh.num_faces, np.bool_)
    return smooth_step(topology, mesh, centred, catmull_clark_weights(mesh.valences), boundary, corners)
