"""Bounds on corner angles, areas and sides of faces in the job that lowers E, as barriers and as numbers."""

from __future__ import annotations

import math
from functools import cached_property

import torch
from torch import Tensor

from ... import constraints as c
from ...geometry import corner_angles, face_areas
from ...projection import ElementTerm
from ...settings.fair_settings import FairSettings
from ...topology import Topology
from ..job.pulls import Pulls
from .panel_sizes import growth_terms, own_sizes
from .short_sides import ShortSides

_SAFE_ANGLE = math.radians(25.0)  # from where on the barrier of angles is silent
_LEAST_SAFETY = math.radians(2.0)
KEPT_OF_OWN = 0.9  # area of a face that starts smaller than all are to be


class FaceBounds:
    """What no face may fall below or exceed, measured against the start.

    Args:
        vertices: (V, 3) start.
        topology: Its connectivity.
        pulls: Handles, which may stretch faces as they need.

    Attributes:
        sides: Sides of polygons, which must not collapse.
    """

    def __init__(self, vertices: Tensor, topology: Topology, pulls: Pulls) -> None:
        self._vertices, self._topology, self._pulls = vertices, topology, pulls
        self.sides = ShortSides.of(vertices, topology)

    def smallest_angle(self, settings: FairSettings) -> float:
        """Radians that no corner angle falls below: that of the start where it is smaller than asked."""
        return min(settings.smallest_angle, float(self._angles.min()) * (1.0 - 1e-9))

    def smallest_areas(self, settings: FairSettings) -> Tensor:
        """(F,) that no face falls below."""
        return settings.smallest_area * self._sizes(settings)

    def largest_areas(self, settings: FairSettings) -> Tensor | None:
        """(F,) that no face exceeds; None for no bound."""
        bounded = settings.quality_weight and 0.0 < settings.largest_area < math.inf
        if not bounded or self._pulls.everywhere or bool(self._pulls.pulled.any()):
            return None
        return settings.largest_area * own_sizes(self._vertices, self._topology)

    def terms(self, settings: FairSettings) -> list[ElementTerm]:
        """Barriers at the bounds."""
        smallest, weight = self.smallest_angle(settings), settings.quality_weight
        safe = self._angles.clamp(max=max(_SAFE_ANGLE, 2.0 * smallest)).clamp_min(smallest + _LEAST_SAFETY)
        areas, most = self._sizes(settings), self.largest_areas(settings)
        return [
            *([] if most is None else growth_terms(self._topology, most, weight=weight)),
            *c.corner_angle_terms(self._topology, smallest, safe, weight=weight),
            *c.face_area_terms(self._topology, areas, smallest=settings.smallest_area, weight=weight),
            *self.sides.terms(self._topology, settings.smallest_edge, weight=weight),
        ]

    def _sizes(self, settings: FairSettings) -> Tensor:
        """(F,) areas of which faces keep the fraction ``smallest_area``: their own, or more for a share of the mean."""
        own = face_areas(self._vertices, self._topology)
        if not (own.numel() and settings.smallest_area and settings.smallest_share):
            return own
        least = (KEPT_OF_OWN * own).clamp_max(settings.smallest_share * own.mean())
        return torch.maximum(own, least / settings.smallest_area)

    @cached_property
    def _angles(self) -> Tensor:
        return corner_angles(self._vertices, self._topology)
