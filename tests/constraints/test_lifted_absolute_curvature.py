"""The target C in the paper's own variables: the start fits, what it leaves over, derivatives, and steps."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from geometry_meshes import split_faces, torus, with_isolated
from helpers import DOUBLE, grid_faces, split_quads, wavy_grid
from torch import Tensor

from torchfair import Topology
from torchfair.constraints import interior_fairness_terms
from torchfair.constraints.lifted_absolute_curvature import (
    lifted_absolute_curvature_blocks,
    lifted_absolute_curvature_terms,
)
from torchfair.errors import MeshError
from torchfair.geometry import edge_lengths, shape_operators
from torchfair.geometry.star_normals import star_normals
from torchfair.projection import ElementTerm, ProjectionSettings, guided_projection
from torchfair.shapes import FreeFormPatch, Torus, irregular_triangles

Mesh = tuple[Tensor, Topology]
LEAVES_A_REMAINDER = ("eigenvectors", "third eigenvalue")


def _shape(surface: FreeFormPatch | Torus, count: int) -> Mesh:
    mesh = irregular_triangles(surface, count)
    return mesh.vertices, mesh.topology


def tube(columns: int, rows: int, *, bulge: float = 0.0) -> Mesh:
    """A tube of radius 1 with equilateral triangles between two circles, the middle wider by ``bulge``."""
    row, column = torch.meshgrid(torch.arange(rows + 1), torch.arange(columns), indexing="ij")
    height = rows * math.sqrt(3) * math.pi / columns
    angle, along = 2 * math.pi * (column + 0.5 * row) / columns, row / rows
    radius = 1 + bulge * 4 * along * (1 - along)
    points = torch.stack([radius * angle.cos(), radius * angle.sin(), height * along], dim=-1).reshape(-1, 3)
    rectangle = split_quads(grid_faces(rows + 1, columns + 1))[:, ::-1]
    closed = rectangle // (columns + 1) * columns + rectangle % (columns + 1) % columns
    return points.to(DOUBLE), Topology.from_faces(np.ascontiguousarray(closed))


MESHES = {
    "torus": lambda: split_faces(torus(16, 10)),
    "irregular torus": lambda: _shape(Torus(), 200),
    "free form": lambda: _shape(FreeFormPatch(), 150),
    "crumpled": lambda: wavy_grid(triangles=True),
    "isolated vertex": lambda: with_isolated(wavy_grid(4, 4, triangles=True)),
    "flat": lambda: (wavy_grid(triangles=True)[0] * torch.tensor([1.0, 1, 0]), wavy_grid(triangles=True)[1]),
    "tube": lambda: tube(9, 5, bulge=0.3),
}
each_mesh = pytest.mark.parametrize("name", MESHES)


def start(mesh: Mesh) -> dict[str, Tensor]:
    return {"vertices": mesh[0], **lifted_absolute_curvature_blocks(*mesh)}


def values(term: ElementTerm, state: dict[str, Tensor]) -> Tensor:
    return term.values(term.arguments(state))


@each_mesh
def test_the_start_fits_all_constraints_that_ask_nothing_of_the_shape(name: str) -> None:
    mesh = MESHES[name]()
    state = start(mesh)
    *constraints, target = lifted_absolute_curvature_terms(mesh[1], smoothing=0.1)
    assert len({term.name for term in constraints}) == 8 + 1  # (2) is two terms: normals and directions
    for term in constraints:
        if term.name not in LEAVES_A_REMAINDER:
            assert float(values(term, state).abs().max()) < 1e-12, term.name
    assert torch.equal(values(target, state), state["curvatures"])


@each_mesh
def test_what_is_left_is_the_operator_in_the_direction_of_the_normal(name: str) -> None:
    """``W d - k d`` has no tangential part, and ``tr W - k1 - k2`` is ``N . W N``: both vanish if W N does."""
    vertices, topology = MESHES[name]()
    state = start((vertices, topology))
    normal = star_normals(vertices, topology)
    image = (shape_operators(vertices, topology) @ normal[:, :, None]).squeeze(2)
    terms = {term.name: term for term in lifted_absolute_curvature_terms(topology, smoothing=0.1)}
    left = values(terms["eigenvectors"], state).view(-1, 2, 3)
    along = (state["directions"].view(-1, 2, 3) * image[:, None]).sum(2)
    torch.testing.assert_close(left, along[:, :, None] * normal[:, None], rtol=0, atol=1e-12)
    third = values(terms["third eigenvalue"], state).squeeze(1)
    torch.testing.assert_close(third, (normal * image).sum(1), rtol=0, atol=1e-12)


def test_what_is_left_falls_with_the_third_power_of_the_edges() -> None:
    """The operators themselves fall with the second power, being curvatures times areas."""
    sizes = []
    for factor in (1, 2, 4):
        mesh = split_faces(torus(12 * factor, 8 * factor))
        terms = lifted_absolute_curvature_terms(mesh[1], smoothing=0.1)
        sizes.append([float(values(t, start(mesh)).abs().max()) for t in terms if t.name in LEAVES_A_REMAINDER])
    assert all(coarse > 2**2.6 * fine for coarse, fine in zip(sizes[1], sizes[2], strict=True))


def test_frames_are_orthonormal_and_curvatures_sorted() -> None:
    vertices, topology = MESHES["crumpled"]()
    blocks = lifted_absolute_curvature_blocks(vertices, topology)
    frames = torch.cat([blocks["directions"].view(-1, 2, 3), star_normals(vertices, topology)[:, None]], dim=1)
    torch.testing.assert_close(frames @ frames.mT, torch.eye(3, dtype=DOUBLE).expand_as(frames))
    assert bool((blocks["curvatures"][::2] >= blocks["curvatures"][1::2]).all())


def test_number_of_unknowns_is_that_of_the_paper() -> None:
    """A tube of 32 columns and 33 rows of vertices has V, F and E of Fig. 13a, where the paper counts 33k."""
    mesh = tube(32, 32)
    topology = mesh[1]
    assert (topology.num_vertices, topology.num_faces, topology.num_edges) == (1056, 2048, 3104)
    count = sum(block.numel() for block in start(mesh).values())
    interior = topology.num_interior_edges
    assert count == 17 * topology.num_vertices + 3 * topology.num_faces + 3 * interior
    assert round(count / 1000) == 33


def test_every_unknown_is_felt() -> None:
    vertices, topology = MESHES["free form"]()
    seen = {name: torch.zeros(len(block), dtype=torch.bool) for name, block in start((vertices, topology)).items()}
    for term in lifted_absolute_curvature_terms(topology, smoothing=0.1):
        for name, index in term.stencil:
            seen[name][index] = True
    assert all(bool(mask.all()) for mask in seen.values())


def test_jacobians_equal_finite_differences() -> None:
    """All residuals are polynomials of degree three at most; central differences are exact up to second order."""
    mesh = MESHES["crumpled"]()
    noise = torch.Generator().manual_seed(1)
    state = {name: b + 0.1 * torch.randn(b.shape, dtype=DOUBLE, generator=noise) for name, b in start(mesh).items()}
    for term in lifted_absolute_curvature_terms(mesh[1], smoothing=0.1):
        arguments = term.arguments(state)
        jacobian, column, step = term.jacobians(arguments), 0, 1e-4
        for place in range(len(term.stencil)):
            for unknown in range(arguments[place][0].numel()):
                ends = []
                for sign in (1, -1):
                    moved = [a.clone() for a in arguments]
                    moved[place].flatten(1)[:, unknown] += sign * step
                    ends.append(term.values(tuple(moved)))
                difference = (ends[0] - ends[1]) / (2 * step)
                torch.testing.assert_close(jacobian[:, :, column], difference, rtol=1e-6, atol=1e-7)
                column += 1
        assert column == jacobian.shape[2]


@pytest.mark.parametrize("smoothing", [1e-2, 1e-5])
def test_the_target_is_the_sum_of_absolute_eigenvalues_up_to_smoothing(smoothing: float) -> None:
    vertices, topology = MESHES["irregular torus"]()
    target = lifted_absolute_curvature_terms(topology, smoothing=smoothing, weight=2.0)[-1]
    arguments = target.arguments(start((vertices, topology)))
    merit = float(target.contributions(arguments, target.values(arguments)).sum())
    normal = star_normals(vertices, topology)
    tangential = torch.eye(3, dtype=DOUBLE) - normal[:, :, None] * normal[:, None, :]
    # The third eigenvalue of the operator between two projections is zero and adds nothing.
    exact = 2.0 * float(torch.linalg.svdvals(tangential @ shape_operators(vertices, topology) @ tangential).sum())
    assert exact - 2.0 * 2.0 * smoothing * topology.num_vertices <= merit <= exact


def test_steps_flatten_a_bulging_tube_and_keep_the_constraints() -> None:
    """Between two equal circles the cylinder has the smallest total absolute curvature."""
    vertices, topology = tube(24, 16, bulge=0.25)
    vertices = vertices / edge_lengths(vertices, topology).mean()
    lifted = lifted_absolute_curvature_terms(topology, smoothing=0.1, constraint_weight=1e3)
    terms = [*lifted, *interior_fairness_terms(topology, weight=1.0)]
    # Plain damped steps; corrected ones are on from there at once, to waisted tubes, which have even less C.
    settings = ProjectionSettings(
        max_iterations=10, initial_damping=1e-2, damping_scale="identity", least_uncorrected_gain=-math.inf
    )
    fixed = {"vertices": topology.is_boundary_vertex}
    result = guided_projection(start((vertices, topology)), terms, fixed=fixed, settings=settings)
    merits = [record.merit for record in result.history]
    assert merits == sorted(merits, reverse=True)
    assert merits[-1] < 0.95 * merits[0]
    radius, end = (torch.linalg.vector_norm(x[:, :2], dim=1) for x in (result.blocks["vertices"], vertices[:1]))
    assert float((radius - end).abs().max()) < 0.25 * 0.25 * float(end)
    constraints = {term.name for term in lifted[:-1]}
    assert all(row.largest < 0.02 for row in result.residuals if row.name in constraints)


def test_wrong_curvatures_are_pulled_to_the_eigenvalues() -> None:
    """With the rest held, (5) asks for ``d . W d``, (8) for a sum larger by ``N . W N``: each gives it a third."""
    mesh = MESHES["crumpled"]()
    right = start(mesh)
    wrong = {**right, "curvatures": right["curvatures"] + 0.1}
    fixed = {name: torch.ones(len(block), dtype=torch.bool) for name, block in right.items() if name != "curvatures"}
    constraints = lifted_absolute_curvature_terms(mesh[1], smoothing=0.1, constraint_weight=1.0)[:-1]
    found = guided_projection(wrong, constraints, fixed=fixed).blocks["curvatures"].view(-1, 2)
    normal = star_normals(*mesh)[:, None]
    remainder = (normal @ shape_operators(*mesh) @ normal.mT).squeeze(2)
    torch.testing.assert_close(found, right["curvatures"].view(-1, 2) + remainder / 3, rtol=0, atol=1e-6)


def test_single_precision_stays_single() -> None:
    vertices, topology = MESHES["crumpled"]()
    state = start((vertices.float(), topology))
    for term in lifted_absolute_curvature_terms(topology, smoothing=0.1):
        assert {t.dtype for t in term.linearised(term.arguments(state))} == {torch.float32}


def test_other_polygons_are_refused() -> None:
    vertices, topology = wavy_grid(4, 4)
    with pytest.raises(MeshError, match="Triangulate"):
        lifted_absolute_curvature_terms(topology, smoothing=0.1)
    with pytest.raises(MeshError, match="Triangulate"):
        lifted_absolute_curvature_blocks(vertices, topology)
