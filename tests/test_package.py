"""Importing torchfair costs nothing, and its parts little more than importing torch; all names are there even so."""

from __future__ import annotations

import ast
import importlib
import inspect
import json
import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

import torchfair

HEAVY = {
    *("trimesh", "kornia", "kornia_rs", "networkx", "PIL", "rslab"),
    *("matplotlib", "rich", "polyscope", "viser", "pyvista", "vtk", "plotly"),
    *("scipy.spatial", "scipy.optimize", "scipy.sparse.csgraph", "scipy.io"),
}


def modules_after(statement: str) -> set[str]:
    code = f"{statement}\nimport json, sys\nprint(json.dumps(sorted(sys.modules)))"
    output = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(json.loads(output.stdout))


PARTS = sorted(path.stem for path in Path(torchfair.__file__).parent.glob("[a-z]*") if path.suffix in ("", ".py"))


def test_heavy_libraries_are_imported_only_where_used() -> None:
    brought_along = modules_after("import torchfair; torchfair.load_mesh") - modules_after("import torch, numpy")
    assert "torchfair.topology" in brought_along  # or nothing was measured
    assert sorted(HEAVY & brought_along) == []


def test_neither_torch_nor_numpy_is_imported_before_there_is_work() -> None:
    """Help, version and typing errors; settings are told without the jobs that they are for."""
    words = (
        [["--help"], ["--version"], ["sing"], ["measure", "--loud"], ["measure", "--help"], ["fair", "roof.obj"]]
        + [[job, "--help"] for job in ("fair", "form", "symmetric", "denoise", "mesh", "subdivide", "reflect")]
        + [["fair", "roof.obj", "-o", "x.obj", "--smoothing", "soft"], ["fair", "roof.obj", "-o", "x.txt"]]
        + [["fair", "roof.obj", "-o", "x.obj", "--smallest-area", "2"], ["fair", "a/x.obj", "b/x.obj", "-o", "out"]]
    )
    lines = "; ".join(f"main({line})" for line in words)
    code = (
        "import contextlib, io, sys\n"
        "with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as err:\n"
        f"    from torchfair.cli import main; {lines}\n"
        "assert out.getvalue().count('usage: ') == 9, out.getvalue()\n"
        "assert err.getvalue().count('error: ') == 7, err.getvalue()"
    )
    modules = modules_after(code)
    assert "torchfair.settings.fair_settings" in modules  # or no options were made
    assert sorted({"torch", "numpy", "scipy"} & modules) == []


def test_all_names_are_there_for_people_and_type_checkers() -> None:
    tree = ast.parse(Path(torchfair.__file__).read_text(encoding="utf-8"))
    told = {
        alias.asname
        for block in tree.body
        if isinstance(block, ast.If)
        for statement in block.body
        if isinstance(statement, ast.ImportFrom)
        for alias in statement.names
    }
    lazy = set(torchfair._HOME) | set(torchfair._PARTS)
    assert told == lazy
    assert lazy <= set(dir(torchfair))
    assert {name for name in PARTS if name != "cli"} == set(torchfair._PARTS)
    for name in torchfair._HOME:
        assert getattr(torchfair, name).__name__ == name
        assert getattr(torchfair, name) is torchfair.__dict__[name]  # looked for once
    with pytest.raises(AttributeError, match="'torchfair' has no attribute 'Topologie'"):
        _ = torchfair.Topologie


def test_the_page_of_a_design_does_not_wait_for_torch_and_nothing_for_its_compiler() -> None:
    """The server computes nothing; and no decorator loads what only torch.compile needs, a second long."""
    pytest.importorskip("websockets")
    assert sorted({"torch", "scipy"} & modules_after("import torchfair.design.server")) == []
    loaded = modules_after("import torchfair.design.engine.worker")
    assert sorted({"torch._dynamo", "torchfair.meshing", "scipy.optimize", "scipy.spatial"} & loaded) == []
    shapes = (
        "from torchfair.shapes import EXAMPLES, SURFACES, builtin_mesh; [*map(builtin_mesh, [*EXAMPLES, *SURFACES])]"
    )
    assert "torch._dynamo" not in modules_after(shapes)
    measured = (
        "from torchfair.shapes import ClosestOnSurface, Torus, irregular_triangles as made; from torchfair.measuring "
        "import measure_stationarity; mesh = made(Torus(), 60); "
        "measure_stationarity(mesh.vertices, mesh.topology, ClosestOnSurface(mesh.surface))"
    )
    assert "torch._dynamo" not in modules_after(measured)


def test_star_and_parts_need_no_import_of_their_own() -> None:
    assert "torchfair.meshing" in modules_after("import torchfair; torchfair.meshing.principal_quads")
    assert "torch" in modules_after("from torchfair import *; Topology, load_mesh, NormalVariation")


def test_reading_and_writing_own_formats_does_not_import_trimesh() -> None:
    statement = "import torchfair.io, torchfair.io.others, torchfair.repair, torchfair.polylines"
    assert sorted({"trimesh", "scipy.sparse.csgraph"} & modules_after(statement)) == []


def test_version_and_date_are_the_same_everywhere() -> None:
    root = Path(__file__).resolve().parent.parent
    changes = (root / "CHANGELOG.md").read_text(encoding="utf-8")
    released = re.findall(r"^## (\d+\.\d+\.\d+) \((\d{4}-\d\d-\d\d)\)$", changes, re.M)
    citation = (root / "CITATION.cff").read_text(encoding="utf-8")
    assert released[0][0] == torchfair.__version__
    assert re.findall(r"^version: (.*)\ndate-released: (.*)$", citation, re.M) == released[:1]
    newest = changes.split("\n## ")[2 if "## Unreleased" in changes else 1]
    assert re.findall(r"^### (.*)$", newest, re.M) == ["Changed behaviour", "Added", "Faster", "Fixed"]
    assert "**Changed behaviour" not in changes  # it has a section, which those look for who update


def test_an_index_page_shows_the_readme_without_links_that_lead_nowhere(monkeypatch: pytest.MonkeyPatch) -> None:
    root = Path(__file__).resolve().parent.parent
    monkeypatch.syspath_prepend(str(root))
    readme_of_packages = importlib.import_module("hatch_build").readme_of_packages
    text = (root / "README.md").read_text(encoding="utf-8")
    links = set(re.findall(r"\]\(([^)]*)\)", text))
    inside = {link for link in links if link.startswith("#")}
    assert len(links - inside) > 10
    assert set(re.findall(r"\]\(([^)]*)\)", readme_of_packages(text, ""))) == inside
    elsewhere = set(re.findall(r"\]\(([^)]*)\)", readme_of_packages(text, "https://example.org/v1/")))
    assert elsewhere == inside | {f"https://example.org/v1/{link}" for link in links - inside}
    assert all((root / link).exists() for link in links - inside)


def test_errors() -> None:
    for error in (torchfair.MeshError, torchfair.ShapeError, torchfair.MeshFileError):
        assert issubclass(error, torchfair.TorchfairError)
        assert issubclass(error, ValueError)


def test_the_script_that_is_type_checked_runs() -> None:
    runpy.run_path(str(Path(__file__).with_name("a_users_script.py")), run_name="__main__")


def test_modules_tell_their_arguments() -> None:
    """Their metaclass, which takes any, is not what is shown."""
    told = inspect.signature(torchfair.NormalVariation)
    assert list(told.parameters) == ["topology", "edge_weights", "reduction"]
