from __future__ import annotations

import importlib.util

import pytest
from helpers import wavy_grid

from torchfair import TorchfairError
from torchfair.viewing.interactive import register_meshes


@pytest.mark.skipif(importlib.util.find_spec("polyscope") is None, reason="polyscope is optional")
def test_meshes_and_their_edges_are_registered() -> None:
    import polyscope

    polyscope.set_use_prefs_file(False)
    polyscope.init("openGL_mock")
    vertices, topology = wavy_grid()
    register_meshes({"before": vertices, "after": 2 * vertices}, topology)
    for name in ("before", "after"):
        assert polyscope.get_surface_mesh(name).n_faces() == topology.num_faces
        assert polyscope.get_surface_mesh(name).n_vertices() == topology.num_vertices
        assert polyscope.get_curve_network(f"{name}: edges").n_edges() == topology.num_interior_edges


def test_missing_package_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    vertices, topology = wavy_grid()
    with pytest.raises(TorchfairError, match=r"torchfair\[view\]"):
        register_meshes({"mesh": vertices}, topology)
