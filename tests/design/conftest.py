"""Meshes as files, and designs that have opened them."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import pytest
from design_tools import Bench

from torchfair import save_mesh
from torchfair.design.engine.requests import Open
from torchfair.principal import principal_edges_of_lattice
from torchfair.shapes import Catenoid, principal_triangles

with suppress(ImportError):
    import rslab  # noqa: F401  (its allocator takes the thread that imports it for the main one)


@pytest.fixture
def tube(tmp_path: Path) -> Path:
    """A lattice of triangles on a catenoid, with its principal edges: 84 vertices or so."""
    mesh = principal_triangles(Catenoid(1.0, (-1.0, 1.0)), 6, 12)
    path = tmp_path / "tube.obj"
    save_mesh(path, mesh.vertices, mesh.topology, polylines=principal_edges_of_lattice(mesh).polylines())
    return path


@pytest.fixture
def bench(tube: Path) -> Bench:
    """A design of the tube."""
    return Bench(tube.parent, Open(0, str(tube), None, tube.name))
