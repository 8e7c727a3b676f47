"""Tangent planes along boundary curves, as normals of boundary vertices."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from ...curves import ClosedCurve
from ...errors import ShapeError
from ...topology import Topology
from .boundary_track import BoundaryTrack


def prescribed_normals(
    vertices: Tensor,
    topology: Topology,
    curves: Sequence[ClosedCurve],
    given: Sequence[tuple[ClosedCurve, Tensor]],
) -> Tensor:
    """Normals (V, 3) float64 for ``minimise_absolute_curvature``: unit at the vertices of given curves, else zero.

    Between the points of a curve normals are interpolated linearly.

    Args:
        vertices: (V, 3).
        topology: Its boundary lies near the curves.
        curves: All of them, one for each boundary loop.
        given: Some of these curves, each with the normals (n, 3) at its points.

    Raises:
        ShapeError: normals are not one for each point of their curve.
        MeshError: the curves do not fit the boundary.

    Example:
        >>> import math
        >>> import torch
        >>> from torchfair.curves import ClosedCurve
        >>> from torchfair.formfinding import prescribed_normals, start_surface
        >>> turn = torch.linspace(0, 2 * math.pi, 25)[:-1].double()
        >>> curve = ClosedCurve(torch.stack([turn.cos(), turn.sin(), 0 * turn], dim=1))
        >>> vertices, topology = start_surface([curve], 60)
        >>> upwards = torch.tensor([0.0, 0.0, 1.0]).double().expand(24, 3)
        >>> normals = prescribed_normals(vertices, topology, [curve], [(curve, upwards)])
        >>> normals[topology.is_boundary_vertex].mean(0)
        tensor([0., 0., 1.], dtype=torch.float64)
    """
    track = BoundaryTrack.onto(vertices.detach().to("cpu", torch.float64), topology.to("cpu"), curves)
    result = torch.zeros(topology.num_vertices, 3, dtype=torch.float64)
    for curve, normals in given:
        if tuple(normals.shape) != (curve.knots.shape[0], 3):
            raise ShapeError("normals of a curve", f"({curve.knots.shape[0]}, 3)", tuple(normals.shape))
        mine = torch.nonzero(track.curve_numbers == track.curves.index(curve)).squeeze(1)
        at, known = track.parameters[mine].numpy(), curve.knots.numpy()
        columns = [np.interp(at, known, column, period=1.0) for column in normals.detach().double().numpy().T]
        found = torch.from_numpy(np.stack(columns, 1))
        result[mine] = found / found.norm(dim=1, keepdim=True).clamp_min(1e-300)
    return result
