"""Linear splitting: a finer mesh of the same piecewise flat surface."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from ..topology import Topology
from ._arrays import MeshArrays, scaled
from ._smooth import face_centroids
from ._split import split_faces
from .refinement import Refinement


def midpoint(topology: Topology) -> Refinement:
    """One step of linear splitting: old vertices stay, new ones lie in the middles of edges and faces.

    Triangles are cut into four, as by :func:`loop`; faces with k > 3 corners into k quads around the mean of their
    corners, as by :func:`catmull_clark`. Nothing is smoothed: planar faces stay as they are, and quads that are not
    planar are replaced by points of their bilinear patches.

    Args:
        topology: any polygons, mixed, with or without boundary.

    Returns:
        The fine mesh.

    Raises:
        MeshError: if two triangles have the same three vertices.
    """
    mesh = MeshArrays(topology)
    centred = mesh.face_sizes > 3
    split = split_faces(topology, centred)
    stay = sp.eye_array(mesh.num_vertices, format="csr")
    middles = scaled(np.full(mesh.num_edges, 0.5), mesh.edge_ends())
    matrix = sp.csr_array(sp.vstack([stay, middles, face_centroids(mesh)[np.flatnonzero(centred)]]))
    return Refinement(topology, split.topology, matrix, *split[1:])
