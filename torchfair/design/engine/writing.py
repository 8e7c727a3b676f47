"""Meshes and strips as the bytes of files, and strips laid flat for the page."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

from ...errors import MeshError
from ...formfinding import strip_normals
from ...io import ObjAttributes, save_mesh
from ...io.written_back import written_back
from ...polylines import polylines_along
from ...principal import DevelopableStrips, developable_strips, save_strips_svg, strip_limits
from ..containers import pack
from ..document import Document
from ..formats import FORMATS
from .recipes import principal_of, tensor_of, topology_of

_HEIGHT = 0.5  # mean edges
_SHARE = 0.8  # of the height at which rulings meet


def file_bytes(document: Document, format: str) -> bytes:
    """The content of a file.

    Raises:
        TorchfairError: the format does not hold such a mesh.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"mesh{FORMATS[format][0]}"
        if format == "strips":
            save_strips_svg(path, strips_of(document), millimetres=1.0)
            return path.read_bytes()
        topology = topology_of(document)
        lines = []
        if format == "obj" and document.principal is not None:
            lines = polylines_along(topology, tensor_of(document.principal))
        kept = written_back(document.attributes, path.suffix, same_faces=True, count=topology.num_faces)
        if isinstance(kept, ObjAttributes):
            kept = replace(kept, folder=Path(folder))  # where nothing is: material files keep their names
        save_mesh(path, tensor_of(document.vertices), topology, polylines=lines, attributes=kept)
        return path.read_bytes()


def strips_of(document: Document) -> DevelopableStrips:
    """Strips along principal edges, half a mean edge high or as high as rulings allow.

    Raises:
        TorchfairError: there are none.
    """
    vertices, topology = tensor_of(document.vertices), topology_of(document)
    principal = principal_of(document, topology)
    stars = principal.stars()
    if not stars.vertices.numel():
        raise MeshError("strips run along principal edges, and this mesh has none that fit together")
    lines, normals = principal.polylines(), strip_normals(vertices, principal, stars)
    edges = topology.edges
    mean = float(torch.linalg.vector_norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], dim=1).mean())
    height = min(_HEIGHT * mean, _SHARE * strip_limits(vertices, lines, normals).height)
    if not height > 0.0:
        raise MeshError("a normal lies along a principal edge: settle the mesh in the mode symmetric first")
    return developable_strips(vertices, lines, normals, height)


def strips_message(document: Document) -> bytes:
    """The container ``strips``."""
    strips = strips_of(document)
    outlines = strips.outlines()
    ends = np.cumsum([0, *(len(outline) for outline in outlines)])
    planar, isometry = float(strips.planarity.max()), float(strips.isometry_errors.max())
    entries = [
        {"name": name, "outline": [int(first), int(last - first)]}
        for name, first, last in zip(strips.names, ends[:-1], ends[1:], strict=True)
    ]
    message = {
        "type": "strips",
        "count": len(entries),
        "planarity": planar,
        "isometry_error": isometry,
        "sheet": list(strips.sheet),
        "sentence": f"{len(entries)} strips, planar to {planar:.2g} edges, lengths true to {isometry:.2g}",
        "strips": entries,
    }
    return pack(message, {"outlines": torch.cat(outlines).numpy().astype(np.float64)})
