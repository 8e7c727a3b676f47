"""Gathering, scattering and safe norms shared by the quantities."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor

from .._portions import portions_unless
from ..topology import Topology


def gather(values: Tensor, index: Tensor) -> Tensor:
    """``values[..., index, :]`` for ``values`` (*batch, N, d) and ``index`` of any shape: (*batch, *index.shape, d).

    ``index_select`` is four times as fast as advanced indexing here, and its backward pass is as fast.
    """
    rows = values.index_select(-2, index.reshape(-1))
    return rows.reshape((*values.shape[:-2], *index.shape, values.shape[-1]))


def scatter_sum(values: Tensor, index: Tensor, size: int) -> Tensor:
    """Sums rows that share a number: ``values`` (*batch, N, d) and ``index`` (N,) to (*batch, size, d)."""
    zeros: Tensor = values.new_zeros((*values.shape[:-2], size, values.shape[-1]))
    total: Tensor = zeros.index_add(-2, index, values)
    return total


def sums_around(values: Tensor, edges: Tensor) -> Tensor:
    """(V, d) sum of the values (V, d) of every vertex and its neighbours along edges (E, 2)."""
    v, w = edges.unbind(1)
    return values.index_add(0, v, values[w]).index_add(0, w, values[v])


def cross(a: Tensor, b: Tensor) -> Tensor:
    """Cross product along the last dimension."""
    product: Tensor = torch.linalg.cross(a, b, dim=-1)
    return product


def dot(a: Tensor, b: Tensor) -> Tensor:
    """Scalar product along the last dimension, which is dropped.

    Three components are added one by one: up to seven times as fast as a sum over so short a dimension.
    """
    product = a * b
    if product.shape[-1] != 3:
        return product.sum(-1)
    x, y, z = product.unbind(-1)
    return x + y + z


def norm(x: Tensor) -> Tensor:
    """Euclidean length along the last dimension, 0 with zero derivatives of every order where ``x`` is zero.

    ``torch.linalg.vector_norm`` has the same value and gradient, but its second derivative at zero is NaN,
    and zero vectors are common here (edges of degenerate faces, normals beside flat edges).
    """
    squared = dot(x, x)
    positive = ~(squared <= 0)
    # The inner where keeps sqrt away from zero, whose infinite slope would turn the masked zero into NaN.
    return torch.where(positive, torch.where(positive, squared, 1.0).sqrt(), 0.0)


def angle_of(sine: Tensor, cosine: Tensor) -> Tensor:
    """``atan2(sine, cosine)``; zero with zero derivatives, forward and back, where both are zero."""
    defined = (sine != 0) | (cosine != 0)
    return torch.atan2(torch.where(defined, sine, 0.0), torch.where(defined, cosine, 1.0))


def unit(x: Tensor) -> Tensor:
    """Vectors along the last dimension divided by their length; zero with zero derivatives where that is zero."""
    lengths = norm(x)
    return x / torch.where(lengths > 0, lengths, 1.0)[..., None]


def map_faces(vertices: Tensor, topology: Topology, function: Callable[[Tensor], Tensor]) -> Tensor:
    """Applies ``function`` to the corner positions of all faces, those with equally many corners at once.

    Args:
        vertices: (*batch, V, 3).
        topology: connectivity.
        function: takes corners (*batch, n, k, 3) of n faces with k corners, returns (*batch, n, d).

    Returns:
        (*batch, F, d) in the order of the faces.
    """
    groups = face_groups(topology)
    parts = [_map_portions(vertices, corners, function) for _, corners in groups]
    if len(parts) == 1:
        return parts[0]
    numbers = torch.cat([numbers for numbers, _ in groups])
    return scatter_sum(torch.cat(parts, dim=-2), numbers, topology.num_faces)


def _map_portions(vertices: Tensor, corners: Tensor, function: Callable[[Tensor], Tensor]) -> Tensor:
    """The same of faces (n, k) with equally many corners, some at a time: temporaries stay in the cache."""
    parts = [
        function(gather(vertices, corners[part]))
        for part in portions_unless(vertices.requires_grad, len(corners), vertices)
    ]
    return parts[0] if len(parts) == 1 else torch.cat(parts, dim=-2)


def face_groups(topology: Topology) -> list[tuple[Tensor, Tensor]]:
    """Faces with equally many corners as ``(face numbers (n,), corners (n, k))``: at least one group.

    A mesh without faces has one group of no triangles, so that results still depend on the vertices and
    ``backward`` works.
    """
    nothing = topology.corners[:0]
    return list(topology.faces_by_size.values()) or [(nothing, nothing.view(0, 3))]
