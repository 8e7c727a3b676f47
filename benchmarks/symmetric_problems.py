"""Principal-symmetric designs at the sizes of table 20 of the paper."""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch

from torchfair.formfinding import SymmetricDesign, SymmetricSettings
from torchfair.principal import principal_edges_of_lattice
from torchfair.settings.symmetric_settings import Formulation
from torchfair.shapes import Catenoid, Surface, Torus, principal_triangles

Handles = dict[int, list[float]]
ENERGY_WEIGHT = 0.03  # of E where conditions hold on some polylines only


@dataclass(frozen=True)
class Shape:
    """A mesh and how its handles are pulled first.

    Attributes:
        rows, columns: of the lattice.
        pulls: away from the axis and along it, in sizes of the mesh, for handles in turn around the axis.
        at: parameter v of the four handles.
        held: parameter v of six handles that stay, None for none.
        target: steps per second.
    """

    surface: Surface
    rows: int
    columns: int
    pulls: tuple[tuple[float, float], tuple[float, float]]
    at: float
    held: float | None
    target: float | None


@dataclass(frozen=True)
class Case:
    """A row of table 20: thousands of variables, and seconds of one iteration.

    Attributes:
        size: vertices, a key of :data:`SHAPES`.
        variables, seconds: as printed.
        energy_weight: w_target as printed; 0 for none.
        on_polylines: whether conditions hold on four circles only and E is lowered elsewhere.
    """

    size: int
    variables: int
    seconds: float
    energy_weight: float
    on_polylines: bool = False


RING = Torus(2.0, 0.8)
OVAL = ((0.15, 0.0), (-0.10, 0.0))
SHAPES = {
    480: Shape(RING, 16, 30, OVAL, 0.0, None, 20.0),
    714: Shape(Catenoid(1.0, (-1.2, 1.2)), 16, 42, ((0.15, 0.05), (-0.10, -0.05)), 1.2, -1.2, 20.0),
    1920: Shape(RING, 32, 60, OVAL, 0.0, None, 4.0),
    7680: Shape(RING, 64, 120, OVAL, 0.0, None, None),
}
CASES = {
    "5ac": Case(714, 25, 0.53, 1e-6),
    "14bc": Case(480, 17, 0.49, 1e-9),
    "14d": Case(1920, 69, 7.07, 1e-9),
    "14e": Case(7680, 23, 6.65, 0.0),
    "14i": Case(480, 17, 0.06, 1e-9, on_polylines=True),
    "14h": Case(1920, 69, 0.97, 1e-9, on_polylines=True),
}


def variables_as_printed(vertices: int, edges: int, faces: int, *, with_energy: bool) -> int:
    """A count that gives the paper's: 17k, 69k and 25k with E, 23k of 7680 vertices without.

    Vertices and sphere centres, 3 V each; normals of faces, 3 F; l, l*, delta and mu, 4 E; and for *every* edge, not
    the principal third alone, the normal n(e) of a plane, 3 E, and a slack, E. The row without w_target has the
    vertices alone.
    """
    return 6 * vertices + 8 * edges + 3 * faces if with_energy else 3 * vertices


def prepared(
    shape: Shape,
    formulation: Formulation,
    *,
    most_steps: int = 150,
    on_polylines: bool = False,
    energy_weight: float = 0.0,
) -> tuple[SymmetricDesign, Handles]:
    """The design before its handles are pulled, and where they go first."""
    mesh = principal_triangles(shape.surface, shape.rows, shape.columns, along="u")
    vertices = mesh.vertices
    size = float(torch.linalg.vector_norm(vertices.amax(0) - vertices.amin(0)))

    def vertex(turn: float, v: float) -> int:
        place = shape.surface.position(*torch.tensor([[turn], [v]], dtype=torch.float64))
        return int(torch.linalg.vector_norm(vertices - place, dim=1).argmin())

    handles = {}
    for number in range(4):
        chosen = vertex(number * math.pi / 2, shape.at)
        x, y, z = vertices[chosen].tolist()
        outwards, upwards = (size * pull for pull in shape.pulls[number % 2])
        stretch = 1.0 + outwards / math.hypot(x, y)
        handles[chosen] = [stretch * x, stretch * y, z + upwards]
    if shape.held is not None:
        for number in range(6):
            chosen = vertex(number * math.pi / 3, shape.held)
            handles[chosen] = vertices[chosen].tolist()
    quarter = mesh.parameters[:, 1] / (math.pi / 2)
    on = torch.nonzero((quarter - quarter.round()).abs() < 1e-9).squeeze(1) if on_polylines else None
    weight = ENERGY_WEIGHT if on_polylines else energy_weight
    settings = SymmetricSettings(formulation=formulation, most_steps=most_steps, energy_weight=weight)
    principal = principal_edges_of_lattice(mesh, "u")
    design = SymmetricDesign(vertices, principal, handles=list(handles), on=on, settings=settings)
    return design, handles
