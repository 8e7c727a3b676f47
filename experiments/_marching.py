"""The zero surface of a function on a lattice, by marching tetrahedra: polygons whose vertices are differentiable."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import torch
from torch import Tensor

from torchfair import Topology

# Corners of a tetrahedron of positive volume, reordered evenly: those inside first.
_ONE = ((0, 1, 2, 3), (1, 0, 3, 2), (2, 0, 1, 3), (3, 0, 2, 1))
_TWO = ((0, 1, 2, 3), (0, 2, 3, 1), (0, 3, 1, 2), (1, 2, 0, 3), (1, 3, 2, 0), (2, 3, 0, 1))


def lattice(size: int, half_width: float) -> Tensor:
    """Nodes (size^3, 3) of a cube around the origin, in float64."""
    steps = torch.linspace(-half_width, half_width, size, dtype=torch.float64)
    return torch.cartesian_prod(steps, steps, steps)


def zero_surface(values: Tensor, nodes: Tensor, size: int) -> tuple[Tensor, Topology]:
    """Vertices (V, 3) and topology of where ``values`` (size^3,) on the nodes of :func:`lattice` are zero.

    Every cell is cut into six tetrahedra, in which the zero set of the linear interpolant is a triangle or a planar
    quad; normals point to where values are positive. The values are differentiated through the vertices, which move
    along the edges of the tetrahedra. The mesh is closed, but where the surface leaves the lattice.
    """
    inside = (values.detach() < 0).cpu().numpy()
    tetrahedra = _tetrahedra(size)
    count = inside[tetrahedra].sum(1)
    parts: list[tuple[np.ndarray, int]] = []
    for order in _ONE:
        parts.append((_faces(tetrahedra, inside, count == 1, order, 1, ((0, 1), (0, 2), (0, 3))), 3))
        parts.append((_faces(tetrahedra, ~inside, count == 3, order, 1, ((0, 3), (0, 2), (0, 1))), 3))
    for order in _TWO:
        parts.append((_faces(tetrahedra, inside, count == 2, order, 2, ((0, 2), (0, 3), (1, 3), (1, 2))), 4))
    ends = np.concatenate([part.reshape(-1, 2) for part, _ in parts])
    sizes = np.concatenate([np.full(len(part), corners) for part, corners in parts])
    keys, corners = np.unique(ends.min(1) * np.int64(size**3) + ends.max(1), return_inverse=True)
    first, second = (torch.from_numpy(part).to(values.device) for part in np.divmod(keys, size**3))
    share = values[first] / (values[first] - values[second])
    vertices = torch.lerp(nodes[first], nodes[second], share[:, None].to(nodes.dtype))
    offsets = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
    topology = Topology.from_packed_faces(corners.astype(np.int64).ravel(), offsets, len(keys), manifold="edges")
    return vertices, topology.to(values.device)


def _faces(
    tetrahedra: np.ndarray, inside: np.ndarray, chosen: np.ndarray, order: Sequence[int], lead: int,
    edges: Sequence[tuple[int, int]],
) -> np.ndarray:  # fmt: skip
    """Ends (n, k, 2) of the cut edges of those chosen tetrahedra whose first ``lead`` corners in order are inside."""
    some = tetrahedra[chosen][:, order]
    some = some[inside[some[:, :lead]].all(1)]
    return some[:, edges]


@lru_cache(maxsize=2)
def _tetrahedra(size: int) -> np.ndarray:
    """(6 (size - 1)^3, 4) nodes of tetrahedra of positive volume, around the long diagonals of the cells."""
    strides = np.array([size * size, size, 1])
    steps = np.arange(size - 1)
    cells = (steps[:, None, None] * strides[0] + steps[:, None] * strides[1] + steps).ravel()
    tetrahedra = []
    for axes in itertools.permutations(range(3)):
        corners = np.concatenate([[0], np.cumsum(strides[list(axes)])])
        even = np.linalg.det(np.eye(3)[list(axes)]) > 0
        tetrahedra.append(cells[:, None] + (corners if even else corners[[0, 2, 1, 3]]))
    return np.concatenate(tetrahedra)
