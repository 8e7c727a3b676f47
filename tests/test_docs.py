"""Python examples in the README and the docs run as they stand; shell lines of the README name real options."""

from __future__ import annotations

import importlib
import json
import re
import shlex
from pathlib import Path
from typing import Any

import pytest
import torch

from torchfair.cli.command import build_parser
from torchfair.energies import normal_variation
from torchfair.shapes import hybrid_roof

ROOT = Path(__file__).resolve().parent.parent
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
EXAMPLES = [
    pytest.param(packages, code, id=f"{page.name}-{number}")
    for page in PAGES
    for number, (packages, code) in enumerate(
        re.findall(r"^```python(?: \{requires=(.*?)\})?\n(.*?)^```", page.read_text(), re.S | re.M)
    )
]
COMMANDS = [
    pytest.param(line, id=f"{page.name}: {line}"[:60])
    for page in PAGES
    for block in re.findall(r"^```sh\n(.*?)^```", page.read_text(), re.S | re.M)
    for line in re.findall(r"(?:\.venv/bin/)?(torchfair [^#\n&|]+)", block)
]


def run(packages: str, code: str) -> dict[str, Any]:
    """What an example defines; skipped where one of the packages it is about is not installed."""
    for package in filter(None, packages.split(",")):
        pytest.importorskip(package)
    names: dict[str, Any] = {"__name__": "example"}
    exec(compile(code, "example", "exec", dont_inherit=True), names)
    return names


@pytest.mark.parametrize(("packages", "code"), EXAMPLES)
def test_python_example_runs(packages: str, code: str) -> None:
    run(packages, code)


def test_the_component_for_grasshopper_answers_without_rhino() -> None:
    rhino3dm = pytest.importorskip("rhino3dm")
    packages, code = next(example.values for example in EXAMPLES if "hops.component" in example.values[1])
    vertices, topology = hybrid_roof()
    mesh = rhino3dm.Mesh()
    for place in vertices.tolist():
        mesh.Vertices.Add(*place)
    for face in topology.face_lists():
        mesh.Faces.AddFace(*face)
    item = {"type": "Rhino.Geometry.Mesh", "data": json.dumps(mesh.Encode())}
    values = [{"ParamName": "Mesh", "InnerTree": {"{0}": [item]}}]
    fine, answer = run(packages, code)["hops"].solve("/solve", json.dumps({"pointer": "/fair", "values": values}))
    assert fine, answer
    told = json.loads(json.loads(answer)["values"][0]["InnerTree"]["0"][0]["data"])
    smoother = rhino3dm.CommonObject.Decode(told)
    assert smoother.Faces.Count == topology.num_faces
    moved = torch.tensor([(place.X, place.Y, place.Z) for place in smoother.Vertices.ToPoint3dArray()]).double()
    assert normal_variation(moved, topology) < 0.85 * normal_variation(vertices, topology)


@pytest.mark.parametrize("line", COMMANDS)
def test_command_line_is_understood(line: str) -> None:
    arguments = build_parser().parse_args(shlex.split(line)[1:])
    assert callable(arguments.run)


@pytest.mark.parametrize("path", sorted((ROOT / "experiments").glob("[!_]*.py")), ids=lambda path: path.stem)
def test_the_changelog_and_the_index_of_experiments_name_every_experiment(path: Path) -> None:
    for page in (ROOT / "CHANGELOG.md", ROOT / "experiments" / "README.md"):
        assert re.search(rf"\b{path.stem}\b", page.read_text()), f"{page.name} does not name {path.stem}"


def test_the_gallery_has_every_experiment_with_claim_result_and_command(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    gallery = importlib.import_module("gallery")
    scripts = {path.stem for path in (ROOT / "experiments").glob("[!_]*.py")}
    assert {entry.name for entry in gallery.entries()} == scripts
    assert all(len(entry.claim) > 20 and len(entry.result) > 20 for entry in gallery.entries())
    pictures = {path.stem for path in gallery.IMAGES.glob("*.png")}
    assert pictures <= set(gallery.PICTURES) <= scripts
    assert gallery.page().count("![") == len(pictures) >= 10
    assert sum(path.stat().st_size for path in gallery.IMAGES.glob("*.png")) < 2_000_000


def test_there_are_examples() -> None:
    assert len(EXAMPLES) >= 3
    assert len(COMMANDS) >= 5
