"""What is made of smoothing and fairness on fine meshes, whose edges have little E in mean edge lengths."""

from __future__ import annotations

import math
from typing import NamedTuple

from torch import Tensor

from ...energies import normal_variation_per_edge
from ...topology import Topology

_SMOOTHED = 0.05  # mean of l l* in mean edge lengths, below which the smoothing falls with it
_FAIR = 0.4  # likewise for the weight of fairness
_LEAST = 0.01  # to which they fall at most, as where a mesh is flat
_LARGE = 50_000  # vertices, from which on blunt stages are only as blunt as pays
_BLUNT = 0.25  # of the mean l l*: blunter stages there take most of the time and leave E where they found it


class Scales(NamedTuple):
    """Factors of the smoothing and of the weight of fairness, both in (0, 1]; what smoothing stages have at most.

    Attributes:
        smoothing, fairness: The factors; 1 where there are no interior edges.
        bluntest: Largest smoothing of stages before the last, in mean edge lengths; infinite for no bound.
    """

    smoothing: float = 1.0
    fairness: float = 1.0
    bluntest: float = math.inf

    @property
    def is_large(self) -> bool:
        """Whether the mesh has so many vertices that each step takes seconds."""
        return math.isfinite(self.bluntest)

    def smoothed(self, smoothing: float, blur: float) -> float:
        """The smoothing of a stage from that of the settings and the factor of the stage, at least 1."""
        sharp = smoothing * self.smoothing
        return max(sharp, min(blur * sharp, self.bluntest))


def scales(vertices: Tensor, topology: Topology) -> Scales:
    """Those of a mesh (V, 3), whose mean edge length is 1.

    They fall with its mean ``l l*``: else all edges of a fine mesh would count as flat, and fairness, whose sum grows
    with V where that of E grows with its root, would outweigh E.
    """
    if not topology.num_interior_edges:
        return Scales()
    mean = float(normal_variation_per_edge(vertices, topology).mean())
    smoothing, fairness = _scale(mean, _SMOOTHED), _scale(mean, _FAIR)
    return Scales(smoothing, fairness, _BLUNT * mean if topology.num_vertices >= _LARGE else math.inf)


def _scale(mean: float, usual: float) -> float:
    return min(1.0, max(mean / usual, _LEAST))
