"""``torchfair mesh`` from files to files."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
import torch
from creased_shapes import folded_sheet
from helpers import report_in
from PIL import Image

from torchfair.cli import main
from torchfair.cli.mesh import fill, options, too_small
from torchfair.cli.parser import CommandParser
from torchfair.io import load_edge_labels, load_mesh, save_mesh
from torchfair.meshing import MeshingSettings, principal_quads
from torchfair.progress import ProgressDisplay
from torchfair.settings import fields_of
from torchfair.shapes import Cylinder, FreeFormPatch, PrincipalParaboloid, irregular_triangles

PAGE = Path(__file__).resolve().parents[2] / "docs" / "command_line.md"
SADDLE = PrincipalParaboloid(1.0, -0.5, (0.8, 0.8))


@pytest.fixture
def surface(tmp_path: Path) -> Path:
    mesh = irregular_triangles(SADDLE, 700)
    path = tmp_path / "surface.obj"
    save_mesh(path, mesh.vertices, mesh.topology)
    return path


def test_quads_are_those_of_the_library(surface: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / "out" / "quads.obj"
    assert main(["mesh", str(surface), "-o", str(output), "--quads", "150"]) == 0
    source, made = load_mesh(surface), load_mesh(output)
    expected = principal_quads(source.vertices, source.topology, count=150)
    assert torch.equal(made.vertices, expected.vertices)
    assert made.topology.face_lists() == expected.topology.face_lists()
    report = report_in(output.parent)
    assert report["measures"]["faces"] == expected.report["faces"]
    assert report["measures"]["angle_mean_degrees"] == expected.report["angle_mean_degrees"]
    assert report["request"]["quads"] == 150
    out = capsys.readouterr().out
    assert "angle to principal directions" in out
    assert "singular points" in out
    for name in (f"{output.stem}.mesh.png", f"{output.stem}.edges.png"):
        with Image.open(output.parent / name) as picture:
            assert len(picture.convert("RGB").getcolors(1 << 24)) > 20
    assert main(["mesh", str(surface), "-o", str(output), "--quads", "150"]) == 2
    assert "--force" in capsys.readouterr().err


def test_a_report_gives_the_same_mesh_again(surface: Path, tmp_path: Path) -> None:
    first, second = tmp_path / "a" / "x.obj", tmp_path / "b" / "x.obj"
    words = ["--quads", "100", "--no-pictures"]
    assert main(["mesh", str(surface), "-o", str(first), *words, "--corner-angle", "60", "--no-align-boundary"]) == 0
    assert (
        main(["mesh", str(surface), "-o", str(second), *words, "--settings", str(first.with_suffix(".report.json"))])
        == 0
    )
    assert first.read_text() == second.read_text()
    reports = [report_in(path.parent)["settings"] for path in (first, second)]
    assert reports[0] == reports[1]
    assert reports[0]["align_boundary"] is False


@pytest.mark.parametrize("suffix", [".obj", ".ply"])
def test_triangles_come_with_their_principal_edges(surface: Path, tmp_path: Path, suffix: str) -> None:
    output = tmp_path / "out" / f"lattice{suffix}"
    assert main(["mesh", str(surface), "-o", str(output), "--triangles", "200"]) == 0
    made = load_mesh(output)
    assert made.topology.is_triangular
    labels = output if suffix == ".obj" else output.with_suffix(".edges.json")
    mask = load_edge_labels(labels, made.topology)
    assert 0.2 < float(mask.double().mean()) < 0.4
    assert (output.with_suffix(".mesh.png")).exists()


def test_planar_quads(tmp_path: Path) -> None:
    mesh = irregular_triangles(Cylinder(), 500)
    path, output = tmp_path / "tube.obj", tmp_path / "planar.obj"
    save_mesh(path, mesh.vertices, mesh.topology)
    assert main(["mesh", str(path), "-o", str(output), "--quads", "80", "--planar", "--no-pictures"]) == 0
    report = report_in(tmp_path)
    assert report["measures"]["planarity_max"] < 1e-4
    assert report["measures"]["distance_max"] < 0.2
    assert report["measures"]["before_planar"]["faces"] == report["measures"]["faces"]
    assert report["not_reached"] == []


def test_edges_that_are_nearly_collapsed_and_slivers_at_curves_are_promises_missed() -> None:
    def missed(shortest: float = 1.0, smallest: float | None = 1.0, **others: float) -> list[str]:
        return too_small({"shortest_edge": shortest, "smallest_curve_face": smallest, **others})

    assert missed(0.02, 0.05) == missed(smallest=None) == missed(smallest=0.01, spacing_shortest=0.1) == []
    (edge,) = missed(0.0199)
    assert edge.startswith("shortest edge 0.0199 mean edges, at least 0.02 asked for: NOT REACHED")
    (face,) = missed(smallest=0.049)
    assert face.startswith("smallest face at the boundary and creases 0.049 of the mean, at least 0.05 asked for: NOT")
    assert face.endswith("ask for more faces, or raise --corner-angle")


def test_ctrl_c_keeps_the_best_mesh(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """While polygons are made planar; what is not planar yet is said, once."""

    def interrupt(display: ProgressDisplay, record: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(ProgressDisplay, "__call__", interrupt)
    mesh = irregular_triangles(FreeFormPatch(), 300)  # quads of a saddle are planar as they are made
    path, output = tmp_path / "patch.obj", tmp_path / "planar.obj"
    save_mesh(path, mesh.vertices, mesh.topology)
    assert main(["mesh", str(path), "-o", str(output), "--quads", "60", "--planar", "--no-pictures"]) == 130
    report = report_in(tmp_path)
    assert load_mesh(output).topology.num_faces == report["measures"]["faces"]
    assert len(report["not_reached"]) == 1
    out = capsys.readouterr().out
    assert out.splitlines()[-1] == report["not_reached"][0]
    assert out.count("NOT REACHED") == 1
    assert "interrupted" in out


def test_creases_are_kept_and_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, output = tmp_path / "sheet.obj", tmp_path / "out" / "quads.obj"
    save_mesh(path, *folded_sheet())
    assert main(["mesh", str(path), "-o", str(output), "--quads", "60"]) == 0
    report = report_in(output.parent)
    assert report["measures"]["crease_edges"] > 3
    assert "edges along creases" in capsys.readouterr().out
    with Image.open(output.with_suffix(".mesh.png")) as picture:
        assert len(picture.convert("RGB").getcolors(1 << 24)) > 20


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "one of --quads N and --triangles N"),
        (["--quads", "10", "--triangles", "10"], "one of --quads N and --triangles N"),
        (["--triangles", "10", "--planar"], "triangles are planar"),
        (["--quads", "0"], "'0'"),
        (["--quads", "10", "--noise", "some"], "--noise"),
        (["--quads", "10", "--corner-angle", "200"], "--corner-angle"),
        (["--quads", "10", "--merging", "-1"], "merging"),
    ],
)
def test_wrong_requests_are_one_line(
    words: list[str], message: str, surface: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["mesh", str(surface), "-o", str(tmp_path / "out" / "x.obj"), *words]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert message in error
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_nothing_is_written_where_there_is_no_mesh(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mesh = irregular_triangles(SADDLE, 300)
    shift = torch.randn(mesh.vertices.shape, generator=torch.Generator().manual_seed(0))
    path = tmp_path / "noise.obj"
    save_mesh(path, mesh.vertices + 0.2 * shift, mesh.topology)
    words = ["--quads", "60", "--no-fallback", "--noise", "2"]
    assert main(["mesh", str(path), "-o", str(tmp_path / "x.obj"), *words]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "no valid mesh was found near vertex" in error
    assert not (tmp_path / "x.obj").exists()


def test_every_setting_is_an_option() -> None:
    found, fields = options(), fields_of(MeshingSettings)
    assert found.names.keys() == fields.keys()
    assert not found.hidden
    parser = CommandParser(prog="x")
    found.add_to(parser)
    assert found.settings(parser.parse_args([])) == MeshingSettings()
    given = found.settings(parser.parse_args(["--noise", "3", "--smoothing", "0.5", "--boundary-angle", "9"]))
    assert given == MeshingSettings(noise=3, smoothing=0.5, boundary_angle=math.radians(9))


def table() -> str:
    """What the page of the command line says of the settings."""
    lines = ["| option | field | default |", "|---|---|---|"]
    for name, option in options().names.items():
        field = fields_of(MeshingSettings)[name]
        shown, symbol = field.show(field.default), field.symbol.replace("|", r"\|")
        unit = {"": "", "radians": " degrees"}.get(field.unit, f" {field.unit}")
        words = f"`--{option}`, `--no-{option}`" if field.is_switch else f"`--{option} {symbol}`"
        lines.append(f"| {words} | `{name}` | {shown}{unit} |")
    return "\n".join(lines)


def test_the_page_of_the_command_line_has_every_option() -> None:
    section = PAGE.read_text().partition("## torchfair mesh\n")[2].partition("\n## ")[0]
    assert table() in section, f"the table of settings should be\n{table()}"
    parser = CommandParser(prog="x", fill=fill)
    parser.parse_known_args(["x.obj", "-o", "y.obj"])
    for action in parser._actions[1:]:
        for option in action.option_strings:
            assert f"`{option}" in section, option


if __name__ == "__main__":
    print(table())
