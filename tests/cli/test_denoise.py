"""``torchfair denoise`` from files to files."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch
from helpers import report_in

from torchfair.cli import main
from torchfair.formfinding import denoise
from torchfair.io import load_mesh, save_mesh
from torchfair.shapes import Sphere, irregular_triangles


@pytest.fixture
def scan(tmp_path: Path) -> Path:
    """A sphere with noise of three tenths of a mean edge."""
    mesh = irregular_triangles(Sphere(10.0), 400)
    ends = mesh.vertices[mesh.topology.edges]
    edge = float((ends[:, 0] - ends[:, 1]).norm(dim=1).mean())
    noise = torch.randn(mesh.vertices.shape, dtype=torch.float64, generator=torch.Generator().manual_seed(1))
    path = tmp_path / "scan.obj"
    save_mesh(path, mesh.vertices + 0.3 * edge / 3**0.5 * noise, mesh.topology)
    return path


def test_a_scan_is_cleaned_and_reported(scan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / "clean.obj"
    assert main(["denoise", str(scan), "-o", str(output), "--no-pictures"]) == 0
    report = report_in(tmp_path)
    noisy, clean = load_mesh(scan), load_mesh(output)
    assert torch.equal(clean.vertices, denoise(noisy.vertices, noisy.topology).vertices)
    radii = [(mesh.vertices.norm(dim=1) - 10.0).abs().mean() for mesh in (noisy, clean)]
    assert radii[1] < 0.6 * radii[0]
    measures = report["levels"][-1]["after"]
    assert {
        "noise",
        "volume",
        "largest_displacement",
        "flipped_faces",
        "rms_displacement_over_noise",
    } <= measures.keys()
    assert report["seconds"] > 0.0
    out = capsys.readouterr().out
    assert "noise estimated" in out
    assert "faces flipped" in out


def test_the_noise_is_given_in_the_unit_of_the_file(scan: Path, tmp_path: Path) -> None:
    outputs = [tmp_path / f"{name}.obj" for name in ("little", "much")]
    for output, noise in zip(outputs, ("0.001", "0.5"), strict=True):
        words = ["--noise", noise, "--no-pictures", "--results", str(tmp_path / output.stem)]
        assert main(["denoise", str(scan), "-o", str(output), *words]) in (0, 1)
    noisy, little, much = (load_mesh(path).vertices for path in (scan, *outputs))
    assert float((little - noisy).norm(dim=1).mean()) < 0.1 * float((much - noisy).norm(dim=1).mean())


def test_wrong_noise_is_one_line(scan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["denoise", str(scan), "-o", str(tmp_path / "x.obj"), "--noise", "some"]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "--noise" in error
