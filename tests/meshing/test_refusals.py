"""What cannot be meshed is refused in one line that names the place, and what it says to do works."""

from __future__ import annotations

import math
import re

import pytest
import torch

from torchfair import MeshError, ShapeError, Topology, repair_mesh
from torchfair.geometry import edge_lengths
from torchfair.meshing import MeshingSettings, NoMeshError, principal_quads, principal_triangles, surface
from torchfair.meshing.failed_attempt import FailedAttemptError
from torchfair.meshing.no_mesh import no_mesh
from torchfair.meshing.surface import components_of
from torchfair.meshing.welded import check_welded
from torchfair.shapes import Torus, irregular_triangles

CUT_OFF = 0.02  # radius of the hole at the tip


def cone(around: int = 40, along: int = 30) -> tuple[torch.Tensor, Topology]:
    """Of radius 1, with a hole at its tip; the rim of the hole has the first vertices."""
    radii = torch.linspace(CUT_OFF, 1, along, dtype=torch.float64)[:, None]
    angles = torch.arange(around, dtype=torch.float64) * (2 * math.pi / around)
    points = torch.stack([radii * angles.cos(), radii * angles.sin(), (-radii).expand(-1, around)], -1).reshape(-1, 3)
    at = torch.arange(along * around).reshape(along, around)
    a, b = at[:-1].reshape(-1), at[1:].reshape(-1)
    c, d = at[1:].roll(-1, 1).reshape(-1), at[:-1].roll(-1, 1).reshape(-1)
    return points, Topology.from_faces(torch.cat([torch.stack([a, b, c], 1), torch.stack([a, c, d], 1)]))


@pytest.mark.parametrize("scale", [1.0, 1000.0])
def test_a_hole_too_small_is_named_and_as_many_faces_as_are_said_go_around_it(scale: float) -> None:
    points, topology = cone()
    with pytest.raises(NoMeshError) as caught:
        principal_triangles(scale * points, topology, count=100, settings=MeshingSettings(fallback=False))
    said = str(caught.value)
    assert "\n" not in said
    assert 0 <= caught.value.vertex < 40
    place = ", ".join(f"{x:.4g}" for x in (scale * points)[caught.value.vertex].tolist())
    assert f"near vertex {caught.value.vertex} at ({place})" in said
    length = scale * 40 * 2 * CUT_OFF * math.sin(math.pi / 40)
    assert f"(hole) there is {length:.3g} long" in said
    assert f"edges of {length / 3:.3g} or less" in said
    times = float(re.findall(r"about ([\d.e+]+) times as many faces", said)[0])
    made = principal_triangles(scale * points, topology, count=round(100 * times))
    assert len(made.principal.topology.boundary_loops()) == 2
    made = principal_triangles(scale * points, topology, spacing=length / 3)
    assert len(made.principal.topology.boundary_loops()) == 2


@pytest.mark.parametrize("dtype", [torch.float64, torch.float32])
def test_a_t_junction_is_no_hole_and_its_remedy_works(dtype: torch.dtype) -> None:
    """A face of a torus is split at the middle of an edge, its neighbour is not."""
    made = irregular_triangles(Torus(), 400)
    faces = made.topology.triangles.tolist()
    a, b, c = faces.pop(60)
    points = torch.cat([made.vertices, made.vertices[[a, b]].mean(0)[None]]).to(dtype)
    topology = Topology.from_faces([*faces, [a, len(points) - 1, c], [len(points) - 1, b, c]], len(points))
    with pytest.raises(NoMeshError, match=r"encloses no area: .*T-junction.*--repair --weld\) closes it$") as caught:
        principal_quads(points, topology, count=100, settings=MeshingSettings(fallback=False))
    assert caught.value.vertex in (a, b, len(points) - 1)
    mended = repair_mesh(points, topology.corners.reshape(-1, 3), weld=True)
    assert not len(principal_quads(mended.vertices, mended.topology, count=100).topology.boundary_loops())


def test_a_small_disk_has_no_hole_that_could_be_closed() -> None:
    """Beside a square a hundred times as large, in which there is room."""
    steps = torch.linspace(0, 1, 11, dtype=torch.float64)
    x, y = (of.reshape(-1) for of in torch.meshgrid(steps, steps, indexing="ij"))
    square = torch.stack([x, y, 0.1 * x * y], 1)
    at = torch.arange(121).reshape(11, 11)
    a, b, c, d = (of.reshape(-1) for of in (at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]))
    faces = torch.cat([torch.stack([a, b, c], 1), torch.stack([a, c, d], 1)])
    u, v = 2 * x - 1, 2 * y - 1
    disk = torch.stack([u * (1 - v**2 / 2).sqrt(), v * (1 - u**2 / 2).sqrt(), 0.1 * u * v], 1)
    points = torch.cat([square, 0.005 * disk + 3])
    with pytest.raises(NoMeshError) as caught:
        principal_quads(points, Topology.from_faces(torch.cat([faces, faces + 121])), count=60)
    said = str(caught.value)
    assert "; the boundary there is 0.03" in said
    assert "close" not in said
    times = float(re.findall(r"about ([\d.e+]+) times as many faces", said)[0])
    made = principal_quads(points, Topology.from_faces(torch.cat([faces, faces + 121])), count=round(60 * times))
    assert len(made.topology.boundary_loops()) == 2


def test_the_first_attempt_that_knows_where_it_failed_is_told() -> None:
    made = irregular_triangles(Torus(), 400)
    (part,) = components_of(made.vertices, made.topology)
    place = part.placed.vertices[7].numpy()
    failures = [
        FailedAttemptError("crosses are odd"),
        FailedAttemptError("triangles are turned over", 31, place),
        FailedAttemptError("no room", 12, part.placed.vertices[3].numpy()),
        FailedAttemptError("too thin"),
    ]
    error = no_mesh(failures, part, 0.5)
    assert error.vertex == 31
    where = ", ".join(f"{x:.4g}" for x in part.vertices[7].tolist())
    assert f"near vertex 31 at ({where}): triangles are turned over (4 setting(s) tried)" in str(error)
    error = no_mesh(failures[::3], part, 0.5)
    assert error.vertex == -1
    assert str(error).startswith("no valid mesh was found: too thin (2 setting(s) tried)")


def test_triangles_that_share_no_vertices_are_refused_and_meshed_once_they_are_welded() -> None:
    """Each was meshed by itself, for minutes."""
    whole = irregular_triangles(Torus(), 400)
    apart = whole.vertices[whole.topology.triangles].reshape(-1, 3)
    topology = Topology.from_faces(torch.arange(len(apart)).reshape(-1, 3))
    with pytest.raises(MeshError, match=f"{topology.num_faces} components, more than the 200") as caught:
        principal_quads(apart, topology, count=200)
    assert "\n" not in str(caught.value)
    first, second, third, fourth = map(int, re.findall(r"\d+", str(caught.value).split("edges ")[2])[:4])
    assert torch.equal(apart[[first, second]], apart[[fourth, third]])
    apart[5] = math.nan
    with pytest.raises(MeshError, match=r"not finite numbers: 5"):
        principal_quads(apart, topology, count=200)
    with pytest.raises(ShapeError):
        principal_quads(apart[1:], topology, count=200)
    apart[5] = whole.vertices[whole.topology.triangles].reshape(-1, 3)[5]
    joined = repair_mesh(apart, topology.triangles, weld=True)
    made = principal_quads(joined.vertices, joined.topology, count=200)
    assert made.report["singular"] == {}
    assert abs(made.report["faces"] / 200 - 1) <= 0.15


def test_as_many_faces_as_there_are_components_may_be_asked_for() -> None:
    whole = irregular_triangles(Torus(), 60)
    apart = whole.vertices[whole.topology.triangles].reshape(-1, 3)
    topology = Topology.from_faces(torch.arange(len(apart)).reshape(-1, 3))
    check_welded(apart, topology, topology.num_faces)
    with pytest.raises(MeshError, match="--weld"):
        check_welded(apart, topology, topology.num_faces - 1)


def test_triangles_are_cut_for_edges_of_half_their_size_until_there_are_too_many(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    whole = irregular_triangles(Torus(), 60)
    (part,) = components_of(whole.vertices, whole.topology)
    length = float(edge_lengths(whole.vertices, whole.topology).mean())
    assert part.is_cut_for(length / 2)
    assert not part.is_cut_for(10 * length)
    monkeypatch.setattr(surface, "_MOST_FACES", 4 * whole.topology.num_faces)
    assert part.is_cut_for(length / 2)
    monkeypatch.setattr(surface, "_MOST_FACES", 4 * whole.topology.num_faces - 1)
    assert not part.is_cut_for(length / 2)


def test_more_components_than_faces_are_meshed_where_nothing_coincides() -> None:
    """Two squares far from each other, one face asked for."""
    square = torch.tensor([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=torch.float64)
    vertices = torch.cat([square, square + 3])
    topology = Topology.from_faces([[0, 1, 2, 3], [4, 5, 6, 7]])
    assert principal_quads(vertices, topology, count=1).report["faces"] >= 2
