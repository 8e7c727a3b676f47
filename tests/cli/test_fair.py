"""``torchfair fair``: files written, refusals, what is printed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import torch
from helpers import report_in, wavy_grid
from interruptions import nth, press

from torchfair.cli import main
from torchfair.energies import normal_variation
from torchfair.io import edge_labels_path, load_edge_labels, load_mesh, save_mesh
from torchfair.principal import principal_edges_of_lattice
from torchfair.shapes import Catenoid, principal_triangles
from torchfair.subdivision import loop

QUIET = ["--iterations", "3", "--no-pictures"]


@pytest.fixture
def roof(tmp_path: Path) -> Path:
    vertices, topology = wavy_grid(7, 6, triangles=True)
    path = tmp_path / "roof.obj"
    save_mesh(path, vertices, topology)
    return path


def error_line(capsys: pytest.CaptureFixture[str]) -> str:
    """The single line that a refused call prints."""
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert err.startswith("torchfair fair: error: ")
    return err


def test_mesh_report_and_pictures_are_written(roof: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / "smooth" / "roof.ply"
    assert main(["fair", str(roof), "-o", str(output), "--iterations", "8"]) == 0
    out, err = capsys.readouterr()
    before, after = load_mesh(roof), load_mesh(output)
    report = report_in(output.parent)
    energies = report["energies"]
    assert after.topology.face_lists() == before.topology.face_lists()
    for mesh, which in ((before, "before"), (after, "after")):
        assert energies[which]["normal_variation"] == pytest.approx(
            float(normal_variation(mesh.vertices, mesh.topology)), rel=1e-12
        )
    assert energies["after"]["normal_variation"] < energies["before"]["normal_variation"]
    assert report["settings"]["boundary"] == "glide"
    runs = report["levels"][0]["runs"]
    for run in runs:
        assert {"name", "mean", "largest", "weight", "merit"} <= run["residuals"][0].keys()
        assert [record["iteration"] for record in run["history"]] == list(range(run["steps"] + 1))
    assert len(runs) == 3
    assert report["steps"] == sum(run["steps"] for run in runs)
    assert report["seconds"] == pytest.approx(sum(run["timings"]["total"] for run in runs))
    assert report["timings"]["total"] == pytest.approx(report["seconds"])
    assert f"{report['steps']} steps in 3 runs, {report['seconds']:.2f} s: {runs[-1]['message']}" in out
    assert report["versions"]["torch"] == torch.__version__
    for name in ("roof.before_after.png", "roof.edges.png", "roof.gauss_images.png"):
        assert (output.parent / name).read_bytes().startswith(b"\x89PNG")
        assert name in out
    assert "iteration 0/8" in err


def test_existing_files_are_refused_before_any_work_and_kept(
    roof: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "out.obj"
    output.write_text("precious")
    assert main(["fair", str(roof), "-o", str(output), *QUIET]) == 2
    assert "--force" in error_line(capsys)
    assert output.read_text() == "precious"
    assert main(["fair", str(roof), "-o", str(output), "--force", *QUIET]) == 0
    assert load_mesh(output).topology.num_faces == load_mesh(roof).topology.num_faces


def test_existing_report_is_refused(roof: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "out.report.json").write_text("{}")
    assert main(["fair", str(roof), "-o", str(tmp_path / "out.obj"), *QUIET]) == 2
    assert "out.report.json" in error_line(capsys)
    assert not (tmp_path / "out.obj").exists()
    folder = tmp_path / "elsewhere"
    assert main(["fair", str(roof), "-o", str(tmp_path / "out.obj"), "--results", str(folder), *QUIET]) == 0
    assert (folder / "out.report.json").exists()


REFUSED = {
    "no output": ([], "-o"),
    "unknown option": (["-o", "x.obj", "--smooth"], "--smooth"),
    "unknown format": (["-o", "x.stp"], "x.stp"),
    "bad boundary": (["-o", "x.obj", "--boundary", "loose"], "loose"),
    "bad handle": (["-o", "x.obj", "--handle", "a", "0", "0", "0"], "--handle"),
    "handle out of range": (["-o", "x.obj", "--handle", "999", "0", "0", "0"], "999"),
    "negative distance": (["-o", "x.obj", "--distance", "-1"], "-1"),
    "corner angle": (["-o", "x.obj", "--corner-angle", "200"], "--corner-angle"),
    "missing reference": (["-o", "x.obj", "--reference", "missing.obj"], "missing.obj"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_bad_requests_end_with_one_line_and_write_nothing(
    name: str, roof: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "work"
    folder.mkdir()
    monkeypatch.chdir(folder)
    words, message = REFUSED[name]
    assert main(["fair", str(roof), *words, *QUIET]) == 2
    assert message in error_line(capsys)
    assert list(folder.iterdir()) == []


def test_unreadable_input_and_unknown_example(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = str(tmp_path / "x.obj")
    assert main(["fair", str(tmp_path / "none.obj"), "-o", output]) == 2
    assert "none.obj" in error_line(capsys)
    assert main(["fair", "example:palace", "-o", output]) == 2
    assert "no example 'palace': choose roof" in error_line(capsys)


def test_interruption_writes_the_best_mesh(
    roof: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from torchfair.progress import ProgressDisplay

    original = ProgressDisplay.__call__

    def interrupt(self: ProgressDisplay, record: Any) -> None:
        original(self, record)
        if record.iteration > 0 and record.accepted:
            raise KeyboardInterrupt

    monkeypatch.setattr(ProgressDisplay, "__call__", interrupt)
    output = tmp_path / "out.obj"
    assert main(["fair", str(roof), "-o", str(output), "--no-pictures"]) == 130
    assert "interrupted" in capsys.readouterr().out
    report = report_in(tmp_path)
    assert report["status"] == "interrupted"
    assert report["energies"]["after"]["normal_variation"] < report["energies"]["before"]["normal_variation"]
    assert load_mesh(output).topology.num_faces == load_mesh(roof).topology.num_faces


@pytest.mark.parametrize("place", ["FairProblem.shares", "FairProblem.terms", "fair_measures"])
def test_ctrl_c_while_setting_up_or_measuring_writes_everything(
    place: str, roof: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from torchfair.formfinding.fair import problem
    from torchfair.formfinding.fair import recipe as job

    owner: object = job if place == "fair_measures" else problem.FairProblem
    name = place.split(".")[-1]
    monkeypatch.setattr(owner, name, nth(getattr(owner, name), 1 + (place == "fair_measures"), press))
    output = tmp_path / "out.obj"
    cut = name != "fair_measures"  # measuring is finished; who pressed wants no more even so, such as the next input
    assert main(["fair", str(roof), "-o", str(output), *QUIET]) == 130
    report = report_in(tmp_path)
    assert (report["status"] == "interrupted") is cut
    assert ("interrupted" in capsys.readouterr().out) is cut
    energies = [report["energies"][when]["normal_variation"] for when in ("before", "after")]
    assert energies[1] <= energies[0] * (1.0 + 1e-12)
    assert load_mesh(output).topology.num_faces == load_mesh(roof).topology.num_faces


def test_ctrl_c_while_reading_leaves_no_files(
    roof: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from torchfair.cli import fair

    monkeypatch.setattr(fair, "read_input", nth(fair.read_input, 1, press))
    folder = tmp_path / "empty"
    folder.mkdir()
    assert main(["fair", str(roof), "-o", str(folder / "out.obj"), *QUIET]) == 130
    assert capsys.readouterr() == ("", "torchfair fair: interrupted\n")
    assert list(folder.iterdir()) == []


def test_options_reach_the_settings(roof: Path, tmp_path: Path) -> None:
    words = ["--distance", "none", "--boundary", "fixed", "--planar", "none", "--fairness", "0.7", "--solver", "scipy"]
    assert main(["fair", str(roof), "-o", str(tmp_path / "out.obj"), *words, *QUIET]) == 0
    report = report_in(tmp_path)
    settings = report["settings"]
    assert settings["distance_limit"] is None
    assert (settings["boundary"], settings["planar"], settings["fairness_weight"]) == ("fixed", "none", 0.7)
    assert {run["solver"] for level in report["levels"] for run in level["runs"]} == {"scipy"}
    assert settings["projection"]["max_iterations"] == 3


def test_the_printed_method_is_found_again_by_its_report(roof: Path, tmp_path: Path) -> None:
    first, second = tmp_path / "first" / "roof.obj", tmp_path / "second" / "roof.obj"
    preset = ["--preset", "paper,w_target=0.1,steps=3", "--no-pictures"]
    assert main(["fair", str(roof), "-o", str(first), *preset]) in (0, 1)
    report = report_in(first.parent)
    assert report["request"]["preset"] == "paper,w_target=0.1,steps=3"
    assert report["settings"]["energy_weight"] == 0.05
    assert report["settings"]["projection"]["step_policy"] == "every"
    again = ["--settings", str(first.with_suffix(".report.json")), "--no-pictures"]
    assert main(["fair", str(roof), "-o", str(second), *again]) in (0, 1)
    assert second.read_bytes() == first.read_bytes()


@pytest.mark.parametrize("levels", [0, 1])
@pytest.mark.parametrize("ending", [".obj", ".ply"])
def test_marked_edges_go_with_the_mesh(ending: str, levels: int, tmp_path: Path) -> None:
    mesh = principal_triangles(Catenoid(), 5, 8)
    edges = principal_edges_of_lattice(mesh)
    save_mesh(tmp_path / "lattice.obj", mesh.vertices, mesh.topology, polylines=edges.polylines())
    output = tmp_path / "out" / f"fair{ending}"
    words = [str(tmp_path / "lattice.obj"), "-o", str(output), "--levels", str(levels), *QUIET]
    main(["fair", *words])
    made = load_mesh(output)
    marks = load_edge_labels(edge_labels_path(output), made.topology)
    expected = edges.refine(loop(mesh.topology)).mask if levels else edges.mask
    assert torch.equal(marks, expected)
    assert int(expected.sum()) > 0


def test_marks_of_single_edges_stay_single_and_bad_ones_are_refused_first(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    vertices, topology = wavy_grid(7, 6)
    line = topology.edges[:1]
    save_mesh(tmp_path / "quads.obj", vertices, topology, polylines=list(line))
    output = tmp_path / "fair.obj"
    main(["fair", str(tmp_path / "quads.obj"), "-o", str(output), "--levels", "1", *QUIET])
    made = load_mesh(output)
    marks = load_edge_labels(output, made.topology)
    assert int(marks.sum()) == 2
    assert set(line.flatten().tolist()) <= set(made.topology.edges[marks].flatten().tolist())
    capsys.readouterr()
    text = (tmp_path / "quads.obj").read_text()
    (tmp_path / "bad.obj").write_text(text + "l 1 40\n")
    assert main(["fair", str(tmp_path / "bad.obj"), "-o", str(tmp_path / "bad" / "out.obj"), *QUIET]) == 2
    assert "not joined by an edge" in error_line(capsys)
    assert not (tmp_path / "bad").exists()


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["15", "16"], {14, 15}),
        (["near", "2.1", "2.9", "0"], None),
        (["box", "9", "9", "9", "-9", "-9", "-9"], set(range(42))),
    ],
)
def test_fixed_vertices_stay_where_they_are(
    words: list[str], expected: set[int] | None, roof: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "out" / "roof.obj"
    assert main(["fair", str(roof), "-o", str(output), "--fix", *words, *QUIET]) == 0
    before, after = load_mesh(roof).vertices, load_mesh(output).vertices
    if expected is None:
        place = before.new_tensor([float(word) for word in words[1:]])
        expected = {int((before - place).norm(dim=1).argmin())}
    chosen = sorted(expected)
    assert torch.equal(before[chosen], after[chosen])
    told = "1 vertex is fixed" if len(chosen) == 1 else f"{len(chosen)} vertices are fixed"
    assert told in capsys.readouterr().out
    assert report_in(output.parent)["request"]["fix"] == [" ".join(words)]


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["near", "1", "2"], "near X Y Z"),
        (["box", "1", "2", "3"], "box X Y Z X Y Z"),
        (["-3"], "1 to 42 in the file, got -3"),
        (["near", "nan", "0", "0"], "near X Y Z"),
        (["box", "90", "90", "90", "91", "91", "91"], "no vertex"),
        (["43"], "1 to 42 in the file, got 43"),
    ],
)
def test_what_cannot_be_fixed_is_refused(
    words: list[str], named: str, roof: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["fair", str(roof), "-o", str(tmp_path / "out.obj"), "--fix", *words, *QUIET]) == 2
    assert named in capsys.readouterr().err
    assert not (tmp_path / "out.obj").exists()


def test_panels_that_cannot_become_planar_are_named_and_the_exit_code_is_1(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, output = tmp_path / "quad.obj", tmp_path / "out.obj"
    path.write_text("v 0 0 0\nv 1 0 .14\nv 1 1 0\nv 0 1 .14\nf 1 2 3 4\n")
    command = ["fair", str(path), "-o", str(output), "--planar", "quads", "--no-pictures"]
    assert main([*command, "--boundary", "fixed"]) == 1
    out = capsys.readouterr().out
    assert "NOT REACHED; 1 of 1: faces 1 (line 5) (" in out
    assert "raise --distance, or choose fewer faces" in out  # the option, not the field of the library
    assert "are kept planar" not in out
    assert torch.equal(load_mesh(output).vertices, load_mesh(path).vertices)


def test_a_reference_in_another_unit_is_refused(roof: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mesh = load_mesh(roof)
    save_mesh(tmp_path / "millimetres.obj", 1000.0 * mesh.vertices, mesh.topology)
    command = ["fair", str(roof), "-o", str(tmp_path / "out.obj"), *QUIET]
    assert main([*command, "--reference", str(tmp_path / "millimetres.obj")]) == 2
    assert "divide it by 1000" in error_line(capsys)
    assert not (tmp_path / "out.obj").exists()
