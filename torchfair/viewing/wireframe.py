"""Discreet edges for shaded pictures."""

from __future__ import annotations

import torch
from torch import Tensor

from .._graph import edge_numbers
from ..geometry import face_area_vectors, face_centres
from .camera import towards_eye
from .lines import EdgeStyle
from .render import MeshView

_STRONG, _STRONGEST = 1.6, 2.6  # pixels
_RIM = 0.8
_INK = (0.10, 0.13, 0.19)


def quiet_edges(view: MeshView, strong: Tensor | None = None) -> EdgeStyle:
    """Thin dark lines that keep the faces in the foreground: the shorter the edges on the screen, the fainter.

    Boundary edges are drawn stronger, and edges between vertices ``strong`` (n, 2) still stronger.
    """
    topology = view.topology
    widths = torch.full((topology.num_edges,), line_width(view, 0.05, 0.35, 1.0), device=view.points.device)
    widths[topology.num_interior_edges :] = _STRONG
    if strong is not None:
        widths[edge_numbers(topology, strong)] = _STRONGEST
    return EdgeStyle(torch.tensor(_INK), widths, opacity=0.55)


def outline(view: MeshView) -> EdgeStyle:
    """The boundary, the edges where the surface turns away from the eye, and where the mesh ends on the screen."""
    topology = view.topology
    widths = torch.zeros(topology.num_edges, dtype=torch.float64, device=view.points.device)
    to_eye = towards_eye(view.camera, face_centres(view.vertices, topology))
    front = (face_area_vectors(view.vertices, topology) * to_eye).sum(-1) >= 0
    left, right = topology.interior_edge_faces.unbind(1)
    widths[: topology.num_interior_edges] = 1.4 * (front[left] != front[right])
    widths[topology.num_interior_edges :] = 1.4
    return EdgeStyle(torch.tensor(_INK), widths, opacity=0.8, rim=_RIM)


def line_width(view: MeshView, share: float, thinnest: float, thickest: float) -> float:
    """``share`` of the median edge length on the screen, within bounds, all in pixels."""
    ends = view.points[view.topology.edges][..., :2]
    lengths = torch.linalg.vector_norm(ends[:, 1] - ends[:, 0], dim=-1)
    lengths = lengths[torch.isfinite(lengths)]
    if lengths.shape[0] == 0:
        return thinnest
    return min(max(share * float(lengths.median()) / view.supersampling, thinnest), thickest)
