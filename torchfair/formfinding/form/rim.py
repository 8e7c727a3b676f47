"""What is asked of a surface along its boundary: curves and tangent planes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import torch
from torch import Tensor

from ..._names import PlacedError, few
from ...curves import ClosedCurve
from ...errors import MeshError, ShapeError
from ...subdivision import Refinement
from ...topology import Topology
from .boundary_track import BoundaryTrack, new_boundary_vertices
from .starting.rims import refuse_crossing_rims, segment_distances

_SAMPLES = 200  # of a curve
_NEAR = 0.15  # of the extent of a boundary loop


class Rim(NamedTuple):
    """Curves and tangent planes along the boundary, in the unit of the input.

    Attributes:
        track: Boundary vertices on their curves.
        normals: (V, 3) prescribed unit normals of boundary vertices; zero where none is.
    """

    track: BoundaryTrack
    normals: Tensor

    @classmethod
    def of(
        cls,
        vertices: Tensor,
        topology: Topology,
        curves: Sequence[ClosedCurve] | None,
        normals: Tensor | None,
        corner_angle: float,
    ) -> Rim:
        """Given curves and normals; by default curves through the boundary ``vertices`` (V, 3), and no normals.

        Raises:
            ShapeError: normals are not ``(V, 3)``.
            MeshError: curves do not fit the boundary, or normals are not finite or prescribed inside.
        """
        unit = _unit_normals(normals, topology)
        if curves is None:
            return cls(BoundaryTrack.through(vertices, topology, corner_angle), unit)
        return cls(BoundaryTrack.onto(vertices, topology, curves), unit)

    def refined(self, refinement: Refinement) -> Rim:
        """On the finer mesh: new vertices lie on the curves, and have the mean normal of both ends."""
        return Rim(self.track.refined(refinement), _refined_normals(self.normals, refinement))

    def renumbered(self, topology: Topology, numbers: Tensor) -> Rim:
        """On another mesh with the same boundary, whose vertices have the ``numbers`` (V,) there; -1 inside."""
        normals = self.normals.new_zeros(topology.num_vertices, 3)
        old = torch.nonzero(self.track.curve_numbers >= 0).squeeze(1)
        normals[numbers[old]] = self.normals[old]
        return Rim(self.track.renumbered(topology, numbers), normals)

    def nearest(self, vertices: Tensor, *, glides: bool) -> Tensor:
        """The vertices (V, 3), those of the boundary in their places or, gliding, in the nearest on the curves."""
        track = self.track.updated(vertices) if glides else self.track
        return track.positions(vertices)


def check_rim(vertices: Tensor, topology: Topology, curves: Sequence[ClosedCurve] | None) -> None:
    """Refuses surfaces without a boundary, and curves that no boundary can follow or that this one does not.

    Raises:
        MeshError: the mesh is closed; curves cross, touch or repeat themselves or each other; or a curve is farther
            from its boundary loop than 0.15 times the extent of the loop.
    """
    if not len(topology.boundary_loops()):
        raise MeshError(
            "the mesh is closed: C of a closed surface is least when it has collapsed. Give a mesh with a boundary, or "
            "boundary curves"
        )
    if curves is None:
        return
    refuse_crossing_rims(curves)
    track = BoundaryTrack.onto(vertices, topology, curves)
    for number, loop in enumerate(topology.boundary_loops()):
        points, curve = vertices[loop], track.curves[number]
        extent = float(torch.linalg.vector_norm(points.amax(0) - points.amin(0)))
        samples = curve.at(curve.spaced(max(_SAMPLES, len(curve.corners))))
        there = torch.linalg.vector_norm(curve.at(track.parameters[loop]) - points, dim=1).max()
        places, ends = samples.numpy(), points.roll(-1, 0).numpy()
        back = segment_distances(places, places, points.numpy(), ends).min(1).max()
        away = max(float(there), float(back))
        if away > _NEAR * extent:
            raise MeshError(
                f"curve {list(curves).index(curve)} (counted from 0) is not the boundary of the mesh: they are up to "
                f"{away:.4g} apart, the boundary is {extent:.4g} across. Leave the mesh out to start from the curves "
                "alone, or give the curve of this boundary, in the unit of the mesh"
            )


def _unit_normals(normals: Tensor | None, topology: Topology) -> Tensor:
    """(V, 3) unit or zero."""
    if normals is None:
        return torch.zeros(topology.num_vertices, 3, dtype=torch.float64)
    if not isinstance(normals, Tensor) or tuple(normals.shape) != (topology.num_vertices, 3):
        actual = tuple(normals.shape) if isinstance(normals, Tensor) else type(normals).__name__
        raise ShapeError("normals", f"({topology.num_vertices}, 3), zero where none is prescribed", actual)
    given = normals.detach().to("cpu", torch.float64)
    lengths = given.norm(dim=1, keepdim=True)
    if not bool(torch.isfinite(lengths).all()):
        raise MeshError("prescribed normals must be finite; give zeros where none is prescribed")
    inside = torch.nonzero((lengths[:, 0] > 0.0) & ~topology.is_boundary_vertex).squeeze(1).tolist()
    if inside:
        raise PlacedError("normals are prescribed at boundary vertices only, not at vertices ", few("vertex", inside))
    return torch.where(lengths > 0.0, given / lengths.clamp_min(1e-300), given)


def _refined_normals(normals: Tensor, refinement: Refinement) -> Tensor:
    """Prescribed normals of the finer boundary: a new vertex has the mean of both ends if both are prescribed."""
    ends = normals[refinement.coarse.boundary_edges]
    mean = ends.sum(1)
    given = (ends != 0.0).any(2).all(1) & (mean != 0.0).any(1)
    mean = torch.where(given[:, None], mean / mean.norm(dim=1, keepdim=True), torch.zeros_like(mean))
    result = refinement.carry_vertex_labels(normals)
    result[new_boundary_vertices(refinement)] = mean
    return result
