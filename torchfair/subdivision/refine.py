"""Several steps of subdivision in one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, get_args

import scipy.sparse as sp
import torch
from torch import Tensor

from ..errors import TorchfairError
from ..topology import Topology
from ._boundary import Boundary
from .catmull_clark import catmull_clark
from .hybrid import hybrid
from .loop import loop
from .midpoint import midpoint
from .refinement import Origin, Refinement

Scheme = Literal["loop", "catmull_clark", "hybrid", "midpoint"]

_MOST_FACES = 10_000_000  # about a kilobyte each while they are made


def refine(
    topology: Topology,
    scheme: Scheme = "hybrid",
    levels: int = 1,
    *,
    boundary: Boundary = "curve",
    corners: Tensor | None = None,
) -> Refinement:
    """Subdivides ``levels`` times. Call a scheme once a level instead if the meshes between are needed.

    Args:
        topology: the coarse mesh.
        scheme: name of the scheme. ``"hybrid"`` takes any mesh; it is Loop's on triangles, Catmull and Clark's on
            quads.
        levels: number of steps; with 0 the mesh stays as it is.
        boundary: rule of the boundary, as for :func:`loop`. ``"midpoint"`` has no need of it.
        corners: (V,) bool, vertices that stay through all levels, as for :func:`loop`.

    Returns:
        All steps in one, see :meth:`Refinement.then`.

    Raises:
        TorchfairError: for an unknown scheme, a negative number of levels or one that makes more than ten million
            faces, and as the scheme itself.
    """
    if levels < 0:
        raise TorchfairError(f"levels: expected 0 or more, got {levels}")
    step = _step(scheme, boundary)
    faces = _faces_after(topology, scheme, levels)
    if levels and faces > _MOST_FACES:
        raise TorchfairError(f"levels: {levels} make {faces} faces of {topology.num_faces}, more than {_MOST_FACES}")
    whole = _unrefined(topology)
    for _ in range(levels):
        finer = step(whole.topology, None if corners is None else whole.carry_vertex_labels(corners))
        whole = whole.then(finer)
    return whole


def _faces_after(topology: Topology, scheme: Scheme, levels: int) -> int:
    """A triangle makes four, any other face of k corners k quads; by Catmull and Clark's scheme triangles, too."""
    corners, triangles = topology.corners.shape[0], int((topology.face_sizes == 3).sum())
    first = corners if scheme == "catmull_clark" else corners + triangles
    return first * 4 ** (levels - 1) if levels else topology.num_faces


def _step(scheme: Scheme, boundary: Boundary) -> Callable[[Topology, Tensor | None], Refinement]:
    if scheme == "midpoint":
        return lambda topology, corners: midpoint(topology)
    smooth = {"loop": loop, "catmull_clark": catmull_clark, "hybrid": hybrid}
    if scheme not in smooth:
        names = ", ".join(f'"{name}"' for name in get_args(Scheme))
        raise TorchfairError(f"scheme: expected one of {names}, got {scheme!r}")
    chosen: Callable[..., Refinement] = smooth[scheme]
    return lambda topology, corners: chosen(topology, boundary=boundary, corners=corners)


def _unrefined(topology: Topology) -> Refinement:
    """No step at all."""
    vertices = torch.arange(topology.num_vertices, device=topology.device)
    edges = torch.arange(topology.num_edges, device=topology.device)
    return Refinement(
        coarse=topology,
        topology=topology,
        matrix=sp.csr_array(sp.eye_array(topology.num_vertices, format="csr")),
        face_parents=torch.arange(topology.num_faces, device=topology.device),
        vertex_origins=torch.stack([torch.full_like(vertices, Origin.VERTEX), vertices], dim=1),
        edge_parents=edges,
        edge_parallels=torch.stack([edges, edges], dim=1),
    )
