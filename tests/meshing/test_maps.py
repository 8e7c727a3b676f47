"""Cuts, seamless maps, and the cells between their lines."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from helpers import DOUBLE
from meshing_tools import Flat, MonkeySaddle, cut, ellipsoid, irregular, nearest, problem_of, punched

from torchfair import Topology
from torchfair.boundary import boundary_corners
from torchfair.fields import FaceFrames
from torchfair.meshing.boundary_runs import find_runs
from torchfair.meshing.chords import find_chords, find_lattice_points
from torchfair.meshing.crease_runs import CreaseLines
from torchfair.meshing.creases import find_creases
from torchfair.meshing.crossings import find_crossings
from torchfair.meshing.off_lines import off_the_lines
from torchfair.meshing.seamless_map import SeamlessMap
from torchfair.meshing.seams import ROTATIONS, find_seams
from torchfair.meshing.tracing import Cells, trace_cells
from torchfair.meshing.untangling import is_hopeless, untangled
from torchfair.shapes import Cylinder, PrincipalParaboloid, Torus, icosphere

SADDLE = PrincipalParaboloid(1.0, -0.5, (0.8, 0.8))


def uncreased(frames: FaceFrames) -> CreaseLines:
    none = find_creases(frames, np.zeros(len(frames.faces), bool), 0.7, 0.0)
    return CreaseLines(none, [], np.zeros(len(frames.points), bool))


def cells_of(found: SeamlessMap, runs: list) -> Cells:
    frames = found.frames
    corners = boundary_corners(torch.from_numpy(frames.points), frames.topology, 0.7).numpy()
    return trace_cells(found, off_the_lines(found, runs), corners, uncreased(frames))


def euler_number(topology: Topology) -> int:
    return topology.num_vertices - topology.num_edges + topology.num_faces


SHAPES = {
    "torus": irregular(Torus()),
    "saddle": irregular(SADDLE),
    "monkey": irregular(MonkeySaddle()),
    "ellipsoid": ellipsoid(3),
    "holes": punched(*irregular(SADDLE), *nearest(irregular(SADDLE)[0], (0.4, 0.3), (-0.4, -0.2))),
    "sphere with holes": punched(icosphere(3).vertices, icosphere(3).topology, 0, 20, 40),
}


@pytest.mark.parametrize("name", SHAPES)
def test_cut_open_a_surface_is_a_disk(name: str) -> None:
    frames, graph = cut(*SHAPES[name])
    copies = find_seams(frames, graph).copies
    whole = Topology.from_faces(copies)  # every singular vertex and every hole is reached
    assert euler_number(whole) == 1
    assert len(whole.boundary_loops()) == 1
    on_rim = np.zeros(len(frames.points), bool)
    on_rim[frames.triangles.ravel()[np.isin(copies.ravel(), whole.loop_vertices.numpy())]] = True
    assert on_rim[graph.nodes].all()
    assert on_rim[frames.is_boundary].all()
    assert not graph.quarters[~graph.cut].any()


@pytest.mark.parametrize("name", SHAPES)
def test_cuts_end_at_singular_vertices_and_boundaries_alone(name: str) -> None:
    frames, graph = cut(*SHAPES[name])
    ends = np.bincount(frames.edges[graph.cut].ravel(), minlength=len(frames.points)) == 1
    assert (graph.nodes | frames.is_boundary)[ends].all()
    assert graph.cut.any() == bool(graph.nodes.any() or len(frames.topology.boundary_loops()) > 1 or name == "torus")


@pytest.mark.parametrize("name", SHAPES)
def test_maps_fit_together_over_the_cuts(name: str) -> None:
    frames, graph = cut(*SHAPES[name])
    problem, _ = problem_of(frames, graph, 0.2)
    found = problem.candidates()[0]
    copies, (f, g), (i, j) = found.seams.copies, frames.faces.T, frames.corners.T
    turn = np.array(ROTATIONS)[graph.quarters]
    for left, right in ((i, (j + 1) % 3), ((i + 1) % 3, j)):
        off = found.values[copies[g, right]] - turn * found.values[copies[f, left]] - found.translations
        assert np.abs(off[graph.cut]).max(initial=0) < 1e-8
    assert (found.translations == np.rint(found.translations.real) + 1j * np.rint(found.translations.imag)).all()
    at_singular = found.values[graph.nodes[found.seams.vertex]]
    assert (at_singular == np.rint(at_singular.real) + 1j * np.rint(at_singular.imag)).all()


def test_a_flat_square_is_mapped_by_a_motion() -> None:
    frames, graph = cut(*irregular(Flat(), 300))
    problem, _ = problem_of(frames, graph, 0.1)
    found = problem.candidates()[0]
    assert np.allclose(found.areas, 1)
    assert found.is_sound
    lengths = np.abs(found.values[found.seams.copies] - np.roll(found.values[found.seams.copies], -1, 1))
    corners = frames.points[frames.triangles]
    assert np.allclose(0.1 * lengths, np.linalg.norm(corners - np.roll(corners, -1, 1), axis=-1))


@pytest.mark.parametrize("align", [False, True])
@pytest.mark.parametrize("name", ["torus", "saddle", "monkey", "ellipsoid", "holes"])
def test_cells_have_the_topology_of_the_surface(name: str, align: bool) -> None:
    vertices, topology = SHAPES[name]
    frames, graph = cut(vertices, topology)
    problem, runs = problem_of(frames, graph, 0.13, align)
    found = untangled(problem, problem.candidates()[0])
    assert found.is_sound
    cells = cells_of(found, runs)
    nodes = {node for face in cells.faces for node in face}
    sides = sum(map(len, cells.faces)) + sum(on.count(2) for on in cells.coordinates)
    assert len(nodes) - sides // 2 + len(cells.faces) == euler_number(topology)
    inner = [face for face in cells.faces if not cells.on_boundary[face].any()]
    assert {len(face) for face in inner} == {4}
    if not graph.quarters.any():  # or coordinates change their names over the cuts
        whole = [on for on in cells.coordinates if 2 not in on]
        assert all(on[0] != on[1] and on[:2] == on[2:] for on in whole if len(on) == 4)


def test_cells_tile_the_plane_by_unit_squares() -> None:
    """On a flat square of side 2 with lines 0.13 apart, whole squares all have that side, and areas sum to 4."""
    frames, graph = cut(*irregular(Flat(), 300))
    cells = cells_of(problem_of(frames, graph, 0.13)[0].candidates()[0], [])
    areas = [_area(cells.positions[face]) for face in cells.faces]
    assert sum(areas) == pytest.approx(4, abs=1e-12)
    whole = [area for area, face in zip(areas, cells.faces, strict=True) if not cells.on_boundary[face].any()]
    assert len(whole) == math.isqrt(len(whole)) ** 2 >= 14**2
    assert np.allclose(whole, 0.13**2)


def test_lines_through_vertices_and_along_edges_are_no_trouble() -> None:
    """A regular grid whose lines pass exactly through vertices and along edges of the triangles."""
    x, y = np.meshgrid(np.arange(9.0), np.arange(9.0), indexing="ij")
    points = torch.from_numpy(np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], 1)).to(DOUBLE)
    index = np.arange(81).reshape(9, 9)
    a, b, c, d = index[:-1, :-1].ravel(), index[1:, :-1].ravel(), index[1:, 1:].ravel(), index[:-1, 1:].ravel()
    topology = Topology.from_faces(np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]))
    frames, graph = cut(points, topology)
    seams = find_seams(frames, graph)
    copy_points = frames.points[seams.vertex]
    for scale, origin in ((1.0, 0.0), (0.5, 0.0), (1.0, 0.5)):
        values = scale * (copy_points[:, 0] + 1j * copy_points[:, 1]) + origin * (1 + 1j)
        found = SeamlessMap(frames, graph, seams, values, np.ones(len(frames.triangles)))
        cells = cells_of(found, [])
        area = sum(_area(cells.positions[face]) for face in cells.faces)
        assert area == pytest.approx(64, abs=1e-5)
        crossings = find_crossings(found, off_the_lines(found))
        chords = find_chords(found, crossings, uncreased(found.frames).creases.edges)
        count = len(find_lattice_points(chords, len(frames.triangles)).chords)
        side = {(1.0, 0.0): (7, 9), (0.5, 0.0): (3, 5), (1.0, 0.5): (8, 8)}[scale, origin]
        assert side[0] ** 2 <= count <= side[1] ** 2  # points on the boundary fall on either side


def _area(points: np.ndarray) -> float:
    x, y = points[:, :2].T
    return float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2)


def test_boundary_runs_of_a_saddle_are_its_four_sides() -> None:
    frames, graph = cut(*SHAPES["saddle"])
    runs = find_runs(frames, graph, np.radians(12), 0.3)
    assert len(runs) == 4
    assert sorted(run.component for run in runs) == [0, 0, 1, 1]
    assert sum(len(run.corners) for run in runs) == 2 * int(frames.is_boundary.sum())
    assert not find_runs(frames, graph, np.radians(12), 99.0)


def test_a_run_that_crosses_the_cut_stays_one_line() -> None:
    """The rims of a tube: the cut from rim to rim, or the way around, must not make them jump."""
    frames, graph = cut(*irregular(Cylinder()))
    problem, runs = problem_of(frames, graph, 0.25, align=True)
    assert sum(len(run.corners) for run in runs) == 2 * int(frames.is_boundary.sum())
    cells = cells_of(problem.candidates()[0], runs)
    assert {len(face) for face in cells.faces} == {4}
    heights = cells.positions[sorted({node for face in cells.faces for node in face}), 2]
    assert np.unique(np.round(4 * heights)).tolist() == list(range(9))
    assert np.abs(4 * heights - np.round(4 * heights)).max() < 0.01


def test_values_on_runs_are_whole() -> None:
    frames, graph = cut(*SHAPES["saddle"])
    problem, runs = problem_of(frames, graph, 0.13, align=True)
    found = problem.candidates()[0]
    for run in runs:
        at = np.array([found.values[found.seams.copies[corner]] for corner in run.corners])
        constant = at.imag if run.component else at.real
        assert np.ptp(constant) < 1e-9
        assert abs(constant[0] - round(constant[0])) < 1e-9


def test_untangling_turns_triangles_back() -> None:
    frames, graph = cut(*SHAPES["saddle"])
    problem, _ = problem_of(frames, graph, 0.2)
    good = problem.candidates()[0]
    assert untangled(problem, good) is good
    middle = int(np.argmin((frames.points**2).sum(1)))
    values = good.values.copy()
    values[good.seams.vertex == middle] += 1.5
    parts = np.stack([values.real, values.imag], axis=1).ravel()
    bad = problem.map_of(parts)
    assert len(bad.flips)
    mended = untangled(problem, bad)
    assert mended.is_sound
    assert mended.areas.min() > 0.02
    far = np.linalg.norm(frames.points - frames.points[middle], axis=1) > 0.8
    assert (mended.values[far[good.seams.vertex]] == good.values[far[good.seams.vertex]]).all()


def test_branches_are_vertices_covered_twice() -> None:
    frames, graph = cut(*SHAPES["saddle"])
    problem, _ = problem_of(frames, graph, 0.2)
    found = problem.candidates()[0]
    assert not len(found.branches)
    doubled = problem.map_of(np.stack([(found.values**2).real, (found.values**2).imag], axis=1).ravel())
    middle = int(np.argmin(np.abs(found.values)))
    assert len(doubled.branches) >= 1
    assert np.abs(found.values[found.seams.vertex == doubled.branches[0]]).min() < 4 * np.abs(found.values[middle]) + 1


def test_maps_with_much_turned_over_are_hopeless() -> None:
    found = problem_of(*cut(*irregular(SADDLE, 700)), 0.2)[0].candidates()[0]
    assert not is_hopeless(found)
    for count, hopeless in ((40, False), (41, True)):
        areas = found.areas.copy()
        areas[:count] = -1
        assert is_hopeless(replace(found, areas=areas)) is hopeless
