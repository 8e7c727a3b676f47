"""Normals at boundary vertices from quadratic patches through the vertices around."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
import torch
from torch import Tensor
from torch.linalg import vector_norm

from .._ranges import ranges
from ..topology import Topology

_NEAREST = 1e-6  # squared distance, over the mean one
_FLATTEST = 1e-4  # singular values below this fraction of the largest one say nothing


class BoundaryJets(NamedTuple):
    """Quadratic patches through vertices on the boundary, each a height field over a plane, fitted to what is around.

    They are fitted by least squares to the neighbours and theirs, with weights that fall with the fourth power of the
    distance (osculating jets, Cazals and Pouget 2005). Their normals are exact on quadratic height fields; elsewhere
    the error falls with the square of the edge length, while that of normals of stars, which are incomplete and
    lopsided at a boundary, falls linearly.

    Attributes:
        stencil: (n, 1 + k) the vertices, then those around; filled up with the vertices themselves.
        weights: (n, 2, k) slopes of the patches along the two vectors of the frame, per height of the vertices around.
        slopes: (n, 2).
        misfit: (n,) root mean square distance of the vertices around from the patch, over their mean distance from the
            vertex: large where the surface has a crease or is no height field.
    """

    stencil: Tensor
    weights: Tensor
    slopes: Tensor
    misfit: Tensor

    @classmethod
    def of(
        cls, vertices: Tensor, topology: Topology, chosen: Tensor, normals: Tensor, frames: tuple[Tensor, Tensor]
    ) -> BoundaryJets:
        """Patches at ``chosen`` vertices (n,).

        Args:
            vertices: (V, 3).
            topology: Connectivity.
            chosen: Numbers of vertices.
            normals: (n, 3) unit vectors along which heights are measured.
            frames: Two unit vectors (n, 3) orthogonal to ``normals`` and to each other.
        """
        around, inside = _two_rings(topology, chosen)
        offsets = vertices[around] - vertices[chosen, None]
        reach = (vector_norm(offsets, dim=2) * inside).sum(1) / inside.sum(1).clamp_min(1)
        reach = reach.clamp_min(1e-300)[:, None]
        x, y, z = ((offsets * axis[:, None]).sum(2) / reach for axis in (*frames, normals))
        weights = inside / (x * x + y * y).clamp_min(_NEAREST)
        monomials = torch.stack([x, y, x * x, x * y, y * y], dim=2) * weights[:, :, None]
        heights = (z * weights)[:, :, None]
        inverse = torch.linalg.pinv(monomials, rtol=_FLATTEST)
        coefficients = inverse @ heights
        squares = (monomials @ coefficients - heights)[:, :, 0].square().sum(1)
        misfit = (squares / weights.square().sum(1).clamp_min(1e-300)).sqrt()
        per_height = inverse[:, :2] * (weights / reach)[:, None]
        return cls(torch.cat([chosen[:, None], around], 1), per_height, coefficients[:, :2, 0], misfit)


def slopes_of_patch(x: Tensor, weights: Tensor, normal: Tensor) -> Tensor:
    """Slopes (2,) of the patch through the vertex ``x[0]``, tangents of the angles by which it tilts.

    Args:
        x: (1 + k, 3) the vertex and those around.
        weights: (2, k) from :class:`BoundaryJets`; how the patch depends on where the vertices lie is frozen.
        normal: (3,) direction of heights.
    """
    return weights @ ((x[1:] - x[0]) @ normal)


def _two_rings(topology: Topology, chosen: Tensor) -> tuple[Tensor, Tensor]:
    """Neighbours of vertices (n,) and theirs, (n, k), filled up with the vertices themselves, and where they are."""
    count, own = topology.num_vertices, chosen.cpu().numpy()
    v, w = topology.edges.cpu().numpy().T
    ends = (np.concatenate([v, w]), np.concatenate([w, v]))
    adjacency = sp.coo_matrix((np.ones(ends[0].size), ends), (count, count)).tocsr()
    first = adjacency[own]
    around = sp.csr_matrix(first + first @ adjacency)
    rows = np.repeat(np.arange(own.size), np.diff(around.indptr))
    others = around.indices != own[rows]
    rows, columns = rows[others], around.indices[others]
    sizes = np.bincount(rows, minlength=own.size)
    index = np.repeat(own[:, None], int(sizes.max(initial=0)), axis=1)
    index[rows, ranges(np.zeros_like(sizes), sizes)] = columns
    inside = np.arange(index.shape[1])[None] < sizes[:, None]
    return torch.from_numpy(index).to(chosen), torch.from_numpy(inside).to(chosen.device)
