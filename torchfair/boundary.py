"""The boundary of a mesh as curves: its corners, and the pieces between them."""

from __future__ import annotations

import itertools
from typing import NamedTuple

import torch
from torch import Tensor

from ._numbers import check_radians
from .errors import ShapeError
from .topology import Topology


class BoundaryPiece(NamedTuple):
    """A stretch of a boundary loop, in the direction that has the surface on the left.

    Attributes:
        vertices: (n,) vertex numbers in order; an open piece includes the corners at both ends.
        closed: whether it is a whole loop without corners, whose last vertex is joined to its first.
    """

    vertices: Tensor
    closed: bool


def boundary_corners(vertices: Tensor, topology: Topology, corner_angle: float) -> Tensor:
    r"""Boundary vertices at which the boundary polyline turns by more than ``corner_angle``.

    The turning angle is the one between the edge that arrives and the edge that leaves, in space: 0 where the
    boundary runs straight on, pi where it runs back. Nothing else makes a corner, neither the number of faces
    at the vertex nor the angle between them::

            ------>o
                    \  turning angle
                     v

    Args:
        vertices: (*batch, V, 3) positions, any length unit.
        topology: the connectivity; any polygons.
        corner_angle: radians, 0 to pi.

    Returns:
        (*batch, V) bool; false at interior and isolated vertices, and where a boundary edge beside the vertex
        has no length.

    Raises:
        ShapeError: if ``vertices`` is not a floating tensor (*batch, V, 3).
        SettingsError: if ``corner_angle`` is not between 0 and pi.
    """
    check_radians("corner_angle", corner_angle)
    return boundary_turning(vertices, topology) > corner_angle


def boundary_turning(vertices: Tensor, topology: Topology) -> Tensor:
    """By how much the boundary polyline turns at its vertices; see :func:`boundary_corners`.

    Args:
        vertices: (*batch, V, 3) positions, any length unit.
        topology: the connectivity; any polygons.

    Returns:
        (*batch, V) radians, 0 to pi; 0 at interior and isolated vertices, and where a boundary edge beside the vertex
        has no length. No derivatives.

    Raises:
        ShapeError: if ``vertices`` is not a floating tensor (*batch, V, 3).
    """
    topology.check_vertices(vertices)
    loops = topology.loop_vertices
    place = vertices.detach()[..., loops, :]
    leaving = vertices.detach()[..., loops[_following(topology)], :] - place
    arriving = torch.empty_like(leaving)
    arriving[..., _following(topology), :] = leaving
    sine = torch.linalg.vector_norm(torch.linalg.cross(arriving, leaving), dim=-1)
    turning: Tensor = sine.new_zeros(vertices.shape[:-1])
    turning[..., loops] = torch.atan2(sine, (arriving * leaving).sum(-1))
    return turning


def boundary_pieces(topology: Topology, corners: Tensor) -> list[BoundaryPiece]:
    """The boundary loops, cut at their corners.

    A loop with c > 0 corners gives c open pieces; neighbouring pieces share the corner between them, and with
    one corner the only piece starts and ends there. A loop without corners is one closed piece.

    Args:
        topology: the connectivity.
        corners: (V,) bool, such as from :func:`boundary_corners`; only boundary vertices are looked at.

    Returns:
        Pieces in the order of :meth:`Topology.boundary_loops`, those of one loop in the order along it from
        its first corner on.

    Raises:
        ShapeError: if ``corners`` is not a bool tensor (V,).
    """
    if not isinstance(corners, Tensor) or corners.shape != (topology.num_vertices,) or corners.dtype != torch.bool:
        actual = f"{tuple(corners.shape)} {corners.dtype}" if isinstance(corners, Tensor) else type(corners).__name__
        raise ShapeError("corners", f"a bool tensor ({topology.num_vertices},)", actual)
    pieces = []
    for loop in topology.boundary_loops():
        cuts = torch.nonzero(corners[loop]).squeeze(1).tolist()
        if not cuts:
            pieces.append(BoundaryPiece(loop, closed=True))
            continue
        # From the first corner once around and back to it.
        around = torch.cat([loop.roll(-cuts[0]), loop[cuts[0]].reshape(1)])
        stops = [cut - cuts[0] for cut in cuts] + [loop.shape[0]]
        pieces.extend(BoundaryPiece(around[a : b + 1], closed=False) for a, b in itertools.pairwise(stops))
    return pieces


def _following(topology: Topology) -> Tensor:
    """For every entry of ``loop_vertices`` the place of the next one along its loop."""
    offsets = topology.loop_offsets
    following = torch.arange(1, topology.loop_vertices.shape[0] + 1, device=topology.device)
    following[offsets[1:] - 1] = offsets[:-1]
    return following
