"""Curvature of large meshes, fitted at some vertices and averaged over those between them."""

from __future__ import annotations

import dataclasses

import torch
from torch import Tensor

from ..topology import Topology
from ._ops import sums_around
from .fitted_curvature import FittedCurvature, fitted_curvature
from .normals import vertex_normals

_SEED = 0


def sampled_curvature(vertices: Tensor, topology: Topology) -> FittedCurvature:
    """Shape operators at all vertices from fits at some of them, in a fraction of the time.

    Fitted are vertices (:func:`spread_vertices`) with others between them, at which operators are means of those fitted
    within two edges. Directions are right to the first order in the edge length: of 2500 vertices of a torus within a
    degree. Without derivatives.

    Args:
        vertices: (V, 3) float64.
        topology: any polygons.

    Returns:
        As :func:`fitted_curvature`, with normals of :func:`vertex_normals`.
    """
    chosen = spread_vertices(topology)
    with torch.no_grad():
        fit = fitted_curvature(vertices, topology, at=chosen)
        counts = _within_two(chosen.to(torch.float64)[:, None], topology)
        rows = torch.cat([fit.operators.flatten(1), fit.doubts[:, None], fit.scales[:, None]], 1) * chosen[:, None]
        rows = _within_two(rows, topology) / counts.clamp_min(1.0)
        return dataclasses.replace(
            fit,
            normals=vertex_normals(vertices, topology),
            operators=rows[:, :9].reshape(-1, 3, 3),
            doubts=rows[:, 9],
            scales=torch.where(counts[:, 0] > 0, rows[:, 10], 1.0),
        )


def spread_vertices(topology: Topology) -> Tensor:
    """(V,) which vertices are in an even set: no two of them within two edges, and every vertex within two of one.

    In turn, in an order that is random but always the same, all of those that come first among what is left within two
    edges are taken, and what is within two edges of them is left out (Luby 1986).
    """
    ends = torch.cat([topology.edges, topology.edges.flip(1)])
    rank = torch.randperm(topology.num_vertices, generator=torch.Generator().manual_seed(_SEED)).to(topology.device)
    chosen = torch.zeros_like(rank, dtype=torch.bool)
    while bool((rank >= 0).any()):
        first = (_largest_within_two(rank, ends) == rank) & (rank >= 0)
        chosen |= first
        rank = torch.where(_largest_within_two(first.to(rank), ends) > 0, -1, rank)
    return chosen


def _within_two(values: Tensor, topology: Topology) -> Tensor:
    """(V, d) sums of values (V, d) over walks of two edges or fewer."""
    return sums_around(sums_around(values, topology.edges), topology.edges)


def _largest_within_two(values: Tensor, ends: Tensor) -> Tensor:
    """(V,) largest of the values (V,) within two edges; edges (2 E, 2) in both directions."""
    for _ in range(2):
        values = values.scatter_reduce(0, ends[:, 0], values[ends[:, 1]], "amax")
    return values
