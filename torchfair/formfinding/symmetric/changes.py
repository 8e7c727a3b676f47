"""What a job has done to the mesh that it was given."""

from __future__ import annotations

from functools import cached_property

import torch
from torch import Tensor

from ...geometry import ReferenceSurface, edge_lengths
from ...stars import StarClasses, StarKind, classify_stars
from ...topology import Topology


class Changes:
    """Compares meshes with the one that they have come from.

    Args:
        start: (V, 3) float64.
        topology: Connectivity, a triangle mesh.
    """

    def __init__(self, start: Tensor, topology: Topology) -> None:
        self._start, self._topology = start, topology

    @cached_property
    def _surface(self) -> ReferenceSurface:
        return ReferenceSurface(self._start, self._topology)

    @cached_property
    def _classes(self) -> StarClasses:
        return classify_stars(self._start, self._topology)

    def measures(self, vertices: Tensor) -> dict[str, float]:
        """Of vertices (V, 3).

        Returns:
            ``largest_displacement`` and ``mean_displacement`` from the places at the start, in their unit;
            ``largest_distance_from_start``: that of a vertex from the surface at the start, in mean edges of that;
            ``convex_stars``, ``good_saddles``, ``bad_saddles``, ``neither_stars``: inner vertices by their kind
            (:func:`torchfair.stars.classify_stars`); ``changed_stars``: those of another kind than at the start.
        """
        moved: Tensor = torch.linalg.vector_norm(vertices - self._start, dim=1)
        away = self._surface.closest(vertices).distances
        same = torch.equal(vertices, self._start)
        classes = self._classes if same else classify_stars(vertices, self._topology)
        return {
            "largest_displacement": float(moved.max()),
            "mean_displacement": float(moved.mean()),
            "largest_distance_from_start": float(away.max() / edge_lengths(self._start, self._topology).mean()),
            "convex_stars": float(classes.is_kind(StarKind.CONVEX).sum()),
            "good_saddles": float(classes.good.sum()),
            "bad_saddles": float(classes.bad_saddles.sum()),
            "neither_stars": float(classes.is_kind(StarKind.NEITHER).sum()),
            "changed_stars": float((_kinds(classes) != _kinds(self._classes)).sum()),
        }


def _kinds(classes: StarClasses) -> Tensor:
    """(V,) a number for each kind; good and bad saddles are two."""
    return classes.kinds.to(torch.int64) + len(StarKind) * classes.good.to(torch.int64)
