"""What is made of smoothing and fairness on fine meshes, whose edges have little E in mean edge lengths."""

from __future__ import annotations

from torch import Tensor

from ...energies import normal_variation_per_edge
from ...topology import Topology

_SMOOTHED = 0.05  # mean of l l* in mean edge lengths, below which the smoothing falls with it
_FAIR = 0.4  # likewise for the weight of fairness
_LEAST = 0.01  # to which they fall at most, as where a mesh is flat


def scales(vertices: Tensor, topology: Topology) -> tuple[float, float]:
    """Factors in (0, 1] of the smoothing and of the weight of fairness; both 1 where there are no interior edges.

    They fall with the mean ``l l*`` of the mesh (V, 3), whose mean edge length is 1: else all edges of a fine mesh
    would count as flat, and fairness, whose sum grows with V where that of E grows with its root, would outweigh E.
    """
    if not topology.num_interior_edges:
        return 1.0, 1.0
    mean = float(normal_variation_per_edge(vertices, topology).mean())
    return _scale(mean, _SMOOTHED), _scale(mean, _FAIR)


def _scale(mean: float, usual: float) -> float:
    return min(1.0, max(mean / usual, _LEAST))
