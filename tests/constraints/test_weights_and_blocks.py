"""Every ready-made term weighs what it is told to, and acts on the block that is named."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import pytest
import torch
from helpers import DOUBLE, wavy_grid

from torchfair import constraints as c
from torchfair.constraints.closeness import TangentPlanes
from torchfair.constraints.eliminated_principal_symmetric import eliminated_principal_symmetric_terms
from torchfair.geometry import SplineCurves, face_areas
from torchfair.geometry.closest_point import ReferenceSurface
from torchfair.principal import principal_edges_of_lattice
from torchfair.projection import ElementTerm
from torchfair.shapes import Torus, principal_triangles

BLOCK, WEIGHT = "points", 7.0
QUADS = wavy_grid(7, 6)
VERTICES, TOPOLOGY = wavy_grid(7, 6, triangles=True)
FLAT = VERTICES * torch.tensor([1.0, 1.0, 0.0], dtype=DOUBLE)
RIM = torch.nonzero(TOPOLOGY.is_boundary_vertex).squeeze(1)
UP = torch.tensor([0.0, 0.0, 1.0], dtype=DOUBLE)
MESH = principal_triangles(Torus(2.0, 1.0), 12, 16)
STARS = principal_edges_of_lattice(MESH).stars()
PLANES = TangentPlanes(ReferenceSurface(VERTICES, TOPOLOGY), BLOCK)
FEET = c.CurveFeet(SplineCurves([VERTICES[:4]], [False]), RIM[:4], torch.zeros(4, dtype=torch.int64), block=BLOCK)
COMMON = {"weight": WEIGHT, "block": BLOCK}


def every_edge() -> torch.Tensor:
    edges = principal_edges_of_lattice(MESH)
    return c.between_stars(MESH.topology.edges[edges.mask], STARS)


MAKERS: dict[str, Callable[[], Sequence[ElementTerm]]] = {
    "curvature": lambda: c.absolute_curvature_terms(TOPOLOGY, smoothing=0.1, **COMMON),
    "bending": lambda: c.boundary_bending_terms(TOPOLOGY, UP * torch.ones_like(VERTICES), smoothing=0.1, **COMMON),
    "closeness": lambda: c.closeness_terms(PLANES, torch.arange(len(VERTICES)), **COMMON),
    "distance limit": lambda: c.distance_limit_terms(PLANES, torch.ones(len(VERTICES), dtype=DOUBLE), **COMMON),
    "angles": lambda: c.corner_angle_terms(TOPOLOGY, 0.1, torch.ones(len(TOPOLOGY.corners), dtype=DOUBLE), **COMMON),
    "areas": lambda: c.face_area_terms(TOPOLOGY, face_areas(VERTICES, TOPOLOGY), **COMMON),
    "boundary fairness": lambda: c.boundary_fairness_terms(
        TOPOLOGY, torch.zeros(len(VERTICES), dtype=torch.bool), **COMMON
    ),
    "displacement fairness": lambda: c.displacement_fairness_terms(VERTICES, TOPOLOGY, **COMMON),
    "even fairness": lambda: c.even_fairness_terms(VERTICES, TOPOLOGY, **COMMON),
    "fairness of quads": lambda: c.interior_fairness_terms(QUADS[1], **COMMON),
    "fairness of triangles": lambda: c.interior_fairness_terms(TOPOLOGY, **COMMON),
    "tangential fairness": lambda: c.tangential_fairness_terms(TOPOLOGY, **COMMON),
    "gliding": lambda: c.gliding_terms(FEET, weight=WEIGHT),
    "handles": lambda: c.handle_terms(RIM[:4], VERTICES[RIM[:4]], **COMMON),
    "normal variation of triangles": lambda: c.normal_variation_terms(TOPOLOGY, smoothing=0.1, **COMMON),
    "normal variation of quads": lambda: c.normal_variation_terms(QUADS[1], smoothing=0.1, **COMMON),
    "planarity": lambda: c.planarity_terms(QUADS[1], torch.arange(5), **COMMON),
    "pyramids": lambda: c.pyramid_terms(TOPOLOGY, **COMMON),
    "saddles": lambda: c.saddle_terms(VERTICES, TOPOLOGY, ~TOPOLOGY.is_boundary_vertex, **COMMON),
    "tangent planes": lambda: c.tangent_plane_terms(TOPOLOGY, RIM, UP.expand(len(RIM), 3), **COMMON),
    "tangent patches": lambda: c.tangent_patch_terms(FLAT, TOPOLOGY, RIM, UP.expand(len(RIM), 3), **COMMON),
    "tangent patches that do not fit": lambda: c.tangent_patch_terms(
        VERTICES, TOPOLOGY, RIM, UP.expand(len(RIM), 3), **COMMON
    ),
    "cospherical": lambda: c.cospherical_terms(STARS, **COMMON),
    "coplanar": lambda: c.coplanar_terms(every_edge(), STARS, **COMMON),
    "even stars": lambda: c.even_star_terms(STARS, **COMMON),
    "saddle sides": lambda: c.SaddleSides(STARS, block=BLOCK).terms(weight=WEIGHT),
    "blind saddle sides": lambda: c.SaddleSides(STARS, block=BLOCK).terms(weight=WEIGHT, ahead=False),
}


@pytest.mark.parametrize("name", MAKERS)
def test_weights_and_blocks_are_those_given(name: str) -> None:
    terms = MAKERS[name]()
    assert terms
    for term in terms:
        assert term.weight == WEIGHT
        assert (term.stencil[0][0] == BLOCK) != (term.name == "unit normals")  # which are blocks of their own
        assert term.num_elements > 0


def test_the_miss_of_a_sphere_counts_for_all_four_neighbours() -> None:
    terms = eliminated_principal_symmetric_terms(every_edge(), STARS, **COMMON)
    assert [term.weight for term in terms] == [4.0 * WEIGHT, WEIGHT]
    assert all(term.stencil[0][0] == BLOCK for term in terms)


@pytest.mark.parametrize("name", [name for name in MAKERS if name not in ("gliding", "planarity")])
def test_terms_take_their_arguments_from_their_block_alone(name: str) -> None:
    """Also what is refreshed at every state."""
    points = {"fairness of quads": QUADS[0], "normal variation of quads": QUADS[0]}.get(name, VERTICES)
    on_lattice = name in ("cospherical", "coplanar", "even stars", "saddle sides", "blind saddle sides")
    points = MESH.vertices if on_lattice else points
    state = {BLOCK: points, **(c.sphere_blocks(points, STARS) if on_lattice else {})}
    for term in MAKERS[name]():
        assert bool(torch.isfinite(term.values(term.arguments(state))).all())
