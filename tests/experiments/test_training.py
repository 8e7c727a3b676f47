"""Training: claims at tiny sizes, patience, courses, several processes, interruptions."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import torch

from torchfair import Topology
from torchfair.geometry import face_area_vectors, planarity
from torchfair.io import load_mesh

FOLDER = Path(__file__).parents[2] / "experiments"

Run = Callable[..., dict[str, Any]]


TRAINING = ("--rows", "8", "--columns", "8", "--points", "120", "--batch", "60", "--steps", "90", "--log-every", "30")


def test_training_with_energy_is_nearer_to_the_surface_and_smoother(run: Run, tmp_path: Path) -> None:
    options = (*TRAINING, "--steps", "300", "--learning-rate", "0.02", "--noise", "0.1")
    report = run("train_height_field", *options)
    plain, regularised = report["plain"], report["regularised"]
    assert regularised["best"]["error"] < 0.8 * plain["best"]["error"]
    assert regularised["normal_variation"] < 0.5 * plain["normal_variation"]
    lines = [json.loads(line) for line in (tmp_path / "out" / "plain.jsonl").read_text().splitlines()]
    assert [line["step"] for line in lines] == list(range(30, 301, 30))
    assert plain["best"] == min(lines, key=lambda line: line["validation"])


def test_a_surface_of_changing_faces_is_smoother_with_energy(run: Run, tmp_path: Path) -> None:
    options = ("--nodes", "11", "--steps", "60", "--log-every", "20", "--samples", "400", "--noise", "0.1",
               "--warm-up", "5", "--weight", "0.003", "--runs", "plain", "normal_variation")  # fmt: skip
    report = run("train_signed_distance", *options)
    plain, regularised = report["plain"]["records"][-1], report["normal_variation"]["records"][-1]
    assert regularised["normal_variation_over_c"] < 0.9 * plain["normal_variation_over_c"]
    assert load_mesh(tmp_path / "out" / "normal_variation.obj").topology.num_faces > 100


def test_a_network_finds_forms_of_less_curvature_than_it_starts_from(run: Run, tmp_path: Path) -> None:
    options = ("--rows", "6", "--steps", "150", "--log-every", "50", "--hidden", "32", "--unseen", "1",
               "--validation-boundaries", "8")  # fmt: skip
    report = run("train_form_finding", *options)
    records = report["training"]["records"]
    assert records[-1]["c_over_harmonic"] < records[0]["c_over_harmonic"] < 1.0
    (row,) = report["unseen"]["rows"]
    assert row["solver"] < row["network"] < row["harmonic"]
    start, found = (load_mesh(tmp_path / "out" / f"{name}.obj") for name in ("harmonic", "network"))
    rim = start.topology.is_boundary_vertex
    torch.testing.assert_close(found.vertices[rim], start.vertices[rim], rtol=0, atol=1e-6)


def test_marching_tetrahedra_give_closed_meshes_that_follow_the_values(script: Callable[[str], ModuleType]) -> None:
    marching = script("_marching")
    nodes = marching.lattice(13, 1.0)
    radius = torch.linalg.vector_norm(nodes, dim=1)
    values = (radius - 0.713).requires_grad_()
    vertices, topology = marching.zero_surface(values, nodes, 13)
    topology.require_fans()
    counts = (topology.num_vertices - topology.num_edges + topology.num_faces, len(topology.boundary_loops()))
    assert counts == (2, 0)

    def volume_inside(vertices: torch.Tensor, topology: Topology) -> torch.Tensor:  # positive: normals point outward
        firsts = vertices[topology.corners[topology.face_offsets[:-1]]]
        return (face_area_vectors(vertices, topology) * firsts).sum() / 3

    inside, finer = volume_inside(vertices, topology), marching.lattice(25, 1.0)
    exact, finer_values = 4 / 3 * math.pi * 0.713**3, torch.linalg.vector_norm(finer, dim=1) - 0.713
    at_half = volume_inside(*marching.zero_surface(finer_values, finer, 25))
    assert 3 < (exact - inside.item()) / (exact - at_half.item()) < 5  # second order
    assert (torch.linalg.vector_norm(vertices, dim=1) - 0.713).abs().max() < 0.02
    assert planarity(vertices, topology).max() < 1e-12
    (slope,) = torch.autograd.grad(inside, values)
    assert (slope < 1e-12).all()  # where values rise, the body shrinks
    area = 4 * math.pi * 0.713**2  # by how much it does if all rise alike, as their slope is one
    assert float(slope.sum()) == pytest.approx(-area, rel=0.03)


@pytest.mark.parametrize("value", [1.0, -1.0])
def test_no_surface_is_an_empty_mesh(script: Callable[[str], ModuleType], value: float) -> None:
    marching = script("_marching")
    nodes = marching.lattice(5, 1.0)
    vertices, topology = marching.zero_surface(torch.full((125,), value), nodes, 5)
    assert (vertices.shape, topology.num_faces) == ((0, 3), 0)


def test_patience_ends_a_training_at_its_best(run: Run) -> None:
    report = run("train_height_field", *TRAINING, "--log-every", "5", "--patience", "2", "--learning-rate", "0.3",
                 "--noise", "0.5", "--steps", "300")  # fmt: skip
    plain = report["plain"]
    assert plain["stopped_early"]
    assert plain["last"]["step"] == plain["best"]["step"] + 10 < 300


def test_gradients_are_clipped_and_half_precision_trains(run: Run) -> None:
    short = (*TRAINING, "--no-compare", "--steps", "30")
    plain = run("train_height_field", *short)["regularised"]["last"]
    clipped = run("train_height_field", *short, "--clip", "1e-9", folder="clipped")["regularised"]["last"]
    assert clipped != plain  # Adam scales clipped gradients up again, but for its epsilon
    half = run("train_height_field", *short, "--dtype", "bfloat16", folder="half")["regularised"]["last"]
    assert half["validation"] == pytest.approx(plain["validation"], rel=0.05)


def test_a_longer_course_goes_on_from_the_end_of_a_shorter_one(run: Run, tmp_path: Path) -> None:
    run("train_height_field", *TRAINING, "--no-compare", "--steps", "30")
    more = run("train_height_field", *TRAINING, "--no-compare", "--steps", "60", "--resume")["regularised"]
    assert more["last"]["step"] == 60
    log = (tmp_path / "out" / "regularised.jsonl").read_text().splitlines()
    assert [json.loads(line)["step"] for line in log] == [30, 60]


def test_events_are_written_where_tensorboard_is(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    written: list[tuple[object, ...]] = []

    class SummaryWriter:
        def __init__(self, folder: str) -> None:
            written.append(("open", folder))

        def add_scalar(self, *values: object) -> None:
            written.append(values)

        def close(self) -> None:
            written.append(("close",))

    module = ModuleType("torch.utils.tensorboard")
    module.SummaryWriter = SummaryWriter  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "torch.utils.tensorboard", module)
    report = run("train_height_field", *TRAINING, "--no-compare", "--steps", "30")
    assert written[0][0] == "open"
    assert ("validation", report["regularised"]["last"]["validation"], 30) in written
    assert written[-1] == ("close",)


@pytest.mark.slow
def test_two_processes_train_one_model(tmp_path: Path) -> None:
    """As torchrun starts them: the same parameters in both, from the mean of the gradients of their batches."""
    script = FOLDER / "train_height_field.py"
    options = [*TRAINING, "--no-compare", "--width", "400", "--steps", "60"]
    results = []
    for extra in ([], ["--steps", "90", "--resume"]):
        command = [sys.executable, "-m", "torch.distributed.run", "--nproc-per-node", "2", "--master-port", "29517"]
        command += [str(script), "--output", str(tmp_path / "out"), *options, *extra]
        done = subprocess.run(command, capture_output=True, text=True, cwd=FOLDER.parent)
        assert done.returncode == 0, done.stderr[-2000:]
        results.append(json.loads((tmp_path / "out" / "result.json").read_text())["regularised"])
    assert [row["last"]["step"] for row in results] == [60, 90]
    state = torch.load(tmp_path / "out" / "regularised_last.pt", weights_only=True)
    assert len(state["generators"]) == 2
    assert not torch.equal(*state["generators"])


def test_the_mean_of_gradients_is_that_of_the_processes(script: Callable[[str], ModuleType]) -> None:
    processes = script("_processes").Processes(0, 2)
    module = torch.nn.Linear(2, 1)
    module.weight.grad = torch.tensor([[1.0, 2.0]])

    def twice(flat: torch.Tensor) -> None:
        flat += torch.tensor([3.0, 0.0, 5.0])  # what the other process has

    original, torch.distributed.all_reduce = torch.distributed.all_reduce, twice  # type: ignore[assignment]
    try:
        processes.average_gradients(module)
    finally:
        torch.distributed.all_reduce = original
    assert module.weight.grad.tolist() == [[2.0, 1.0]]
    assert module.bias.grad.tolist() == [2.5]


def test_ctrl_c_keeps_the_last_whole_step(
    run: Run, script: Callable[[str], ModuleType], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = script("train_height_field")
    residuals, calls = module.Samples.residuals, []

    def interrupting(self: object, *arguments: object) -> torch.Tensor:
        calls.append(1)
        if len(calls) == 43:  # 30 steps, two validations, then the eleventh step after these
            raise KeyboardInterrupt
        return residuals(self, *arguments)

    monkeypatch.setattr(module.Samples, "residuals", interrupting)
    run("train_height_field", *TRAINING, code=130)
    state = torch.load(tmp_path / "out" / "regularised_last.pt", weights_only=True)
    assert state["step"] == 40


def test_interrupted_training_keeps_the_best_and_resumes_to_the_same_numbers(
    run: Run, script: Callable[[str], ModuleType], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = run("train_height_field", *TRAINING, folder="whole")
    module = script("train_height_field")
    residuals, calls = module.Samples.residuals, []

    def interrupting(self: object, *arguments: object) -> torch.Tensor:
        calls.append(1)
        if len(calls) == 50:  # in the second stretch of 30 steps
            raise KeyboardInterrupt
        return residuals(self, *arguments)

    monkeypatch.setattr(module.Samples, "residuals", interrupting)
    stopped = run("train_height_field", *TRAINING, code=130)
    assert stopped["interrupted"]
    assert stopped["regularised"]["best"]["step"] == 30
    assert "plain" not in stopped
    assert (tmp_path / "out" / "regularised.obj").exists()
    monkeypatch.undo()
    monkeypatch.syspath_prepend(str(FOLDER))
    resumed = run("train_height_field", *TRAINING, "--resume")
    for name in ("regularised", "plain"):
        for key in ("best", "last"):
            expected, actual = (dict(report[name][key], seconds=0) for report in (whole, resumed))
            assert actual == expected
    log = (tmp_path / "out" / "regularised.jsonl").read_text().splitlines()
    assert [json.loads(line)["step"] for line in log] == [30, 60, 90]


def test_a_checkpoint_of_other_settings_is_refused(run: Run, capsys: pytest.CaptureFixture[str]) -> None:
    run("train_height_field", *TRAINING, "--steps", "2", "--no-compare")
    run("train_height_field", *TRAINING, "--steps", "2", "--no-compare", "--resume", "--noise", "0.2", code=2)
    assert "other settings (noise)" in capsys.readouterr().err
