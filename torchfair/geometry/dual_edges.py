"""Dual edge lengths: edges of the Gauss image."""

from __future__ import annotations

import torch
from torch import Tensor

from .._precision import in_single_at_least
from ..topology import Topology
from ._ops import norm
from .normals import adjacent_normals


@in_single_at_least
def dual_edge_lengths(vertices: Tensor, topology: Topology) -> Tensor:
    r"""Length ``l* = |n - n'|`` of every interior edge in the Gauss image, dimensionless.

    The Gauss image has the unit normals ``n, n'`` of the faces as its vertices; it joins those of
    neighbouring faces. ``l* = 2 sin(|a|/2)`` for the dihedral angle ``a`` (paper section 3).

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity; any polygons, mixed.

    Returns:
        (*batch, I) in [0, 2]: 0 where flat, 2 where folded onto itself. At flat edges the function has a
        kink; the derivative given there is 0, a subgradient. Edges beside a degenerate face (see
        :func:`face_normals`) have value and derivatives 0. Boundary edges have no entry.

    Raises:
        ShapeError: if ``vertices`` is not a floating tensor (*batch, V, 3).

    Example:
        >>> import torch
        >>> from torchfair import Topology
        >>> from torchfair.geometry import dual_edge_lengths
        >>> vertices = torch.tensor([[0.0, 0, 0], [2, 0, 0], [2, 2, 1], [0, 2, 1], [0, 4, 0], [2, 4, 0]])
        >>> topology = Topology.from_faces([[0, 1, 2, 3], [3, 2, 5, 4]])  # a ridge
        >>> dual_edge_lengths(vertices, topology)  # between the two unit normals
        tensor([0.8944])
    """
    left, right, valid = adjacent_normals(vertices, topology)
    return norm(torch.where(valid[..., None], left - right, 0.0))
