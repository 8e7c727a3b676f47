"""Boundaries glide on smooth curves through their own vertices: exactly, from the start on, up to corners."""

from __future__ import annotations

import math

import pytest
import torch
from helpers import DOUBLE, grid_faces, split_quads, tetrahedron
from torch import Tensor

from torchfair import Topology
from torchfair.boundary import boundary_corners, boundary_pieces
from torchfair.energies import normal_variation
from torchfair.formfinding import FairSettings, minimise_normal_variation
from torchfair.formfinding.fair.problem import FairProblem
from torchfair.formfinding.job import Pulls
from torchfair.geometry import SplineCurves, edge_lengths, face_areas, face_normals
from torchfair.geometry.closest_point import ReferenceSurface

CORNER = math.radians(40.0)
SMOOTH: dict[str, object] = {"crease_angle": 0.0}  # coarse as it is, the dome has no creases


def dome(around: int = 12, rings: int = 4) -> tuple[Tensor, Topology]:
    """A spherical cap with sheared rows; its rim is a circle whose polyline turns by 30 degrees at every vertex."""
    places, faces = [torch.tensor([[0.0, 0.0, 1.0]], dtype=DOUBLE)], []
    for ring in range(1, rings + 1):
        polar = 0.8 * ring / rings
        turn = 2.0 * math.pi * (torch.arange(around, dtype=DOUBLE) + 0.45 * ring + 0.1 * ring**2) / around
        height = torch.full_like(turn, math.cos(polar))
        places.append(torch.stack([math.sin(polar) * turn.cos(), math.sin(polar) * turn.sin(), height], 1))
        first = 1 + (ring - 1) * around
        for i in range(around):
            j = (i + 1) % around
            if ring == 1:
                faces.append([0, first + i, first + j])
            else:
                inner = first - around
                faces += [[inner + i, first + i, first + j], [inner + i, first + j, inner + j]]
    return torch.cat(places), Topology.from_faces(faces)


def rim_distances(before: Tensor, topology: Topology, after: Tensor, corner_angle: float = CORNER) -> Tensor:
    """Of the boundary vertices of ``after`` from the smooth curves through those of ``before``."""
    pieces = boundary_pieces(topology, boundary_corners(before, topology, corner_angle))
    curves = SplineCurves([before[piece.vertices] for piece in pieces], [piece.closed for piece in pieces])
    owners = torch.cat([torch.full_like(piece.vertices, number) for number, piece in enumerate(pieces)])
    return curves.closest(after[torch.cat([piece.vertices for piece in pieces])], owners).distances


def problem(vertices: Tensor, topology: Topology, **settings: object) -> FairProblem:
    return FairProblem(vertices, topology, None, Pulls(vertices), FairSettings(**{**SMOOTH, **settings}))


@pytest.mark.slow
def test_the_rim_of_a_coarse_dome_glides_on_its_circle() -> None:
    vertices, topology = dome()
    result = minimise_normal_variation(vertices, topology, settings=FairSettings(crease_angle=0.0))
    mean = float(edge_lengths(vertices, topology).mean())
    rim = topology.is_boundary_vertex
    assert float((result.vertices - vertices)[rim].norm(dim=1).min()) > 0.1 * mean
    assert float(rim_distances(vertices, topology, result.vertices).max()) < 1e-12
    assert float((result.vertices[rim, :2].norm(dim=1) - math.sin(0.8)).abs().max()) < 1e-3 * mean
    assert float((result.vertices[rim, 2] - math.cos(0.8)).abs().max()) < 1e-12
    assert result.after["largest_boundary_distance"] < 1e-12
    held = minimise_normal_variation(vertices, topology, settings=FairSettings(boundary="fixed", crease_angle=0.0))
    assert result.after["normal_variation"] < 0.995 * held.after["normal_variation"]


def test_the_distance_limit_of_the_rim_is_from_its_curve() -> None:
    """A rim that turns by 30 degrees bulges over its chords by more than the limit: that is no distance."""
    vertices, topology = dome(around=12, rings=2)
    mean = float(edge_lengths(vertices, topology).mean())
    settings = FairSettings(distance_limit=0.02)
    result = minimise_normal_variation(vertices, topology, settings=settings)
    from_surface = ReferenceSurface(vertices, topology).closest(result.vertices).distances
    rim = topology.is_boundary_vertex
    assert float(from_surface[rim].max()) > 0.02 * mean
    assert float(from_surface[~rim].max()) <= 0.02 * mean
    assert result.after["largest_distance"] == pytest.approx(float(from_surface[~rim].max()))


def test_the_distance_of_a_gliding_vertex_is_that_from_the_nearer_of_curve_and_surface() -> None:
    vertices, topology = dome()
    fair, rim = problem(vertices, topology), topology.is_boundary_vertex
    lifted = vertices + torch.tensor([0.0, 0.0, 0.01], dtype=DOUBLE)
    surface = fair.near.surface.closest(lifted).distances
    curve = rim_distances(vertices, topology, lifted)
    loop = topology.boundary_loops()[0]
    distances = fair.near.distances(lifted)
    torch.testing.assert_close(distances[~rim], surface[~rim], rtol=0, atol=1e-15)
    torch.testing.assert_close(distances[loop], torch.minimum(surface[loop], curve), rtol=0, atol=1e-15)
    assert bool((surface[loop] < curve).any())
    outside = vertices * torch.tensor([1.2, 1.2, 1.0], dtype=DOUBLE)
    torch.testing.assert_close(
        fair.near.distances(outside)[loop], rim_distances(vertices, topology, outside), rtol=0, atol=1e-15
    )


def test_closeness_leaves_the_rim_to_its_curve() -> None:
    """Gliding vertices and corners, not handles; where the boundary is free, closeness is all there is."""
    vertices, topology = dome()
    rim = topology.is_boundary_vertex

    def drawn(fair: FairProblem) -> Tensor:
        (term,) = (term for term in fair.terms(1.0) if term.name == "closeness")
        return term.stencil[0][1][:, 0]

    assert drawn(problem(vertices, topology)).tolist() == torch.nonzero(~rim).squeeze(1).tolist()
    for boundary in ("free", "fixed"):
        assert len(drawn(problem(vertices, topology, boundary=boundary))) == len(vertices)
    with_corners = problem(vertices, topology, corner_angle=math.radians(20.0))
    assert bool(with_corners.stays()[rim].all())
    assert not torch.isin(drawn(with_corners), torch.nonzero(rim).squeeze(1)).any()
    handle = int(torch.nonzero(rim)[3])
    pulls = Pulls(vertices)
    pulls.pull(torch.tensor([handle]), vertices[[handle]])
    pulled = FairProblem(vertices, topology, None, pulls, FairSettings(crease_angle=0.0))
    assert handle in drawn(pulled).tolist()
    (glide,) = (term for term in pulled.terms(1.0) if term.name == "boundary gliding")
    assert glide.element_weights is not None
    assert float(glide.element_weights.sum()) == int(rim.sum()) - 1


def test_the_mesh_of_a_state_has_gliding_vertices_on_their_curves() -> None:
    vertices, topology = dome()
    fair, rim = problem(vertices, topology), topology.is_boundary_vertex
    assert torch.equal(fair.placed({"vertices": vertices}), vertices)
    beside = vertices * torch.tensor([1.01, 1.01, 1.0], dtype=DOUBLE)
    placed = fair.placed({"vertices": beside})
    assert torch.equal(placed[~rim], beside[~rim])
    assert float(rim_distances(vertices, topology, placed).max()) < 1e-14
    assert float(rim_distances(vertices, topology, beside).min()) > 1e-3
    state = {"vertices": beside}
    assert problem(vertices, topology, boundary="free").placed(state) is beside


def test_steps_are_judged_by_the_mesh_with_its_rim_in_place() -> None:
    """Rim vertices that are drawn inwards turn faces over, until they are put back; bounds hold there too."""
    vertices, topology = dome()
    settings = FairSettings(crease_angle=0.0)
    fair = FairProblem(vertices, topology, (vertices, topology), Pulls(vertices), settings)  # so E is not judged
    start, rim = {"vertices": vertices}, topology.is_boundary_vertex[:, None]
    inwards = torch.where(rim, vertices * torch.tensor([0.4, 0.4, 1.0], dtype=DOUBLE), vertices)
    turned = (face_normals(inwards, topology) * face_normals(vertices, topology)).sum(1)
    assert float(turned.min()) < 0.0
    assert fair.admits(start, {"vertices": inwards})
    loop = topology.boundary_loops()[0]
    slid = vertices.clone()
    slid[loop[0]] = vertices[loop[0]].lerp(vertices[loop[1]], 0.95)
    assert float((face_areas(slid, topology) / face_areas(vertices, topology)).min()) < 0.2
    assert not fair.admits(start, {"vertices": slid})


def test_energy_is_that_of_the_mesh_with_its_rim_in_place() -> None:
    vertices, topology = dome()
    result = minimise_normal_variation(vertices, topology, settings=FairSettings(crease_angle=0.0))
    energy = float(normal_variation(result.vertices, topology))
    assert result.after["normal_variation"] == energy
    assert result.projection.history[-1].quantities["normal_variation"] == pytest.approx(energy, rel=1e-9)
    assert float(normal_variation(result.projection.blocks["vertices"], topology)) != pytest.approx(energy, rel=1e-6)


def test_planar_faces_come_before_the_curve() -> None:
    """Quads of a translation surface stay planar as promised; their rim is near its curves all the same."""
    x = torch.linspace(-2, 2, 8, dtype=DOUBLE) + 0.1 * torch.sin(7 * torch.arange(8, dtype=DOUBLE))
    u, v = torch.meshgrid(x, x, indexing="ij")
    vertices = torch.stack([u, v + 0.3 * u, 0.2 * u**2 - 0.2 * v**2], dim=-1).reshape(-1, 3)
    topology = Topology.from_faces(grid_faces(8, 8))
    result = minimise_normal_variation(vertices, topology)
    assert result.after["largest_planarity"] < 1e-4
    assert 1e-9 < result.after["largest_boundary_distance"] < 1e-3 * result.after["mean_edge_length"]


def sheet(n: int = 6) -> tuple[Tensor, Topology]:
    """A bent square sheet with four corners and a wavy side."""
    x, y = torch.meshgrid(*(torch.arange(n, dtype=DOUBLE),) * 2, indexing="ij")
    vertices = torch.stack([x, y + 0.02 * x * (n - 1 - x), 0.1 * x**2 - 0.05 * y**2], -1).reshape(-1, 3)
    return vertices, Topology.from_faces(split_quads(grid_faces(n, n)))


def test_corners_stay_and_sides_end_there() -> None:
    """On the curves exactly, where no panel is to stay flat: its triangles are halves of planar quads."""
    vertices, topology = sheet()
    result = minimise_normal_variation(vertices, topology, settings=FairSettings(flat="none"))
    corners = torch.tensor([0, 5, 30, 35])
    assert torch.equal(result.vertices[corners], vertices[corners])
    assert float(rim_distances(vertices, topology, result.vertices).max()) < 1e-12
    sides = topology.is_boundary_vertex.clone()
    sides[corners] = False
    assert float((result.vertices - vertices)[sides].norm(dim=1).max()) > 1e-3


@pytest.mark.parametrize("corner_angle", [CORNER, math.pi])
def test_loops_of_three_vertices(corner_angle: float) -> None:
    """A tetrahedron without its base: three straight sides between corners, or one round loop."""
    vertices, closed = tetrahedron()
    topology = Topology.from_faces(closed.triangles[1:])
    settings = FairSettings(corner_angle=corner_angle, distance_limit=None)
    result = minimise_normal_variation(vertices, topology, settings=settings)
    assert float(rim_distances(vertices, topology, result.vertices, corner_angle).max()) < 1e-12
    if corner_angle == CORNER:
        assert torch.equal(result.vertices[:3], vertices[:3])


def test_a_rim_with_one_corner() -> None:
    """The only curve starts and ends at the corner, where it need not be smooth."""
    vertices, topology = dome(around=16)
    corner = topology.boundary_loops()[0][0]
    vertices[corner, :2] *= 1.25
    settings = FairSettings(corner_angle=math.radians(60.0))
    corners = boundary_corners(vertices, topology, settings.corner_angle)
    assert torch.nonzero(corners).tolist() == [[int(corner)]]
    result = minimise_normal_variation(vertices, topology, settings=settings)
    assert torch.equal(result.vertices[corner], vertices[corner])
    assert float(rim_distances(vertices, topology, result.vertices, settings.corner_angle).max()) < 1e-12
