"""How much noise a mesh has, from the mesh alone."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from ...errors import MeshError
from ...geometry import tangent_bases
from ...topology import Topology
from .neighbourhoods import Neighbourhoods, smoothed_area_vectors

_COEFFICIENTS = 6  # of a quadratic height function
_LEAST_FREEDOM = 4
_QUANTILE = 0.7  # of clean neighbourhoods that count; others may have edges in them
_NORMAL_QUANTILE = 0.5244005  # of the normal distribution
_START = 0.3
_ROUNDS = 100
_CHUNK = 1 << 18  # pairs of vertices at once
_RIDGE = 1e-12


def noise_level(vertices: Tensor, topology: Topology, near: Neighbourhoods | None = None) -> float:
    """Standard deviation of the noise across the surface, in the unit of the vertices.

    Quadratic height functions are fitted to all vertices within two edges of each vertex. What they leave is noise,
    unless an edge of the surface runs through: then it is far too much. So the variance is pooled over those
    neighbourhoods alone that leave no more than seven tenths of all would, if the noise were Gaussian with this very
    variance, and corrected for having left out the others (a chi-squared distribution cut off).

    Right within 10 % for independent noise, along normals or in all directions, up to half a mean edge; noise of a
    scanner that is smooth over several edges is not seen. Smooth meshes without noise give what a quadratic cannot
    follow, well below a thousandth of an edge.

    Args:
        vertices: (V, 3) float64.
        topology: Any polygon mesh.
        near: The neighbourhoods of the topology, if they are at hand.

    Raises:
        MeshError: no neighbourhood is large enough.

    Example:
        >>> import torch
        >>> from torchfair.formfinding import noise_level
        >>> from torchfair.shapes import icosphere
        >>> ball = icosphere(3)
        >>> noise = 0.02 * torch.randn(ball.vertices.shape, generator=torch.manual_seed(0), dtype=torch.float64)
        >>> 0.015 < noise_level(ball.vertices + noise, ball.topology) < 0.025
        True
    """
    near = Neighbourhoods.of(topology) if near is None else near
    remainders, freedom = _remainders(vertices, topology, near)
    if not freedom.numel():
        raise MeshError("the mesh has too few vertices to estimate its noise: give the noise")
    return math.sqrt(_pooled_variance(remainders, freedom))


def _remainders(vertices: Tensor, topology: Topology, near: Neighbourhoods) -> tuple[Tensor, Tensor]:
    """Sums of squares that quadratic height functions leave (n,), and their degrees of freedom (n,)."""
    vectors, _ = smoothed_area_vectors(vertices, topology, near)
    length = torch.linalg.vector_norm(vectors, dim=1)
    normals = vectors / torch.where(length > 0.0, length, 1.0)[:, None]
    frames = torch.cat([tangent_bases(normals), normals[:, None]], dim=1)
    enough = (near.counts >= _COEFFICIENTS + _LEAST_FREEDOM) & (length > 0.0)
    starts = torch.cat([near.counts.new_zeros(1), near.counts.cumsum(0)])
    left, count = vertices.new_zeros(topology.num_vertices), topology.num_vertices
    low = 0
    while low < count:
        high = max(int(torch.searchsorted(starts, starts[low] + _CHUNK, right=True)) - 1, low + 1)
        pairs = slice(int(starts[low]), int(starts[high]))
        centres, members = near.centres[pairs], near.members[pairs]
        local = torch.einsum("nij,nj->ni", frames[centres], vertices[members] - vertices[centres])
        left[low:high] = _left_by_quadratics(local, centres - low, high - low)
        low = high
    return left[enough], (near.counts[enough] - _COEFFICIENTS).to(vertices)


def _left_by_quadratics(local: Tensor, centres: Tensor, count: int) -> Tensor:
    """(count,) sums of squares left of points (n, 3), two coordinates and a height, by ``centres`` (n,) in order."""
    size = local.new_zeros(count).index_add_(0, centres, local.square().sum(1))
    scale = torch.sqrt(size / torch.bincount(centres, minlength=count).clamp_min(1)).clamp_min(1e-300)
    x, y, z = (local / scale[centres, None]).unbind(1)
    rows = torch.stack([torch.ones_like(x), x, y, x * x, x * y, y * y], dim=1)
    products = (rows[:, :, None] * rows[:, None]).flatten(1)
    matrices = rows.new_zeros(count, _COEFFICIENTS**2).index_add_(0, centres, products)
    matrices = matrices.view(count, _COEFFICIENTS, _COEFFICIENTS)
    matrices.diagonal(dim1=1, dim2=2).add_(_RIDGE * matrices.diagonal(dim1=1, dim2=2) + 1e-30)
    right = rows.new_zeros(count, _COEFFICIENTS).index_add_(0, centres, rows * z[:, None])
    fit = torch.linalg.solve(matrices, right)
    left = z - (rows * fit[centres]).sum(1)
    remainders: Tensor = left.new_zeros(count).index_add_(0, centres, left.square()) * scale.square()
    return remainders


def _pooled_variance(remainders: Tensor, freedom: Tensor) -> float:
    """The variance whose chi-squared distributions explain the small ones among ``remainders``."""
    share = 2.0 / (9.0 * freedom)
    bounds = freedom * (1.0 - share + _NORMAL_QUANTILE * share.sqrt()) ** 3  # Wilson and Hilferty 1931
    kept_mean = torch.special.gammainc(freedom / 2 + 1, bounds / 2) / torch.special.gammainc(freedom / 2, bounds / 2)
    variance = float(torch.sort(remainders / freedom).values[int(_START * len(freedom))])
    for _ in range(_ROUNDS):
        kept = remainders <= bounds * variance
        if not bool(kept.any()):
            return variance
        before, variance = variance, float(remainders[kept].sum() / (kept_mean * freedom)[kept].sum())
        if abs(variance - before) <= 1e-6 * before:
            break
    return variance
