"""Design of principal-symmetric meshes: conditions met to rounding, saddles simple, levels, yielding, refusals."""

from __future__ import annotations

import math

import pytest
import torch
from helpers import DOUBLE, random_rotation, tetrahedron
from symmetric_starts import STARTS, largest, pulled, start

from torchfair import MeshError, ShapeError, Topology
from torchfair.constraints.principal_symmetric import star_stencil, unevenness
from torchfair.formfinding import SymmetricDesign, SymmetricSettings, principal_symmetric
from torchfair.geometry import vertex_normals
from torchfair.principal import PrincipalEdges, principal_edges_of_lattice
from torchfair.projection.result import IterationRecord
from torchfair.shapes import Cylinder, Paraboloid, Torus, principal_triangles
from torchfair.shapes.principal_triangles import parameter_triangles


@pytest.mark.parametrize("name", STARTS)
def test_pulled_by_a_fifth_of_the_size_and_refined_the_conditions_hold(name: str) -> None:
    vertices, edges = start(name)
    handles = pulled(vertices, edges, 0.2)
    result = principal_symmetric(vertices, edges, handles=handles, levels=1)
    assert not result.stopped
    assert len(result.levels) == 2
    for level in result.levels:
        assert largest(level.vertices, level.principal) < 1e-9
        assert level.after["saddle_side_share"] == 1.0
        assert level.after["crossing_pyramids_negative"] == 0.0
        assert level.after["smallest_angle_degrees"] > 10.0
        assert level.after["largest_handle_distance"] < 0.05 * level.after["mean_edge_length"]
    fine = result.levels[1]
    assert fine.vertices.shape[0] > 3 * vertices.shape[0]
    assert result.vertices is fine.vertices
    assert float(fine.after["negative_stars"]) > float(result.levels[0].after["negative_stars"])
    assert result.notes == []
    assert result.holds
    assert len(result.promises) == 5


def test_exact_starts_stay_where_they_are() -> None:
    vertices, edges = start("torus")
    result = principal_symmetric(vertices, edges)
    assert result.levels[0].steps <= 2
    assert float((result.vertices - vertices).abs().max()) < 1e-12


def quads_cut_row_by_row(rows: int, columns: int) -> tuple[torch.Tensor, PrincipalEdges]:
    """Principal quads of a torus, those of every other row cut by the other diagonal; circles of latitude principal."""
    rings = [2.0 + math.cos(2 * math.pi * i / rows) for i in range(rows)]
    heights = [math.sin(2 * math.pi * i / rows) for i in range(rows)]
    turns = [2 * math.pi * j / columns for j in range(columns)]
    points = [[r * math.cos(t), r * math.sin(t), z] for r, z in zip(rings, heights, strict=True) for t in turns]
    faces, marked = [], set()
    for i in range(rows):
        for j in range(columns):
            a, b = i * columns + j, i * columns + (j + 1) % columns
            d, c = (i + 1) % rows * columns + j, (i + 1) % rows * columns + (j + 1) % columns
            faces += [[a, b, d], [b, c, d]] if i % 2 else [[a, b, c], [a, c, d]]
            marked.add((min(a, b), max(a, b)))
    topology = Topology.from_faces(faces)
    mask = torch.tensor([(min(v, w), max(v, w)) in marked for v, w in topology.edges.tolist()])
    return torch.tensor(points, dtype=DOUBLE), PrincipalEdges(topology, mask).check()


def test_principal_quads_cut_by_diagonals_lose_their_shear() -> None:
    vertices, edges = quads_cut_row_by_row(12, 16)
    stencil = star_stencil(edges.stars())
    settings = SymmetricSettings(evenness_weight=3.0)
    result = principal_symmetric(vertices, edges, settings=settings)
    assert float(unevenness(vertices[stencil]).abs().max()) > 0.2
    assert float(unevenness(result.vertices[stencil]).abs().max()) < 1e-3
    assert result.after["energy_over_curvature"] < 1.2
    assert largest(result.vertices, edges) < 1e-8
    assert result.after["saddle_side_share"] == 1.0
    assert result.after["crossing_pyramids_negative"] == 0.0


def test_unit_and_place_do_not_matter() -> None:
    vertices, edges = start("enneper")
    turn, shift = random_rotation(2), torch.tensor([100.0, -50.0, 7.0], dtype=DOUBLE)
    handles = pulled(vertices, edges, 0.1)
    one = principal_symmetric(vertices, edges, handles=handles)
    placed = {v: (1000.0 * turn @ torch.tensor(p, dtype=DOUBLE) + shift).tolist() for v, p in handles.items()}
    other = principal_symmetric(1000.0 * vertices @ turn.T + shift, edges, handles=placed)
    expected = 1000.0 * one.vertices @ turn.T + shift
    edge = 1000.0 * one.after["mean_edge_length"]
    assert float((other.vertices - expected).norm(dim=1).max()) < 1e-3 * edge


def test_flat_and_cylindrical_meshes_stay_finite_and_exact() -> None:
    flat = parameter_triangles(Paraboloid(0.0, 0.0), 9, 9, ends="zigzag")
    bent = principal_triangles(Cylinder(), 8, 16, ends="zigzag")
    for mesh in (flat, bent):
        edges = principal_edges_of_lattice(mesh, "u")
        result = principal_symmetric(mesh.vertices, edges, handles=pulled(mesh.vertices, edges, 0.05))
        assert bool(torch.isfinite(result.vertices).all())
        assert largest(result.vertices, edges) < 1e-9


def test_fixed_vertices_and_boundaries_keep_their_places_through_levels() -> None:
    vertices, edges = start("catenoid")
    boundary = edges.topology.is_boundary_vertex
    handles = pulled(vertices, edges, 0.03)
    vertex = next(v for v in handles if not bool(boundary[v]))
    settings = SymmetricSettings(boundary="fixed")
    result = principal_symmetric(vertices, edges, handles={vertex: handles[vertex]}, levels=1, settings=settings)
    for level in result.levels:
        assert torch.equal(level.vertices[: len(vertices)][boundary], vertices[boundary])
    fixed = torch.zeros(len(vertices), dtype=torch.bool)
    fixed[edges.stars().vertices[5]] = True
    kept = principal_symmetric(vertices, edges, handles={vertex: handles[vertex]}, fixed=fixed)
    assert torch.equal(kept.vertices[fixed], vertices[fixed])


def test_handles_that_ask_for_the_impossible_yield_to_the_conditions() -> None:
    vertices, edges = start("enneper")
    stars = edges.stars().vertices
    middle = int(stars[len(stars) // 2])
    ring = edges.topology.ring_vertices[edges.topology.ring_offsets[middle] :][:6].tolist()
    handles = {v: vertices[v].tolist() for v in ring}
    handles[middle] = (vertices[middle] + 0.7 * vertex_normals(vertices, edges.topology)[middle]).tolist()
    result = principal_symmetric(vertices, edges, handles=handles)
    assert largest(result.vertices, edges) < 1e-8
    assert result.after["largest_handle_distance"] > 0.05
    assert any("handle" in note for note in result.notes)
    assert not result.holds


def test_closeness_holds_the_mesh_on_its_reference() -> None:
    vertices, edges = start("torus")
    generator = torch.Generator().manual_seed(0)
    bumpy = vertices + 0.05 * torch.randn(vertices.shape, generator=generator, dtype=DOUBLE)
    dense = principal_triangles(Torus(2.0, 1.0), 30, 42)
    settings = SymmetricSettings(closeness_weight=30.0)
    result = principal_symmetric(bumpy, edges, reference=(dense.vertices, dense.topology), settings=settings)
    assert largest(result.vertices, edges) < 1e-8
    ring = result.vertices[:, :2].norm(dim=1) - 2.0
    away = (torch.hypot(ring, result.vertices[:, 2]) - 1.0).abs()
    start_ring = bumpy[:, :2].norm(dim=1) - 2.0
    start_away = (torch.hypot(start_ring, bumpy[:, 2]) - 1.0).abs()
    assert float(away.mean()) < 0.5 * float(start_away.mean())


def test_merit_falls_within_runs_and_a_callback_stops_with_the_best_state() -> None:
    vertices, edges = start("torus")
    handles = pulled(vertices, edges, 0.2)
    result = principal_symmetric(vertices, edges, handles=handles)
    for run in result.levels[0].runs:
        merits = [record.merit for record in run.history]
        assert merits == sorted(merits, reverse=True)
    seen: list[IterationRecord] = []

    def stop(record: IterationRecord) -> bool:
        seen.append(record)
        return len(seen) > 4

    stopped = principal_symmetric(vertices, edges, handles=handles, levels=2, callback=stop)
    assert stopped.stopped
    assert len(stopped.levels) == 1
    assert bool(torch.isfinite(stopped.vertices).all())


def test_an_edit_from_a_warm_state_is_the_same_design() -> None:
    vertices, edges = start("torus")
    handles = pulled(vertices, edges, 0.1)
    vertex, far = handles
    design = SymmetricDesign(vertices, edges, handles=[vertex, far])
    design.move(handles)
    runs = len(design.runs)
    farther = pulled(vertices, edges, 0.12)
    design.move({vertex: farther[vertex]})
    assert sum(run.iterations for run in design.runs[runs:]) <= 25
    measures = design.measures()
    assert max(measures["largest_cospherical"], measures["largest_coplanar"]) < 1e-9
    assert measures["largest_handle_distance"] < 0.01
    runs = len(design.runs)
    design.move({vertex: pulled(vertices, edges, 0.13)[vertex]}, rounds=1)
    assert len(design.runs) - runs <= 4
    with pytest.raises(MeshError, match="no vertex"):
        design.move({len(vertices): [0.0, 0.0, 0.0]})
    for place in ([math.nan, 0.0, 0.0], [1.0]):
        with pytest.raises(ShapeError, match="finite"):
            design.move({vertex: place})


def test_singular_vertices_are_left_out() -> None:
    from principal_lattices import cone

    from torchfair.principal import principal_edges_from_seed

    topology = cone(9, 4)
    edges = principal_edges_from_seed(topology, 0)
    angles = torch.arange(topology.num_vertices, dtype=DOUBLE)
    places = torch.zeros(topology.num_vertices, 3, dtype=DOUBLE)
    number = 1
    for ring in range(1, 5):
        turn = 2.0 * math.pi * torch.arange(9 * ring, dtype=DOUBLE) / (9 * ring)
        places[number : number + 9 * ring, 0] = ring * torch.cos(turn)
        places[number : number + 9 * ring, 1] = ring * torch.sin(turn)
        places[number : number + 9 * ring, 2] = 0.05 * ring**2 * torch.cos(3 * turn)
        number += 9 * ring
    assert number == len(angles)
    result = principal_symmetric(places, edges)
    assert not bool(torch.isin(edges.stars().vertices, edges.singular).any())
    assert largest(result.vertices, edges) < 1e-8


def test_refusals() -> None:
    vertices, edges = start("torus")
    with pytest.raises(ShapeError):
        principal_symmetric(vertices[None], edges)
    with pytest.raises(MeshError, match="no vertex"):
        principal_symmetric(vertices, edges, handles={9999: [0.0, 0.0, 0.0]})
    mask = torch.zeros(len(vertices), dtype=torch.bool)
    mask[3] = True
    with pytest.raises(MeshError, match="fixed"):
        principal_symmetric(vertices, edges, handles={3: [0.0, 0.0, 0.0]}, fixed=mask)
    with pytest.raises(MeshError, match="bool"):
        principal_symmetric(vertices, edges, fixed=torch.zeros(3, dtype=torch.bool))
    with pytest.raises(MeshError, match="finite"):
        principal_symmetric(vertices * math.nan, edges)
    corners, topology = tetrahedron()
    nothing = PrincipalEdges(topology, torch.zeros(topology.num_edges, dtype=torch.bool))
    with pytest.raises(MeshError, match="no condition"):
        principal_symmetric(corners, nothing)
    for wrong in ({"boundary": "glide"}, {"formulation": "other"}, {"fairness_weight": -1.0}, {"most_steps": 0}):
        with pytest.raises(ValueError, match=next(iter(wrong))):
            SymmetricSettings(**wrong)  # type: ignore[arg-type]
