"""A design as its users see it: drags, weights, modes, undo, refused requests; computed in truth."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from design_steps import HANDLE, OTHER, THIRD, S, drag, last, pulled
from design_tools import Bench, failures

from torchfair import Topology, load_mesh
from torchfair.design.commands import checked_command, read_command
from torchfair.design.containers import AT_REST, DRAGGING, JUMP
from torchfair.design.engine import requests as r
from torchfair.design.engine.follower import Follower
from torchfair.energies import normal_variation
from torchfair.formfinding import condition_residuals
from torchfair.principal import PrincipalEdges


def topology_of(bench: Bench) -> Topology:
    faces = bench.session.history.now.faces
    return Topology.from_packed_faces(faces.corners, faces.offsets, len(bench.vertices))


def test_what_is_opened_is_told_and_nothing_has_moved(bench: Bench, tube: Path) -> None:
    mesh = load_mesh(tube)
    assert bench.session.state is S.READY
    message, arrays = last(bench, "topology")
    counts = (mesh.topology.num_vertices, mesh.topology.num_faces, mesh.topology.num_edges)
    assert (message["vertices"], message["faces"], message["edges"]) == counts
    assert np.array_equal(arrays["corners"], mesh.topology.corners.numpy())
    assert np.array_equal(arrays["edges"].reshape(-1, 2), mesh.topology.edges.numpy())
    assert np.array_equal(arrays["boundary"], mesh.topology.is_boundary_vertex.numpy())
    frame = bench.frames[-1]
    assert np.array_equal(frame.vertices, mesh.vertices.numpy())
    assert frame.flags == AT_REST | JUMP
    assert frame.topology == message["topology"]
    assert last(bench, "numbers")["E"] == pytest.approx(float(normal_variation(mesh.vertices, mesh.topology)))
    assert last(bench, "numbers")["deviation"] == pytest.approx(0.0, abs=1e-12)
    start = arrays["start"].reshape(-1, 3) + np.array(message["origin"])
    assert np.allclose(start, mesh.vertices.numpy(), atol=1e-6)
    assert not bench.worker.waits()


def test_left_and_right_faces_of_edges_are_those_that_pages_draw(bench: Bench) -> None:
    _, arrays = last(bench, "topology")
    faces = [
        arrays["corners"][a:b].tolist() for a, b in zip(arrays["offsets"][:-1], arrays["offsets"][1:], strict=True)
    ]
    pairs = zip(arrays["edges"].reshape(-1, 2).tolist(), arrays["edge_faces"].reshape(-1, 2).tolist(), strict=True)
    for (v, w), (left, right) in pairs:
        assert w == faces[left][(faces[left].index(v) + 1) % 3]
        assert right == -1 or v == faces[right][(faces[right].index(w) + 1) % 3]


def test_marks_of_the_file_are_principal_edges(bench: Bench) -> None:
    message, arrays = last(bench, "topology")
    assert message["principal_edges"] == int((arrays["labels"] & 1).sum()) > 0


def test_a_handle_is_followed_and_comes_to_rest_where_it_is_pulled(bench: Bench) -> None:
    before = last(bench, "numbers")["E"]
    target = drag(bench)
    assert bench.session.state is S.READY
    assert np.linalg.norm(bench.vertices[HANDLE] - target) < 0.05 * last(bench, "numbers")["mean_edge"]
    moving = [frame for frame in bench.frames if frame.flags & DRAGGING]
    assert {frame.count for frame in moving} == {1, 2}
    assert np.array_equal(bench.frames[-1].vertices, bench.vertices)
    assert bench.frames[-1].flags == AT_REST
    assert last(bench, "numbers")["E"] != before
    assert last(bench, "numbers")["handle_distance"] == pytest.approx(
        float(np.linalg.norm(bench.vertices[HANDLE] - target))
    )
    assert last(bench, "handles")["handles"] == [{"vertex": HANDLE, "target": pytest.approx(target)}]
    assert {"type": "done", "id": 1} in bench.told
    assert not bench.worker.waits()


def test_undo_and_redo_are_equal_to_the_bit(bench: Bench) -> None:
    states = [bench.vertices]
    for vertex in (HANDLE, OTHER, THIRD):
        drag(bench, vertex)
        states.append(bench.vertices)
    for state in states[-2::-1]:
        bench.say(type="undo")
        assert np.array_equal(bench.vertices, state)
        assert np.array_equal(bench.frames[-1].vertices, state)
        assert bench.frames[-1].flags == AT_REST | JUMP
    bench.say(type="undo")
    assert bench.errors == ["there is nothing to undo"]
    for state in states[1:]:
        bench.say(type="redo")
        assert np.array_equal(bench.frames[-1].vertices, state)
    assert [entry["vertex"] for entry in last(bench, "handles")["handles"]] == [HANDLE, OTHER, THIRD]


@pytest.mark.slow
def test_what_follows_undo_is_what_would_have_followed(bench: Bench) -> None:
    drag(bench, OTHER)
    drag(bench, HANDLE)
    first = bench.vertices
    bench.say(type="undo")
    drag(bench, HANDLE)
    assert np.abs(bench.vertices - first).max() < 1e-3


def test_escape_puts_everything_back_to_the_bit(bench: Bench) -> None:
    drag(bench, OTHER)
    before, handles = bench.vertices, last(bench, "handles")
    bench.say(type="move", places=[[HANDLE, *pulled(bench, HANDLE, 0.3)]])
    bench.say(type="release", back=True)
    assert bench.session.history.position == 1
    assert np.array_equal(bench.frames[-1].vertices, before)
    assert last(bench, "handles") == handles
    assert bench.session.state is S.READY


def test_typed_coordinates_are_one_edit(bench: Bench) -> None:
    target = pulled(bench)
    bench.say(type="move", places=[[HANDLE, *target]], release=True, id=3)
    assert bench.session.history.position == 1
    assert bench.session.history.now.words == f"drag vertex {HANDLE}"
    assert np.linalg.norm(bench.vertices[HANDLE] - target) < 0.05 * last(bench, "numbers")["mean_edge"]


def test_several_handles_move_together(bench: Bench) -> None:
    places = {vertex: pulled(bench, vertex) for vertex in (28, 30, 32)}
    bench.say(type="move", places=[[vertex, *place] for vertex, place in places.items()])
    bench.say(type="release")
    for vertex, place in places.items():
        assert np.linalg.norm(bench.vertices[vertex] - place) < 0.05 * last(bench, "numbers")["mean_edge"]


def test_fixed_vertices_stay_and_freed_ones_go(bench: Bench) -> None:
    near = sorted(set(range(24, 37)) - {HANDLE})
    bench.say(type="hold", vertices=near)
    before = bench.vertices
    drag(bench)
    assert np.array_equal(bench.vertices[near], before[near])
    bench.say(type="free", vertices=near)
    assert bench.session.history.now.held == ()
    assert not np.array_equal(bench.vertices[near], before[near])
    assert last(bench, "handles")["held"] == []


def test_a_flick_of_the_mouse_ends_where_it_was_let_go(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    """The release comes while the first step of the move is made."""
    place, step = pulled(bench, outwards=0.8), Follower.step

    def released(follower: Follower) -> object:
        done = step(follower)
        bench.carry_out(bench.session.command(1, checked_command({"type": "release", "id": 1})))
        return done

    monkeypatch.setattr(Follower, "step", released)
    bench.say(type="move", places=[[HANDLE, *place]], count=1)
    assert not bench.errors
    assert bench.session.state is S.READY
    assert np.abs(bench.vertices[HANDLE] - place).max() < 0.02


def test_weights_act_while_they_are_turned(bench: Bench) -> None:
    drag(bench, outwards=0.3)
    rough = bench.vertices
    bench.say(type="weigh", weights={"fairness": 30.0})
    assert bench.session.state is S.DRAGGING
    bench.say(type="release")
    assert bench.session.history.now.words == "weigh fairness 30"
    assert np.abs(bench.vertices - rough).max() > 1e-4

    def fairness() -> float:
        """As windows that are opened now have it."""
        bench.carry_out(bench.session.window_opened(2))
        return float({weight["name"]: weight["value"] for weight in last(bench, "settings")["weights"]}["fairness"])

    assert fairness() == 30.0
    bench.say(type="undo")
    assert fairness() == 0.3
    bench.say(type="redo")
    assert fairness() == 30.0
    bench.say(type="weigh", weights={"strange": 1.0})
    bench.say(type="weigh", weights={"fairness": 1e9})
    assert ["weights are" in error or "goes from" in error for error in bench.errors] == [True, True]


@pytest.mark.slow
def test_the_boundary_stays_glides_or_is_free(bench: Bench) -> None:
    rim = topology_of(bench).is_boundary_vertex.numpy()
    drag(bench, 14, 0.2)
    for choice, moves, leaves in (("fixed", False, False), ("glide", True, False), ("free", True, True)):
        bench.say(type="undo")
        before = bench.vertices
        bench.say(type="choose", choices={"boundary": choice})
        drag(bench, 14, 0.2)
        ways = np.abs(bench.vertices - before)[rim]
        assert bool(ways.max() > 1e-9) == moves
        assert bool(ways[:, 2].max() > 1e-6) == leaves, choice


def test_a_pause_holds_the_mesh_while_handles_move(bench: Bench) -> None:
    before = bench.vertices
    bench.say(type="pause", on=True)
    places = [[HANDLE, *pulled(bench)]]
    serial = bench.session._core.serial
    bench.carry_out(bench.session.command(1, read_command('{"type": "move", "places": %s}' % str(places))))  # noqa: UP031
    bench.carry_out(bench.session.command(1, read_command('{"type": "pause", "on": false}')))
    request = bench.pipe.waiting[0]
    assert isinstance(request, r.Drag)
    frames = len(bench.frames)
    bench.pipe.waiting.appendleft(r.Pause(serial, True))
    bench.run()
    assert len(bench.frames) > frames
    bench.say(type="release")
    assert not np.array_equal(bench.vertices, before)


def test_modes_go_on_from_where_the_mesh_is(bench: Bench) -> None:
    drag(bench)
    places = bench.vertices
    bench.say(type="mode", mode="form")
    assert np.array_equal(bench.vertices, places)
    assert bench.session.history.now.mode == "form"
    bench.say(type="free", vertices=[HANDLE])
    bench.say(type="undo")
    bench.say(type="undo")
    assert np.array_equal(bench.vertices, places)
    assert bench.session.history.now.mode == "fair"
    assert not failures(bench)


def test_a_symmetric_design_meets_its_conditions_after_a_drag(bench: Bench) -> None:
    bench.say(type="mode", mode="symmetric")
    drag(bench, HANDLE, 0.1)
    document = bench.session.history.now
    edges = PrincipalEdges(topology_of(bench), torch.from_numpy(document.principal))
    residuals = condition_residuals(torch.from_numpy(bench.vertices.copy()), edges, edges.stars())
    assert all(float(values.max()) < 1e-8 for values in residuals.values())
    strips = bench.say(type="strips", id=9)
    message, arrays = next(m for m in strips if isinstance(m, tuple) and m[0]["type"] == "strips")
    assert message["planarity"] < 1e-6
    assert arrays["outlines"].size == 2 * sum(strip["outline"][1] for strip in message["strips"])


def test_refined_meshes_carry_handles_and_marks_and_undo_leads_back(bench: Bench) -> None:
    bench.say(type="hold", vertices=[40])
    target = drag(bench)
    coarse = bench.session.history.now
    bench.say(type="subdivide")
    fine = bench.session.history.now
    assert fine.count > 3 * coarse.count
    assert fine.coarse is coarse
    assert fine.handles[HANDLE] == pytest.approx(target)
    assert fine.held[0] == 40
    assert last(bench, "topology")[0]["principal_edges"] > 1.9 * int(coarse.principal.sum())
    bench.say(type="settle")
    rested = bench.vertices
    bench.say(type="undo")
    bench.say(type="undo")
    assert np.array_equal(bench.frames[-1].vertices, coarse.vertices)
    assert last(bench, "topology")[0]["vertices"] == coarse.count
    bench.say(type="redo")
    bench.say(type="redo")
    assert np.array_equal(bench.frames[-1].vertices, rested)
    assert not failures(bench)


def test_the_surface_becomes_principal_quads_and_work_goes_on(bench: Bench) -> None:
    bench.say(type="mesh", kind="quads", count=40, id=2)
    message, arrays = last(bench, "topology")
    assert set(np.diff(arrays["offsets"]).tolist()) == {4}
    assert not message["triangular"]
    drag(bench, 12, 0.05)
    assert {"type": "done", "id": 2} in bench.told
    bench.say(type="mode", mode="symmetric")
    assert "triangles" in bench.errors[-1]
    assert bench.session.state is S.READY


def test_what_the_job_refuses_is_a_sentence_and_everything_is_as_it_was(tmp_path: Path) -> None:
    bench = Bench(tmp_path, r.Open(0, "example:torus"))
    before = bench.session.history.now
    bench.say(type="mode", mode="form", id=4)
    assert "boundary" in bench.errors[-1] or "closed" in bench.errors[-1]
    assert bench.session.history.now is before
    assert bench.session.state is S.READY
    assert "boundary" in last(bench, "state")["modes"][1]["refused"]


def test_handles_that_are_none_are_refused(bench: Bench) -> None:
    count = len(bench.vertices)
    bench.say(type="move", places=[[count, 0, 0, 0]])
    bench.say(type="move", places=[[0, 1e12, 0, 0]])
    bench.say(type="hold", vertices=[count])
    assert [f"0 to {count - 1}" in error or "sizes" in error for error in bench.errors] == [True, True, True]
    assert bench.session.state is S.READY
