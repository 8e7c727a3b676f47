"""Other meshes from a mesh: refined, meshed along principal directions, with other principal edges."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import torch
from torch import Tensor

from ...errors import MeshError
from ...io.written_back import of_other_faces
from ...principal import PrincipalEdges, misalignment_of
from ...topology import Topology
from ..command_line import job_step
from ..document import Document
from ..limits import MOST_VERTICES
from .recipes import faces_of, principal_of, session_of, tensor_of, topology_of


def remade(document: Document, how: str, options: Mapping[str, Any]) -> tuple[Document, list[str]]:
    """Another document, and what is to be said of it.

    Raises:
        TorchfairError: it cannot be done, with the reason.
    """
    made: tuple[Document, list[str]] = _WAYS[how](document, options)
    return made


def _subdivided(document: Document, options: Mapping[str, Any]) -> tuple[Document, list[str]]:
    if 4 * document.count > MOST_VERTICES:
        raise MeshError(f"the finer mesh would have about {4 * document.count} vertices, at most {MOST_VERTICES}")
    recipe = session_of(document).refined().recipe
    held = torch.nonzero(recipe.pulls.held).squeeze(1).tolist()
    principal = getattr(recipe, "principal", None)
    if principal is None:
        principal = _carried(document)
    finer = replace(
        _of_mesh(document, recipe.given, recipe.topology, principal),
        coarse=document,
        handles={vertex: (x, y, z) for vertex, (x, y, z) in recipe.handles.items()},
        held=tuple(held),
        names=None if document.names is None else _kept_names(document.names, recipe.topology.num_vertices),
        words="subdivide",
    )
    return finer, [f"{document.count} vertices became {finer.count}"]


def _of_mesh(document: Document, vertices: Tensor, topology: Topology, principal: PrincipalEdges | None) -> Document:
    """The document with another mesh, whose vertices have not moved yet."""
    places = vertices.numpy().copy()
    mask = None if principal is None else principal.mask.numpy().copy()
    left = of_other_faces(document.attributes, topology.num_faces)
    return replace(document, faces=faces_of(topology), start=places, vertices=places, principal=mask, attributes=left)


def _carried(document: Document) -> PrincipalEdges | None:
    """Marked edges of the finer mesh, in jobs that know nothing of them."""
    from ...subdivision import hybrid

    topology = topology_of(document)
    if document.principal is None or not topology.is_triangular:
        return None
    marked = PrincipalEdges(topology, tensor_of(document.principal))
    return marked.refine(hybrid(topology))


def _kept_names(names: np.ndarray, count: int) -> np.ndarray:
    result = np.full(count, -1, np.int64)
    result[: len(names)] = names
    return result


def _meshed(document: Document, options: Mapping[str, Any]) -> tuple[Document, list[str]]:
    vertices, topology = tensor_of(document.vertices), topology_of(document)
    from ...meshing import principal_quads, principal_triangles  # here, because most designs begin without it

    make = principal_quads if options["kind"] == "quads" else principal_triangles
    made = make(vertices, topology, count=options["count"])
    step = {"do": "mesh", **options}
    meshed = replace(
        _of_mesh(document, made.vertices, made.topology, getattr(made, "principal", None)),
        coarse=None,
        handles={},
        held=(),
        names=None,
        history=(*document.history, *_job(document), step),
        words=f"mesh with {made.topology.num_faces} {options['kind']}",
    )
    ratio = made.report.get("variation_over_curvature")
    said = f"{made.topology.num_faces} faces along principal directions"
    return meshed, [said if ratio is None else f"{said}, E/C {ratio:.4g}", *made.notes]


def _job(document: Document) -> list[dict[str, Any]]:
    """The job that made the document what it is, for the command line; none where nothing has moved."""
    if document.coarse is None and np.array_equal(document.start, document.vertices):
        return []
    return [job_step(document)]


def _labelled(document: Document, options: Mapping[str, Any]) -> tuple[Document, list[str]]:
    topology = topology_of(document)
    if not options["edges"]:
        found = principal_of(replace(document, principal=None), topology)
        mask = found.mask.numpy().copy()
        angle = misalignment_of(tensor_of(document.vertices), found)
        said = [f"principal edges are {angle:.2f} radians off the nearer principal direction on average"]
    else:
        topology.require_triangles()
        mask = np.zeros(topology.num_edges, bool) if document.principal is None else document.principal.copy()
        wrong = [edge for edge in options["edges"] if edge >= len(mask)]
        if wrong:
            raise MeshError(f"edges are numbered 0 to {len(mask) - 1}, got {wrong[:5]}")
        mask[list(options["edges"])] = options["principal"]
        said = []
    marked = replace(document, principal=mask, words="mark principal edges")
    if document.coarse is not None:
        marked = replace(marked.in_mode(document.mode), words=marked.words)
    return marked, said


def _in_mode(document: Document, options: Mapping[str, Any]) -> tuple[Document, list[str]]:
    mode = options["mode"]
    history = (*document.history, *_job(document))
    changed = replace(document.in_mode(mode), history=history, words=f"mode {mode}")
    if mode != "symmetric" or document.principal is not None:
        return changed, []
    marked, said = _labelled(changed, {"edges": ()})
    return replace(marked, words=changed.words), said


_WAYS = {"mode": _in_mode, "subdivide": _subdivided, "mesh": _meshed, "label": _labelled}
