"""Several starts: better minima are found, folds are told, work is not lost."""

from __future__ import annotations

import math

import pytest
import torch
from helpers import wavy_grid
from torch import Tensor

from torchfair import Topology
from torchfair.curves import ClosedCurve
from torchfair.errors import MeshError, SettingsError
from torchfair.formfinding import FormRecipe, FormSettings, Session, minimise_absolute_curvature, start_surface
from torchfair.formfinding.form.other_starts import other_starts
from torchfair.geometry import edge_lengths
from torchfair.projection import Status
from torchfair.shapes import Torus, principal_triangles

DOUBLE = torch.float64
UP = torch.tensor([0.0, 0.0, 1.0], dtype=DOUBLE)


def curve(function: object) -> ClosedCurve:
    return ClosedCurve.from_function(lambda t: torch.stack(function(math.tau * t), 1))  # type: ignore[operator]


def three_waves() -> ClosedCurve:
    return curve(lambda a: [2 * a.cos(), 2 * a.sin(), 0.7 * (3 * a).cos()])


def ring(radius: float, height: float) -> ClosedCurve:
    return curve(lambda a: [radius * a.cos(), radius * a.sin(), height + 0 * a])


def test_a_symmetric_start_that_rests_too_high_is_left() -> None:
    """On three waves the saddle has C = 13.2; one side of the hull 10.7."""
    rim = three_waves()
    vertices, topology = start_surface([rim], 170)
    one, six = (minimise_absolute_curvature(vertices, topology, curves=[rim], starts=n) for n in (1, 6))
    assert one.after["total_absolute_curvature"] > 12.5
    assert six.after["total_absolute_curvature"] < 10.8
    assert six.holds
    (note,) = (note for note in six.notes if "starts" in note)
    assert note.startswith("C from 6 starts: as given 1")
    assert note.count(",") >= 5
    assert "kept: on the convex hull" in note


def test_the_start_is_kept_where_no_other_is_better() -> None:
    bottom, top = ring(1.0, 0.0), ring(0.5, 1.0)
    vertices, topology = start_surface([bottom, top], 150)
    one, six = (minimise_absolute_curvature(vertices, topology, curves=[bottom, top], starts=n) for n in (1, 6))
    assert six.after["total_absolute_curvature"] <= one.after["total_absolute_curvature"] * (1 + 1e-12)
    assert six.after["total_absolute_curvature"] == pytest.approx(math.tau, rel=0.05)


def test_levels_go_on_with_the_best() -> None:
    rim = three_waves()
    vertices, topology = start_surface([rim], 61)
    result = minimise_absolute_curvature(vertices, topology, curves=[rim], starts=3, levels=1)
    assert [len(level.runs) > 0 for level in result.levels] == [True, True]
    assert sum("starts" in note for note in result.notes) == 1
    assert result.after["total_absolute_curvature"] < 11.0


def test_other_starts_keep_the_boundary_and_repeat_themselves() -> None:
    vertices, topology = start_surface([three_waves()], 91)
    starts = other_starts(vertices, topology, 9)
    assert len(starts) == 9
    rim = topology.is_boundary_vertex
    for start, again in zip(starts, other_starts(vertices, topology, 9), strict=True):
        assert torch.equal(start.vertices, again.vertices)
        torch.testing.assert_close(start.vertices[rim], vertices[rim], atol=1e-12, rtol=0)
        assert not torch.allclose(start.vertices[~rim], vertices[~rim], atol=1e-3)
    names = [start.name for start in starts]
    assert len(set(names)) == 9
    above, below = (next(s.vertices for s in starts if word in s.name) for word in ("above", "below"))
    assert bool((above[~rim, 2] > below[~rim, 2]).all())
    assert [start.name for start in other_starts(vertices, topology, 2)] == names[:2]


def test_a_hull_is_the_convex_hull() -> None:
    """Over a flat circle with one raised arch, the hull is known: linear across the arch, exactly."""
    rim = curve(lambda a: [a.cos(), a.sin(), a.cos().square()])
    vertices, topology = start_surface([rim], 127)
    above = next(start.vertices for start in other_starts(vertices, topology, 9) if "above" in start.name)
    inner = ~topology.is_boundary_vertex & (above[:, :2].norm(dim=1) < 0.8)
    # the upper side of the hull of (x, y, x^2) on the unit circle bends along x only: z = 1 - y^2
    expected = 1.0 - above[:, 1].square()
    assert float((above[:, 2] - expected)[inner].abs().max()) < 0.02


def test_stopping_keeps_the_best_that_is_finished() -> None:
    rim = three_waves()
    vertices, topology = start_surface([rim], 91)
    whole = minimise_absolute_curvature(vertices, topology, curves=[rim], starts=3)
    seen = 0

    def stop(record: object) -> bool:
        nonlocal seen
        seen += 1
        return seen > whole.steps - 3

    result = minimise_absolute_curvature(vertices, topology, curves=[rim], starts=3, callback=stop)
    assert result.stopped
    assert result.projection.status is Status.CALLBACK
    assert result.after["total_absolute_curvature"] < 10.9  # that of the second start, not of the first


@pytest.mark.slow
def test_far_handles_are_dragged_and_end_no_higher_than_a_session() -> None:
    """The whole job alone ends at a C of 4.86 here, a session at 3.05."""
    vertices, topology = start_surface([ring(2.0, 0.0), ring(0.8, 0.3)], 150)
    handle = int((vertices - torch.tensor([1.4, 0.0, 0.15], dtype=DOUBLE)).norm(dim=1).argmin())
    edge = float(edge_lengths(vertices, topology).mean())
    target = vertices[handle] + 2.0 * edge * UP
    result = minimise_absolute_curvature(vertices, topology, handles={handle: target.tolist()})
    assert any("handles dragged" in note for note in result.notes)
    session = Session(FormRecipe(vertices, topology))
    session.solve()
    for move in range(1, 26):
        session.move({handle: vertices[handle].lerp(target, move / 25).tolist()})
        session.step()
    session.settle()
    assert result.after["largest_handle_distance"] < 0.05 * edge
    assert result.after["total_absolute_curvature"] < 1.05 * session.measures()["total_absolute_curvature"]
    assert result.holds


@pytest.mark.slow
def test_far_handles_pull_up_no_flat_fins() -> None:
    """A fin that is folded flat has the smaller C, since its bending cancels within stars; no step folds so far."""
    vertices, topology = start_surface([ring(2.0, 0.0), ring(0.8, 0.3)], 150)
    place = torch.tensor([1.4, 0.0, 0.15], dtype=DOUBLE)
    handle = int((vertices - place).norm(dim=1).argmin())
    target = vertices[handle] + 3.0 * float(edge_lengths(vertices, topology).mean()) * UP
    result = minimise_absolute_curvature(vertices, topology, handles={handle: target.tolist()})
    assert result.after["largest_dihedral_angle_degrees"] <= 150.0
    assert result.holds


def test_near_handles_and_single_starts_are_as_ever() -> None:
    vertices, topology = wavy_grid(7, 6, triangles=True)
    result = minimise_absolute_curvature(vertices, topology)
    assert not [note for note in result.notes if "starts" in note]


def folded_ell() -> tuple[Tensor, Topology, ClosedCurve]:
    """The disk with every inner vertex in the mean of its neighbours: its faces turn over in the corner of an L."""
    from torchfair.formfinding.form.starting.lattices import hexagonal_disk

    rows = [(0, 0, 0), (8, 0, 0), (8, 3, 0), (3, 3, 0), (3, 8, 0), (0, 8, 0)]
    rim = ClosedCurve(torch.tensor(rows, dtype=DOUBLE))
    return *hexagonal_disk(rim, 330), rim


def test_a_folded_result_says_so() -> None:
    """C of a mesh that is folded flat is 0; E, dihedral angles and faces that run through each other tell."""
    vertices, topology, rim = folded_ell()
    result = minimise_absolute_curvature(vertices, topology, curves=[rim])
    assert result.after["total_absolute_curvature"] < 0.1
    assert not result.holds
    broken = {promise.name.split(",")[0] for promise in result.promises if not promise.holds}
    assert "E" in broken
    assert "largest dihedral angle" in broken
    assert any("its C means nothing" in note for note in result.notes)


def test_closed_meshes_and_other_curves_are_refused() -> None:
    torus = principal_triangles(Torus(), 12, 24)
    with pytest.raises(MeshError, match="closed"):
        minimise_absolute_curvature(torus.vertices, torus.topology)
    vertices, topology = start_surface([ring(1.0, 0.0)], 61)
    for other in (ring(3.0, 0.0), ring(1.0, 2.0), ring(0.4, 0.0)):
        with pytest.raises(MeshError, match="is not the boundary of the mesh"):
            minimise_absolute_curvature(vertices, topology, curves=[other])
    hexagon = start_surface([ring(1.0, 0.0)], 7)  # its vertices are far from each other, and on the curve
    FormRecipe(*hexagon, curves=[ring(1.0, 0.0)])
    near = minimise_absolute_curvature(vertices, topology, curves=[ring(1.05, 0.0)])
    assert near.after["largest_boundary_distance"] < 1e-9
    two = [ring(1.0, 0.0), ring(1.0, 1.0)]
    with pytest.raises(MeshError, match="the same"):
        minimise_absolute_curvature(*start_surface(two, 100), curves=[two[0], two[0]])
    with pytest.raises(SettingsError, match="starts"):
        minimise_absolute_curvature(vertices, topology, starts=0)


def test_the_lifted_formulation_has_one_start() -> None:
    rim = three_waves()
    vertices, topology = start_surface([rim], 37)
    settings = FormSettings(formulation="lifted")
    result = minimise_absolute_curvature(vertices, topology, curves=[rim], starts=4, settings=settings)
    assert not [note for note in result.notes if "starts:" in note]


def test_fixed_vertices_stay_and_the_rest_is_formed_around_them() -> None:
    """A vertex of a flat disk that is lifted and fixed carries a cone of half its angle, with the C of that."""
    vertices, topology = start_surface([ring(1.0, 0.0)], 170)
    top = int(vertices.norm(dim=1).argmin())
    height = 0.4
    lifted = vertices + height * (1.0 - vertices.norm(dim=1, keepdim=True)).clamp_min(0.0) * UP
    lifted[top] = height * UP
    free, held = (minimise_absolute_curvature(lifted, topology, fixed=f) for f in ((), [top]))
    assert torch.equal(held.vertices[top], lifted[top])
    assert "1 vertex is fixed" in held.notes
    assert float(free.vertices[:, 2].abs().max()) < 0.05
    assert free.after["total_absolute_curvature"] < 0.1
    assert held.after["total_absolute_curvature"] > 1.0


def test_fixed_vertices_that_cannot_be_are_refused() -> None:
    vertices, topology = start_surface([three_waves()], 60)
    with pytest.raises(SettingsError, match="starts must be 1"):
        minimise_absolute_curvature(vertices, topology, fixed=[3], starts=2)
    with pytest.raises(MeshError, match="fixed"):
        minimise_absolute_curvature(vertices, topology, fixed=[len(vertices)])
    inner = int(torch.nonzero(~topology.is_boundary_vertex)[0])
    with pytest.raises(MeshError, match="fixed and pulled"):
        minimise_absolute_curvature(vertices, topology, fixed=[inner], handles={inner: (0.0, 0.0, 0.0)})
