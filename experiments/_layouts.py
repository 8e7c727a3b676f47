"""Meshes of one saddle surface with equally many vertices, laid out in different ways."""

from __future__ import annotations

import math
from typing import Literal

from torchfair.meshing import QuadMesh
from torchfair.meshing import principal_quads as meshed
from torchfair.shapes import (
    Catenoid,
    Enneper,
    Hyperboloid,
    PrincipalParaboloid,
    ShapeMesh,
    Surface,
    Torus,
    irregular_triangles,
    principal_quads,
    principal_triangles,
    rotated_lattice,
)

QUADS = "principal quads"
ELONGATED, EQUILATERAL = "principal-symmetric, base = height", "principal-symmetric, equilateral"
SPLIT_25, SPLIT_45 = "split squares, turned 25°", "split squares, turned 45°"
HEXAGONAL_15, HEXAGONAL_22 = "equilateral, turned 15°", "equilateral, turned 22°"
IRREGULAR, IRREGULAR_2 = "irregular", "irregular, another seed"

PRINCIPAL = (QUADS, ELONGATED, EQUILATERAL)
TURNED_SPLIT = (SPLIT_25, SPLIT_45)
ALL_IRREGULAR = (IRREGULAR, IRREGULAR_2)
LAYOUTS = (*PRINCIPAL, HEXAGONAL_15, HEXAGONAL_22, *TURNED_SPLIT, *ALL_IRREGULAR)

SADDLES: dict[str, Surface] = {
    "paraboloid": PrincipalParaboloid(a=1.0, b=-0.5),
    "torus": Torus(2.0, 1.0, (math.pi - 0.8, math.pi + 0.8), angles=(-0.8, 0.8)),
    "catenoid": Catenoid(1.0, (-0.8, 0.8), angles=(-0.8, 0.8)),
    "hyperboloid": Hyperboloid(1.0, 1.0, (-0.8, 0.8), angles=(-0.7, 0.7)),
    "enneper": Enneper(0.7),
}
"""Patches on which K < 0, by name."""


def flat_direction(surface: Surface) -> Literal["u", "v"]:
    """The parameter lines of lower normal curvature, along which principal edges of triangles belong."""
    of_u, of_v = surface.absolute_line_curvatures()
    return "u" if of_u <= of_v else "v"


def layout(surface: Surface, name: str, rows: int, seed: int = 0) -> ShapeMesh:
    """A mesh with about ``rows**2`` vertices, cells as even as the parameters allow.

    Principal edges of principal-symmetric meshes run along the direction of lower curvature.
    """
    sides = _sides(surface)
    edge = math.sqrt(sides[0] * sides[1]) / rows
    columns_and_rows = [max(3, round(side / edge)) for side in sides]
    if name == QUADS:
        return principal_quads(surface, columns_and_rows[1], columns_and_rows[0])
    if name in (ELONGATED, EQUILATERAL):
        along = flat_direction(surface)
        base = edge * (1.0 if name == ELONGATED else math.sqrt(2 / math.sqrt(3)))
        lengths = (base, edge**2 / base) if along == "u" else (edge**2 / base, base)
        columns, lines = (max(3, round(side / length)) for side, length in zip(sides, lengths, strict=True))
        return principal_triangles(surface, lines, columns, along=along)
    if name in ALL_IRREGULAR:
        count = (columns_and_rows[0] + 1) * (columns_and_rows[1] + 1)
        return irregular_triangles(surface, count, 2 * seed + ALL_IRREGULAR.index(name))
    kind, angle = {
        SPLIT_25: ("split", 25.0), SPLIT_45: ("split", 45.0), HEXAGONAL_15: ("triangles", 15.0),
        HEXAGONAL_22: ("triangles", 22.0),
    }[name]  # fmt: skip
    turn = math.radians(angle)
    return rotated_lattice(surface, columns_and_rows[1], columns_and_rows[0], turn, kind=kind)  # type: ignore[arg-type]


def meshed_quads(triangles: ShapeMesh, rows: int) -> QuadMesh:
    """About ``rows**2`` quads along the principal directions of a triangle mesh, which is all that is known."""
    return meshed(triangles.vertices, triangles.topology, count=rows**2)


def _sides(surface: Surface) -> tuple[float, float]:
    """Mean lengths of the u-lines and v-lines of a patch."""
    import torch

    (u0, u1), (v0, v1) = surface.domain
    steps = (torch.arange(16, dtype=torch.float64) + 0.5) / 16
    u, v = torch.meshgrid(u0 + (u1 - u0) * steps, v0 + (v1 - v0) * steps, indexing="ij")
    x_u, x_v = (float(torch.linalg.vector_norm(x, dim=-1).mean()) for x in surface.tangents(u, v))
    return (u1 - u0) * x_u, (v1 - v0) * x_v
