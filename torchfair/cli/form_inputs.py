"""What ``torchfair form`` starts from: a mesh, boundary curves, or both."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from .distances import from_segments
from .errors import CommandError
from .inputs import read_input

if TYPE_CHECKING:
    from torch import Tensor

    from ..curves import ClosedCurve
    from ..io import PolygonMesh


_ON_THE_RIM = 0.05  # mean edge lengths


class FormInput(NamedTuple):
    """A start and its boundary.

    Attributes:
        mesh: The start.
        curves: Boundary curves, empty if none were given.
        normals: (V, 3) prescribed normals of boundary vertices, or None.
        notes: What was decided while reading, in words.
    """

    mesh: PolygonMesh
    curves: list[ClosedCurve]
    normals: Tensor | None
    notes: list[str]

    def nearest(self, points: Sequence[Sequence[float]]) -> dict[int, list[float]]:
        """The nearest inner vertex of every point, with the point as target."""
        import torch

        inner = torch.nonzero(~self.mesh.topology.is_boundary_vertex & (self.mesh.topology.valences > 0)).squeeze(1)
        if points and not inner.numel():
            raise CommandError("--through: the start has no inner vertices")
        targets = {}
        for point in points:
            place = torch.tensor(point, dtype=torch.float64)
            if not self._is_reached(point, place):
                continue
            distances = (self.mesh.vertices[inner].double() - place).norm(dim=1)
            vertex = int(inner[distances.argmin()])
            if vertex in targets:
                raise CommandError("--through: two points are nearest to the same vertex; use a finer start")
            targets[vertex] = list(point)
        return targets

    def _is_reached(self, point: Sequence[float], place: Tensor) -> bool:
        """Whether a vertex has to be pulled to the point; says where that asks for much, or for nothing."""
        import torch

        from ..geometry import edge_lengths

        vertices, topology = self.mesh.vertices.double(), self.mesh.topology
        words = "--through " + " ".join(f"{x:g}" for x in point)
        rim = vertices[topology.boundary_edges]
        if rim.numel():
            gap = float(from_segments(place, rim).min())
            edge = float(edge_lengths(vertices, topology).mean())
            if gap < _ON_THE_RIM * edge:
                self.notes.append(f"{words} lies on the boundary, which passes there anyway: left out")
                return False
            if gap < edge:
                self.notes.append(
                    f"{words} lies {gap / edge:.2g} mean edges from the boundary: the surface is steep there"
                )
        extent = float((vertices.amax(0) - vertices.amin(0)).max())
        away = float(torch.linalg.vector_norm(vertices - place, dim=1).min())
        if away > extent:
            self.notes.append(
                f"{words} lies {away:.4g} from the start, which is {extent:.4g} across: check its unit and its order"
            )
        return True


def read_form_input(arguments: argparse.Namespace, corner_angle: float) -> FormInput:
    """Reads mesh and curves; makes a start from the curves if there is no mesh."""
    from ..curves import ClosedCurve
    from ..formfinding import prescribed_normals, start_surface
    from ..io import PolygonMesh, load_curves

    if arguments.input is None and not arguments.curve:
        raise CommandError("give a mesh to start from, or boundary curves by --curve FILE")
    files = [file for name in arguments.curve for file in load_curves(name, close=arguments.close)]
    curves = [ClosedCurve(file.points, corner_angle=corner_angle) for file in files]
    if arguments.input is not None:
        mesh = read_input(arguments.input, arguments)
    else:
        mesh = PolygonMesh(*start_surface(curves, arguments.vertices))
    given = [(curve, file.normals) for curve, file in zip(curves, files, strict=True) if file.normals is not None]
    normals = prescribed_normals(mesh.vertices, mesh.topology, curves, given) if given else None
    return FormInput(mesh, curves, normals, [note for file in files for note in file.notes])
