"""The job that lowers E: what it guarantees, on small meshes of every kind."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from helpers import DOUBLE, grid_faces, random_rotation, split_quads
from torch import Tensor

from torchfair import MeshError, ShapeError, Topology
from torchfair.boundary import boundary_corners, boundary_pieces
from torchfair.energies import normal_variation
from torchfair.formfinding import FairSettings, JobResult, Level, minimise_normal_variation
from torchfair.geometry import corner_angles, edge_lengths, face_areas, face_normals
from torchfair.geometry.closest_point import ReferenceSurface
from torchfair.geometry.planarity import planarity
from torchfair.geometry.spline_curves import SplineCurves
from torchfair.projection import IterationRecord, Status


def saddle(kind: str, n: int = 9) -> tuple[Tensor, Topology]:
    """A saddle z = xy/4 over a jittered grid, edges along asymptotic directions: the worst case for E."""
    side = np.linspace(-2, 2, n)
    x, y = (a.ravel() for a in np.meshgrid(side, side, indexing="ij"))
    inside = (abs(x) < 1.99) & (abs(y) < 1.99)
    shift = np.random.default_rng(4).uniform(-0.08, 0.08, (2, x.size)) * inside
    x, y = x + shift[0], y + shift[1]
    vertices = torch.from_numpy(np.stack([x, y, 0.25 * x * y], axis=1))
    quads = grid_faces(n, n)
    faces = {
        "triangles": split_quads(quads).tolist(),
        "quads": quads.tolist(),
        "hybrid": quads[::2].tolist() + split_quads(quads[1::2]).tolist(),
    }[kind]
    return vertices, Topology.from_faces(faces)


def bumpy_torus() -> tuple[Tensor, Topology]:
    """Closed, without boundary."""
    m, n = 16, 10
    u, v = np.meshgrid(2 * np.pi * np.arange(m) / m, 2 * np.pi * np.arange(n) / n, indexing="ij")
    u, v = u + 0.3 * np.sin(2 * v), v + 0.2 * np.sin(u)
    ring = 3 + np.cos(v)
    points = np.stack([ring * np.cos(u), ring * np.sin(u), np.sin(v)], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(m), np.arange(n), indexing="ij")
    corner = [(i + a) % m * n + (j + b) % n for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))]
    quads = np.stack([c.ravel() for c in corner], axis=1)
    return torch.from_numpy(points), Topology.from_faces(split_quads(quads))


MESHES = {
    "triangles": lambda: saddle("triangles"),
    "quads": lambda: saddle("quads"),
    "hybrid": lambda: saddle("hybrid"),
    "closed": bumpy_torus,
}
QUICK = FairSettings()


def distance_from_rim(
    before: Tensor, topology: Topology, after: Tensor, settings: FairSettings
) -> tuple[Tensor, Tensor]:
    """Boundary vertices (n,), and their distances (n,) from the smooth curves through the boundary of the start."""
    pieces = boundary_pieces(topology, boundary_corners(before, topology, settings.corner_angle))
    if not pieces:
        return torch.zeros(0, dtype=torch.int64), before.new_zeros(0)
    curves = SplineCurves([before[piece.vertices] for piece in pieces], [piece.closed for piece in pieces])
    rim = torch.cat([piece.vertices for piece in pieces])
    owners = torch.cat([torch.full_like(piece.vertices, i) for i, piece in enumerate(pieces)])
    return rim, curves.closest(after[rim], owners).distances


def check_guarantees(
    before: Tensor, topology: Topology, result: JobResult[Level], settings: FairSettings = QUICK
) -> None:
    """Measured from outside, with none of the solver's own figures."""
    after = result.vertices
    assert torch.isfinite(after).all()
    assert float(normal_variation(after, topology)) < float(normal_variation(before, topology))
    for run in (*result.preparation, result.projection):
        merits = [record.merit for record in run.history]
        assert merits == sorted(merits, reverse=True)
    mean = float(edge_lengths(before, topology).mean())
    distance = ReferenceSurface(before, topology).closest(after).distances
    rim, from_curve = distance_from_rim(before, topology, after, settings)
    if settings.boundary == "glide" and rim.numel():
        distance[rim] = torch.minimum(distance[rim], from_curve)
        assert float(from_curve.max()) < 1e-3 * mean
        assert result.after["largest_boundary_distance"] == pytest.approx(float(from_curve.max()), abs=1e-12)
    assert float(distance.max()) <= settings.distance_limit * mean * (1 + 1e-9)
    assert result.after["largest_distance"] == pytest.approx(float(distance.max()))
    smallest = min(math.radians(10), float(corner_angles(before, topology).min()))
    assert float(corner_angles(after, topology).min()) >= smallest * (1 - 1e-6)
    assert float((face_areas(after, topology) / face_areas(before, topology)).min()) >= 0.2
    assert float((face_normals(after, topology) * face_normals(before, topology)).sum(1).min()) > 0.0


@pytest.mark.parametrize("name", MESHES)
def test_energy_falls_and_every_guarantee_holds(name: str) -> None:
    vertices, topology = MESHES[name]()
    settings = FairSettings(crease_angle=0.0)  # the torus is so coarse that its edges are sharp
    result = minimise_normal_variation(vertices, topology, settings=settings)
    check_guarantees(vertices, topology, result)
    assert result.after["normal_variation"] < 0.97 * result.before["normal_variation"]
    assert result.projection.history[-1].quantities["normal_variation"] == pytest.approx(
        result.after["normal_variation"]
    )


def test_mesh_that_is_optimal_already_does_not_get_worse() -> None:
    """A principal quad mesh of a cylinder: fairness alone would move it, and E would rise."""
    u, z = torch.meshgrid(
        torch.linspace(0, 2, 9, dtype=DOUBLE), torch.linspace(0, 1, 5, dtype=DOUBLE) ** 2, indexing="ij"
    )
    vertices = torch.stack([u.cos(), u.sin(), z], dim=-1).reshape(-1, 3)
    topology = Topology.from_faces(grid_faces(9, 5))
    result = minimise_normal_variation(vertices, topology)
    assert result.after["normal_variation"] <= result.before["normal_variation"] * (1 + 1e-12)


@pytest.mark.parametrize("boundary", ["glide", "fixed", "free"])
def test_boundary_conditions(boundary: str) -> None:
    vertices, topology = saddle("triangles")
    settings = FairSettings(boundary=boundary)
    result = minimise_normal_variation(vertices, topology, settings=settings)
    check_guarantees(vertices, topology, result, settings)
    on = topology.is_boundary_vertex
    moved = torch.linalg.vector_norm(result.vertices - vertices, dim=1)
    corners = torch.tensor([0, 8, 72, 80])
    if boundary == "fixed":
        assert float(moved[on].max()) == 0.0
    else:
        assert float(moved[on].max()) > 1e-3
    if boundary == "glide":
        assert float(moved[corners].max()) == 0.0
        edge = result.vertices[on]
        side = torch.minimum((edge[:, 0].abs() - 2).abs(), (edge[:, 1].abs() - 2).abs())
        assert float(side.max()) < 1e-2


def test_corner_angle_decides_what_a_corner_is() -> None:
    vertices, topology = saddle("triangles")
    none = minimise_normal_variation(vertices, topology, settings=FairSettings(corner_angle=math.pi))
    assert float(torch.linalg.vector_norm(none.vertices - vertices, dim=1)[[0, 8, 72, 80]].max()) > 0.0


def test_result_does_not_depend_on_the_unit_or_the_place() -> None:
    vertices, topology = saddle("triangles")
    settings = FairSettings(projection=replace(FairSettings().projection, max_iterations=5))
    metres = minimise_normal_variation(vertices, topology, settings=settings)
    moved = 1000.0 * vertices @ random_rotation().T + torch.tensor([3e4, 1e4, -2e4], dtype=DOUBLE)
    millimetres = minimise_normal_variation(moved, topology, settings=settings)
    assert millimetres.after["normal_variation"] == pytest.approx(1000 * metres.after["normal_variation"], rel=1e-4)


@pytest.mark.parametrize("formulation", ["reduced", "lifted"])
def test_both_formulations_lower_the_energy(formulation: str) -> None:
    vertices, topology = saddle("triangles")
    settings = FairSettings(formulation=formulation)
    result = minimise_normal_variation(vertices, topology, settings=settings)
    check_guarantees(vertices, topology, result)
    if formulation == "lifted":
        blocks = result.projection.blocks
        sizes = 3 * topology.num_vertices + 3 * topology.num_faces + 4 * topology.num_interior_edges
        assert sum(block.numel() for block in blocks.values()) == sizes


def test_planar_quads_stay_planar() -> None:
    """A translational surface has planar faces; perturbing along it keeps them parallelograms."""
    n = 8
    x = torch.linspace(-2, 2, n, dtype=DOUBLE) + 0.1 * torch.sin(7 * torch.arange(n, dtype=DOUBLE))
    u, v = torch.meshgrid(x, x, indexing="ij")
    vertices = torch.stack([u, v + 0.3 * u, 0.2 * u**2 - 0.2 * v**2], dim=-1).reshape(-1, 3)
    topology = Topology.from_faces(grid_faces(n, n))
    assert float(planarity(vertices, topology).max()) < 1e-12
    result = minimise_normal_variation(vertices, topology)
    check_guarantees(vertices, topology, result)
    assert float(planarity(result.vertices, topology).max()) < 1e-4
    assert any("kept planar" in note for note in result.notes)


def test_quads_can_be_made_planar() -> None:
    vertices, topology = saddle("quads")
    vertices[:, 2] = 0.15 * (vertices[:, 0] ** 2 - vertices[:, 1] ** 2)  # edges near principal directions
    assert float(planarity(vertices, topology).max()) > 1e-2
    settings = FairSettings(planar="quads")
    result = minimise_normal_variation(vertices, topology, settings=settings)
    assert result.preparation
    assert float(planarity(result.vertices, topology).max()) < 1e-4
    assert result.after["largest_planarity"] == pytest.approx(float(planarity(result.vertices, topology).max()))


def test_chosen_faces_only() -> None:
    vertices, topology = saddle("quads")
    result = minimise_normal_variation(vertices, topology, settings=FairSettings(planar=(27, 28)))
    warp = planarity(result.vertices, topology)
    assert float(warp[[27, 28]].max()) < 1e-4 < float(warp.max())


def test_handles_are_met_and_switch_closeness_off_when_they_leave_the_surface() -> None:
    vertices, topology = saddle("triangles")
    target = (vertices[40] + torch.tensor([0, 0, 1.0], dtype=DOUBLE)).tolist()
    result = minimise_normal_variation(vertices, topology, handles={40: target})
    assert any("design mode" in note for note in result.notes)
    assert result.after["largest_handle_distance"] < 0.01
    assert (result.vertices[40] - torch.tensor(target, dtype=DOUBLE)).abs().max() < 0.01
    assert result.after["smallest_area_ratio"] >= 0.2
    assert len(result.preparation) >= 2


def test_handle_on_the_surface_keeps_the_reference() -> None:
    vertices, topology = saddle("triangles")
    target = vertices[40] + 0.2 * (vertices[41] - vertices[40])
    result = minimise_normal_variation(vertices, topology, handles={40: target.tolist()})
    assert not any("design mode" in note for note in result.notes)
    check_guarantees(vertices, topology, result)
    assert result.after["largest_handle_distance"] < 0.02


def test_reference_surface_other_than_the_input() -> None:
    """Noise normal to the surface is pulled back to the clean surface."""
    clean, topology = saddle("triangles")
    noise = 0.05 * torch.randn(clean.shape[0], dtype=DOUBLE, generator=torch.Generator().manual_seed(0))
    noisy = clean.clone()
    noisy[:, 2] += noise * ~topology.is_boundary_vertex
    result = minimise_normal_variation(noisy, topology, reference=(clean, topology))
    reference = ReferenceSurface(clean, topology)
    assert float(reference.closest(result.vertices).distances.max()) < 0.5 * float(
        reference.closest(noisy).distances.max()
    )
    assert result.after["normal_variation"] < float(normal_variation(clean, topology))
    assert any("start farther" in note for note in result.notes)


def test_isolated_vertices_stay() -> None:
    vertices, topology = saddle("triangles")
    more = torch.cat([vertices, torch.full((1, 3), 50.0, dtype=DOUBLE)])
    result = minimise_normal_variation(more, Topology.from_faces(topology.triangles, num_vertices=82))
    assert torch.equal(result.vertices[81], more[81])
    assert result.after["largest_distance_relative"] <= 0.05
    alone = minimise_normal_variation(vertices, topology)
    assert result.projection.merit == pytest.approx(alone.projection.merit, rel=1e-9)  # or it seems to fall too little


def test_dtype_is_kept_and_input_untouched() -> None:
    vertices, topology = saddle("triangles")
    single = vertices.float()
    copy = single.clone()
    result = minimise_normal_variation(single, topology)
    assert result.vertices.dtype == torch.float32
    assert result.projection.blocks["vertices"].dtype == DOUBLE  # what is computed with
    assert torch.equal(single, copy)


def test_interruption_keeps_the_best_mesh() -> None:
    vertices, topology = saddle("triangles")

    def interrupt(record: IterationRecord) -> None:
        if record.iteration == 4:
            raise KeyboardInterrupt

    result = minimise_normal_variation(vertices, topology, callback=interrupt)
    assert result.projection.status is Status.INTERRUPTED
    check_guarantees(vertices, topology, result)


def test_bad_input_is_refused() -> None:
    vertices, topology = saddle("triangles")
    with pytest.raises(ShapeError, match="one mesh"):
        minimise_normal_variation(vertices.expand(2, -1, -1), topology)
    bad = vertices.clone()
    bad[7, 0] = float("nan")
    with pytest.raises(MeshError, match=r"not finite, first \[7\]"):
        minimise_normal_variation(bad, topology)
    with pytest.raises(MeshError, match="no extent"):
        minimise_normal_variation(torch.zeros_like(vertices), topology)
    squashed = vertices.clone()
    squashed[topology.triangles[5, 1]] = squashed[topology.triangles[5, 0]]
    with pytest.raises(MeshError, match="have no area"):
        minimise_normal_variation(squashed, topology)
    with pytest.raises(MeshError, match="handle 99 is no vertex"):
        minimise_normal_variation(vertices, topology, handles={99: (0, 0, 0)})
    with pytest.raises(ShapeError, match="three finite coordinates"):
        minimise_normal_variation(vertices, topology, handles={3: (0, 0)})
    with pytest.raises(MeshError, match="face numbers run"):
        minimise_normal_variation(vertices, topology, settings=FairSettings(planar=(999,)))
    with pytest.raises(ValueError, match="boundary must be one of"):
        FairSettings(boundary="loose")
    with pytest.raises(ValueError, match="weights must be at least 0: closeness_weight"):
        FairSettings(closeness_weight=-1.0)
    with pytest.raises(ValueError, match="distance_limit"):
        FairSettings(distance_limit=0.0)


def test_handle_out_of_reach_is_said() -> None:
    """Pulling a corner of the fan through its neighbour would turn faces over; the bounds hold and a note says so."""
    vertices, topology = saddle("triangles", n=5)
    target = vertices[12] + 3.0 * (vertices[13] - vertices[12])
    settings = FairSettings(boundary="fixed", distance_limit=None, planar="none")
    result = minimise_normal_variation(vertices, topology, handles={12: target.tolist()}, settings=settings)
    assert result.after["largest_handle_distance"] > 0.5
    assert not result.holds
    assert any("a handle from its target" in note and "NOT REACHED" in note for note in result.notes)
    assert result.after["flipped_faces"] == 0
