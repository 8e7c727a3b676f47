"""Boundary vertices know their curves, and the spans between corners that they lie on."""

from __future__ import annotations

import torch

from torchfair.curves import ClosedCurve
from torchfair.formfinding import start_surface
from torchfair.formfinding.form.boundary_track import BoundaryTrack
from torchfair.geometry import SplineCurves


def drop(shift: float, corners: int) -> ClosedCurve:
    """A closed curve with 0, 1 or 2 corners."""
    t = torch.arange(24, dtype=torch.float64) / 24 * 2.0 * torch.pi
    points = torch.stack([t.cos() * (1.0 + 0.2 * t.sin()), t.sin(), torch.full_like(t, shift)], 1)
    return ClosedCurve(points, corners=[5, 16][:corners])


def test_spans_of_vertices_are_those_through_their_places() -> None:
    """Numbered over all curves in a row, in the order of the boundary loops; corners belong to one of two."""
    for corners in ((2, 1), (0, 2), (1, 0)):
        curves = [drop(0.0, corners[0]), drop(1.0, corners[1])]
        vertices, topology = start_surface(curves, 200)
        track = BoundaryTrack.onto(vertices, topology, curves)
        spans = [span for curve in track.curves for span in curve.spans()]
        assert len(spans) == max(1, corners[0]) + max(1, corners[1])
        rim = torch.nonzero(topology.is_boundary_vertex).squeeze(1)
        own = track.spans(rim)
        assert own.unique().tolist() == list(range(len(spans)))
        splines = SplineCurves([span.points for span in spans], [span.closed for span in spans])
        assert float(splines.closest(track.positions(vertices)[rim], own).distances.max()) < 1e-12
        assert int(track.corners.sum()) == sum(corners)
