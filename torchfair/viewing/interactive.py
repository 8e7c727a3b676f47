"""An interactive window, by the optional package polyscope (``pip install torchfair[view]``)."""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping
from typing import Any

from torch import Tensor

from .._one_mesh import one_mesh
from ..energies import normal_variation_per_edge
from ..errors import TorchfairError
from ..topology import Topology


def register_meshes(meshes: Mapping[str, Tensor], topology: Topology) -> Any:
    """Puts meshes of one topology into polyscope's scene, interior edges coloured by ``l l*``.

    Call ``polyscope.init`` before and ``polyscope.show`` after it; :func:`show_meshes` does all three.

    Args:
        meshes: (V, 3) vertices by name.
        topology: their connectivity.

    Returns:
        The module ``polyscope``.

    Raises:
        TorchfairError: polyscope is not installed.
        ShapeError: vertices are not (V, 3).
    """
    if importlib.util.find_spec("polyscope") is None:
        raise TorchfairError("the interactive window needs polyscope: pip install 'torchfair[view]'")
    import polyscope

    faces = topology.face_lists()
    edges = topology.interior_edges.cpu().numpy()
    for name, vertices in meshes.items():
        points = one_mesh(vertices, topology)
        terms = normal_variation_per_edge(points, topology).cpu().numpy()
        polyscope.register_surface_mesh(name, points.cpu().numpy(), faces)
        network = polyscope.register_curve_network(f"{name}: edges", points.cpu().numpy(), edges)
        network.add_scalar_quantity("l l*", terms, defined_on="edges", enabled=True, cmap="magma")
    return polyscope


def show_meshes(meshes: Mapping[str, Tensor], topology: Topology) -> None:
    """Opens a window with ``meshes`` and blocks until it is closed; needs a display. See :func:`register_meshes`."""
    if importlib.util.find_spec("polyscope") is not None:
        import polyscope

        polyscope.set_use_prefs_file(False)  # leaves no file behind
        polyscope.init()
    register_meshes(meshes, topology).show()
