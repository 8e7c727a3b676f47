"""A boundary that is free, but does not shrink: E falls where a sheet becomes smaller, which makes nothing smoother."""

from __future__ import annotations

from dataclasses import replace

import torch
from torch import Tensor

from ... import constraints as c
from ...constraints.gliding import CurveFeet
from ...projection import ElementTerm
from ...topology import Topology
from ..job.pulls import Pulls
from .feature_curves import FeatureCurves


class FreeBoundary:
    """Draws boundary vertices to the curves along the boundary, and corners to their places; neither has to stay.

    Args:
        vertices: (V, 3) the start.
        topology: Connectivity.
        curves: Along its boundary.
        pulls: Handles and held vertices are left alone.
    """

    def __init__(self, vertices: Tensor, topology: Topology, curves: FeatureCurves, pulls: Pulls) -> None:
        self._pulls, rim, splines = pulls, curves.rim, curves.rim.splines()
        chosen = torch.nonzero(rim.owners >= 0).squeeze(1)
        self._feet = None if splines is None else CurveFeet(splines, chosen, rim.owners[chosen])
        self._corners = torch.nonzero(rim.corners & topology.is_boundary_vertex).squeeze(1)
        self._places = vertices[self._corners]

    def terms(self, *, weight: float) -> list[ElementTerm]:
        """The weight multiplies half the squared distances; none where it is 0."""
        if not weight:
            return []
        away = self._pulls.pulled | self._pulls.held
        found = c.handle_terms(self._corners, self._places, weight=weight, name="free boundary")
        chosen = [self._corners] * len(found)
        if self._feet is not None:
            found += [replace(term, name="free boundary") for term in c.gliding_terms(self._feet, weight=weight)]
            chosen += [self._feet.vertices] * (len(found) - len(chosen))
        free = [(~away[rows]).to(self._places) for rows in chosen]
        return [replace(term, element_weights=weights) for term, weights in zip(found, free, strict=True)]
