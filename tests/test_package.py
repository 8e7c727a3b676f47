"""Importing torchfair costs little more than importing torch."""

from __future__ import annotations

import json
import subprocess
import sys

import torchfair

HEAVY = {
    *("trimesh", "kornia", "kornia_rs", "networkx", "PIL", "rslab"),
    *("matplotlib", "rich", "polyscope", "viser", "pyvista", "vtk", "plotly"),
    *("scipy.spatial", "scipy.optimize", "scipy.sparse.csgraph"),
}


def modules_after(statement: str) -> set[str]:
    code = f"{statement}\nimport json, sys\nprint(json.dumps(sorted(sys.modules)))"
    output = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(json.loads(output.stdout))


def test_heavy_libraries_are_imported_only_where_used() -> None:
    brought_along = modules_after("import torchfair") - modules_after("import torch, numpy")
    assert "torchfair.topology" in brought_along  # or nothing was measured
    assert sorted(HEAVY & brought_along) == []


def test_reading_and_writing_own_formats_does_not_import_trimesh() -> None:
    statement = "import torchfair.io, torchfair.io.others, torchfair.repair, torchfair.polylines"
    assert sorted({"trimesh", "scipy.sparse.csgraph"} & modules_after(statement)) == []


def test_version_and_errors() -> None:
    assert torchfair.__version__.count(".") == 2
    for error in (torchfair.MeshError, torchfair.ShapeError, torchfair.MeshFileError):
        assert issubclass(error, torchfair.TorchfairError)
        assert issubclass(error, ValueError)
