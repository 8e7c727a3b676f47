"""Rules for the vertices of the boundary and for vertices that stay: they see the boundary alone."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from torch import Tensor

from ..errors import TorchfairError
from ..topology import Topology
from ._arrays import Floats, MeshArrays, sparse
from ._labels import check_labels

Boundary = Literal["curve", "interpolate", "polyline"]
Mask = npt.NDArray[np.bool_]


def check_boundary(boundary: str) -> None:
    """Raises TorchfairError for a rule that does not exist."""
    if boundary not in get_args(Boundary):
        names = ", ".join(f'"{name}"' for name in get_args(Boundary))
        raise TorchfairError(f"boundary: expected one of {names}, got {boundary!r}")


def corner_mask(topology: Topology, corners: Tensor | None) -> Mask:
    """(V,) ``corners`` in NumPy, all false if left out.

    Raises:
        ShapeError: if ``corners`` is not a bool tensor (V,).
    """
    if corners is None:
        return np.zeros(topology.num_vertices, np.bool_)
    check_labels(corners, topology.num_vertices, "V, the number of vertices", mask=True, what="corners")
    mask: Mask = corners.cpu().numpy()
    return mask


def staying_vertices(mesh: MeshArrays, boundary: Boundary, corners: Mask) -> Mask:
    """(V,) vertices that keep their place: corners, isolated ones and, unless "curve" moves it, the boundary."""
    stay: Mask = corners | (mesh.valences == 0)
    return stay if boundary == "curve" else stay | mesh.on_boundary


def boundary_vertex_rows(mesh: MeshArrays, stay: Mask) -> sp.csr_array:
    """(V, V) rows of the boundary vertices and of all that ``stay``; other rows are zero.

    Uniform cubic B-splines: 1/8, 3/4, 1/8 of the vertices before, at and after a boundary vertex.
    """
    start, end = mesh.edges[mesh.num_interior_edges :].T
    moving = mesh.on_boundary & ~stay
    own = np.where(stay, 1.0, np.where(moving, 0.75, 0.0))
    every = np.arange(mesh.num_vertices)
    values = np.concatenate([own, moving[start] / 8, moving[end] / 8])
    rows, columns = np.concatenate([every, start, end]), np.concatenate([every, end, start])
    return sparse(values, rows, columns, mesh.num_vertices, mesh.num_vertices)


def boundary_edge_rows(mesh: MeshArrays, boundary: Boundary, corners: Mask) -> sp.csr_array:
    """(E, V) rows of the boundary edges; other rows are zero.

    Middles for "curve" (B-splines) and "polyline". For "interpolate" the value in the middle of the cubic through
    the four nearest vertices; of the parabola through three where the curve ends at a corner.
    """
    start, end = mesh.edges[mesh.num_interior_edges :].T
    number = np.arange(mesh.num_interior_edges, mesh.num_edges)
    stencil = np.broadcast_to([0, 1 / 2, 1 / 2, 0], (number.size, 4))
    before, after = np.empty((2, mesh.num_vertices), np.int64)
    before[end], after[start] = start, end
    if boundary == "interpolate":
        stencil = _FOUR_POINTS[corners[start].astype(int), corners[end].astype(int)]
    columns = np.stack([before[start], start, end, after[end]], axis=1)
    rows = np.repeat(number, 4)
    return sparse(stencil.ravel(), rows, columns.ravel(), mesh.num_edges, mesh.num_vertices)


_FOUR_POINTS: Floats = np.array(  # weights of four vertices in turn, by whether the second and the third are corners
    [[[-1, 9, 9, -1], [-2, 12, 6, 0]], [[0, 6, 12, -2], [0, 8, 8, 0]]]
) / 16  # fmt: skip
