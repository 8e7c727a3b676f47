"""Strips of quads in space and on the sheet, with their faults."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cached_property

import torch
from torch import Tensor

from ..geometry import planarity
from ..topology import Topology


@dataclass(frozen=True, eq=False, repr=False)
class DevelopableStrips:
    r"""Strips of quads in space and laid flat, made by :func:`developable_strips`.

    Ruling r of a strip stands on a vertex v of the mesh, from ``v - depth n(v)`` to ``v + height n(v)``; vertices 2r
    and 2r + 1 are its ends. The ends of a strip have no common vertices even where the polyline is closed, so that
    strips in space and on the sheet have the same topology::

        2r+1 ---- 2r+3 ----         face normals: (w - v) x n(v)
         |         |                in the plane: counterclockwise, so seen from where the face normals point to
        2r ------ 2r+2 ----

    Attributes:
        vertices: (2N, 3) float64 in space.
        topology: quads, one after the other along each strip.
        uv: (2N, 2) float64 on the sheet, in the same length unit, lower left corner of the sheet at 0.
        sheet: width and height of the sheet; of all of them above each other, if there are several.
        mesh_vertices: (N,) vertex of the mesh that each ruling stands on.
        offsets: (S+1,) rulings of strip s are ``offsets[s]`` to ``offsets[s + 1] - 1``.
        polylines: (S,) number of the polyline that each strip belongs to.
        names: (S,) number of the polyline counted from 1, with a letter where it was cut into several strips.
        sheets: how many there are, of equal height.
    """

    vertices: Tensor
    topology: Topology
    uv: Tensor
    sheet: tuple[float, float]
    mesh_vertices: Tensor
    offsets: Tensor
    polylines: Tensor
    names: tuple[str, ...]
    sheets: int = 1

    def __repr__(self) -> str:
        return f"DevelopableStrips({len(self.names)} strips, {self.topology.num_faces} quads)"

    @cached_property
    def planarity(self) -> Tensor:
        """(Q,) distance of the diagonals of each quad in space over its mean edge."""
        return planarity(self.vertices, self.topology)

    @cached_property
    def isometry_errors(self) -> Tensor:
        """(Q,) largest relative change of length, between space and sheet, of the sides and diagonals of each quad.

        Only the diagonal from the lower left to the upper right corner can differ, and that only where a quad is not
        planar: with the square of the deviation from planarity.
        """
        quads = self.topology.corners.view(-1, 4)
        pairs = quads[:, [[0, 1], [1, 2], [2, 3], [3, 0], [0, 2], [1, 3]]]
        flat, space = (
            torch.linalg.vector_norm(points[pairs[..., 0]] - points[pairs[..., 1]], dim=-1)
            for points in (self.uv, self.vertices)
        )
        errors: Tensor = (flat / space - 1).abs().amax(1)
        return errors

    def outlines(self) -> list[Tensor]:
        """(2n, 2) outline of each strip on the sheet, counterclockwise: along the lower ends, back along the upper."""
        rulings = self.uv.view(-1, 2, 2)
        spans = itertools.pairwise(self.offsets.tolist())
        return [torch.cat([rulings[a:b, 0], rulings[a:b, 1].flip(0)]) for a, b in spans]
