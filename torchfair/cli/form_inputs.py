"""What ``torchfair form`` starts from: a mesh, boundary curves, or both."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from .errors import CommandError
from .inputs import read_input

if TYPE_CHECKING:
    from torch import Tensor

    from ..curves import ClosedCurve
    from ..io import PolygonMesh


class FormInput(NamedTuple):
    """A start and its boundary.

    Attributes:
        mesh: The start.
        curves: Boundary curves, empty if none were given.
        normals: (V, 3) prescribed normals of boundary vertices, or None.
    """

    mesh: PolygonMesh
    curves: list[ClosedCurve]
    normals: Tensor | None

    def nearest(self, points: Sequence[Sequence[float]]) -> dict[int, list[float]]:
        """The nearest inner vertex of every point, with the point as target."""
        import torch

        inner = torch.nonzero(~self.mesh.topology.is_boundary_vertex & (self.mesh.topology.valences > 0)).squeeze(1)
        if points and not inner.numel():
            raise CommandError("--through: the start has no inner vertices")
        targets = {}
        for point in points:
            place = torch.tensor(point, dtype=torch.float64)
            distances = (self.mesh.vertices[inner].double() - place).norm(dim=1)
            vertex = int(inner[distances.argmin()])
            if vertex in targets:
                raise CommandError("--through: two points are nearest to the same vertex; use a finer start")
            targets[vertex] = list(point)
        return targets


def read_form_input(arguments: argparse.Namespace, corner_angle: float) -> FormInput:
    """Reads mesh and curves; makes a start from the curves if there is no mesh."""
    from ..curves import ClosedCurve
    from ..formfinding import prescribed_normals, start_surface
    from ..io import PolygonMesh, load_curve

    if arguments.input is None and not arguments.curve:
        raise CommandError("give a mesh to start from, or boundary curves by --curve FILE")
    files = [load_curve(name) for name in arguments.curve]
    curves = [ClosedCurve(file.points, corner_angle=corner_angle) for file in files]
    if arguments.input is not None:
        mesh = read_input(arguments.input, arguments.repair)
    else:
        mesh = PolygonMesh(*start_surface(curves, arguments.vertices))
    given = [(curve, file.normals) for curve, file in zip(curves, files, strict=True) if file.normals is not None]
    normals = prescribed_normals(mesh.vertices, mesh.topology, curves, given) if given else None
    return FormInput(mesh, curves, normals)
