"""A boundary that is free, but does not shrink: E falls where a sheet becomes smaller, which makes nothing smoother."""

from __future__ import annotations

from dataclasses import replace

import torch
from torch import Tensor

from ... import constraints as c
from ...projection import ElementTerm
from ..boundary_curves import BoundaryCurves
from ..job.pulls import Pulls


class FreeBoundary:
    """Draws boundary vertices to the curves along the boundary, and corners to their places; neither has to stay.

    Args:
        vertices: (V, 3) the start.
        curves: Along its boundary.
        pulls: Handles and held vertices are left alone.
    """

    def __init__(self, vertices: Tensor, curves: BoundaryCurves, pulls: Pulls) -> None:
        self._pulls, self._feet = pulls, curves.feet()
        self._corners = torch.nonzero(curves.corners).squeeze(1)
        self._places = vertices[self._corners]

    def terms(self, *, weight: float) -> list[ElementTerm]:
        """The weight multiplies half the squared distances; none where it is 0."""
        if not weight:
            return []
        free = (~(self._pulls.pulled | self._pulls.held)).to(self._places)
        corners = c.handle_terms(self._corners, self._places, weight=weight, name="free boundary")
        found = [replace(term, element_weights=free[self._corners]) for term in corners]
        if self._feet is None:
            return found
        gliding, weights = c.gliding_terms(self._feet, weight=weight), free[self._feet.vertices]
        return found + [replace(term, name="free boundary", element_weights=weights) for term in gliding]
