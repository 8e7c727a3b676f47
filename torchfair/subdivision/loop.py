"""Loop subdivision of triangle meshes."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from .._names import PlacedError, few
from ..topology import Topology
from ._arrays import MeshArrays
from ._boundary import Boundary
from ._smooth import smooth_step
from ._weights import LoopWeights, loop_weights
from .refinement import Refinement


def loop(
    topology: Topology,
    *,
    boundary: Boundary = "curve",
    corners: Tensor | None = None,
    weights: LoopWeights = "loop",
) -> Refinement:
    r"""One step of Loop subdivision: every triangle is cut into four.

    The rules of C. Loop (master's thesis, Utah 1987)::

              1/8                   b     b
             /   \                   \   /            b = (5/8 - (3/8 + cos(2 pi/n)/4)^2) / n
          3/8 -o- 3/8            b - 1-nb - b         for n neighbours: 1/16 for n = 6
             \   /                   /   \
              1/8                   b     b
          new vertex               old vertex

    Inside, limits are smooth in curvature but at vertices of valence other than 6; there in normals.

    Args:
        topology: a triangle mesh, with or without boundary.
        boundary: ``"curve"``: the boundary tends to the uniform cubic B-spline of its vertices (1/8, 3/4, 1/8;
            middles). ``"interpolate"``: boundary vertices stay, and the boundary tends to a smooth curve through
            them (four-point scheme of Dyn, Levin and Gregory: -1/16, 9/16, 9/16, -1/16). ``"polyline"``: boundary
            vertices stay, and new ones lie in the middles of boundary edges. In any case the boundary of the fine
            mesh depends on the boundary of the coarse one alone.
        corners: (V,) bool, vertices that stay, such as from :func:`torchfair.boundary.boundary_corners`. The
            boundary curve ends there, with a kink. An interior vertex among them stays too and becomes the tip
            of a spike, unless its neighbours lie around it. No edge is a crease but those of the boundary.
        weights: ``"loop"``, or ``"warren"`` for the simpler b = 3/(8 n), 3/16 for n = 3 (Warren 1995).

    Returns:
        The fine mesh with V + E vertices and 4 F faces. Isolated vertices stay.

    Raises:
        MeshError: if a face is not a triangle or two triangles have the same three vertices.
        ShapeError: if ``corners`` is not a bool tensor (V,).
        TorchfairError: for another rule of the boundary or kind of weights.
    """
    if not topology.is_triangular:
        others = torch.nonzero(topology.face_sizes != 3).squeeze(1).tolist()
        raise PlacedError(
            f"Loop subdivision needs triangles, but {len(others)} face(s) have more corners: faces ",
            few("face", others),
            ". Use hybrid or catmull_clark, or cut these faces into triangles first.",
        )
    mesh = MeshArrays(topology)
    centred = np.zeros(mesh.num_faces, np.bool_)
    return smooth_step(topology, mesh, centred, loop_weights(mesh.valences, weights), boundary, corners)
