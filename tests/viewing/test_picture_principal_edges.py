"""Pictures of principal edges."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from torchfair import MeshFileError, ShapeError
from torchfair.principal import principal_edges_of_lattice
from torchfair.shapes import Catenoid, principal_triangles
from torchfair.viewing import picture_principal_edges


def test_principal_edges_are_red(tmp_path: Path) -> None:
    import matplotlib.image

    mesh = principal_triangles(Catenoid(), 8, 14)
    edges = principal_edges_of_lattice(mesh)
    path = tmp_path / "edges.png"
    size = picture_principal_edges(path, {"one": (mesh.vertices, edges), "two": (mesh.vertices, edges)}, width=700)
    image = matplotlib.image.imread(path)[..., :3]
    assert image.shape[:2] == (size[1], size[0])
    red = (image[..., 0] > 0.6) & (image[..., 1] < 0.35)
    share = red.mean()
    assert 0.005 < share < 0.2
    assert np.abs(red[:, :350].sum() / red[:, 350:].sum() - 1.0) < 0.1
    with pytest.raises(MeshFileError):
        picture_principal_edges(path, {"one": (mesh.vertices, edges)})
    with pytest.raises(ShapeError):
        picture_principal_edges(path, {})
