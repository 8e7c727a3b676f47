"""Meshes and session files that are opened; what could be repaired is asked, never done silently."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import torch

from ..._reading_words import options_of
from ...errors import MeshError, TorchfairError
from ...io import PolygonMesh, edge_labels_path, load_edge_labels, load_mesh
from ...shapes import builtin_mesh
from ..document import Document, Ints
from ..limits import MOST_VERTICES
from ..questions import CELLS, REPAIRS, answers
from ..session_file import KEPT, SUFFIX, read_session
from .recipes import faces_of
from .requests import Open
from .saying import Asked, Event, Made
from .stored_history import check_histories

_SAMPLED = ", or sample them"  # how messages go on where there are surfaces


def opened(request: Open) -> Event:
    """What comes of a request: a mesh, a history, or a question.

    Raises:
        TorchfairError: it cannot be read, with the reason.
    """
    if request.name.startswith("example:"):
        return Made(request.serial, (_example(request.name),))
    if request.data is None:
        return _of_file(request, Path(request.name), request.title or Path(request.name).name)
    suffix = Path(request.name).suffix.lower()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"uploaded{suffix}"
        path.write_bytes(request.data)
        try:
            return _of_file(request, path, Path(request.name).name)
        except TorchfairError as error:
            raise MeshError(str(error).replace(os.fspath(path), Path(request.name).name)) from None


def _example(name: str) -> Document:
    return document_of(PolygonMesh(*builtin_mesh(name.removeprefix("example:"))), name)


def _of_file(request: Open, path: Path, title: str) -> Event:
    if path.suffix.lower() == SUFFIX:
        stored, kept = read_session(path), path.name.endswith(KEPT)
        check_histories(path, stored.documents)
        return Made(request.serial, stored.documents, stored.now, camera=stored.camera, is_session=not kept)
    try:
        mesh = load_mesh(path, **options_of(request.repair))
    except TorchfairError as error:
        question = _question(path, str(error), request)
        if question is None:
            raise
        return question
    if not request.asked and _has_seams(mesh):
        return Asked(request.serial, _seams(mesh), answers("weld", as_it_is=True))
    notes = (*mesh.repairs, *mesh.notes)
    return Made(request.serial, (document_of(mesh, title, path, request.repair),), notes=notes)


def _question(path: Path, fault: str, request: Open) -> Asked | None:
    """Whether to repair, where that mends the fault; and how to sample surfaces, where there is nothing else.

    Raises:
        TorchfairError: surfaces cannot be sampled, with the reason.
    """
    if request.asked:
        return None
    words = fault.replace(os.fspath(path), Path(request.name).name)
    if _SAMPLED in fault:
        sampled = load_mesh(path, surfaces=CELLS[0])  # says what is trimmed
        weld = "_weld" * _has_seams(sampled)
        return Asked(request.serial, words.split(_SAMPLED)[0], answers(*(f"surfaces_{n}{weld}" for n in CELLS)))
    for value in ("repair", "split_edges"):
        try:
            mended = load_mesh(path, **options_of(REPAIRS[value][0]))
        except TorchfairError:
            continue
        words = words.split(" repair=True")[0].split(" split_edges=True")[0]
        choices = [value, "repair_and_weld"] if value == "repair" and _has_seams(mended) else [value]
        return Asked(request.serial, words, answers(*choices))
    return None


def _has_seams(mesh: PolygonMesh) -> bool:
    return any("weld=True" in note for note in mesh.notes)


def _seams(mesh: PolygonMesh) -> str:
    notes = [note.split(" weld=True")[0] for note in mesh.notes if "weld=True" in note]
    return " ".join(notes)


def document_of(mesh: PolygonMesh, title: str, path: Path | None = None, repair: tuple[str, ...] = ()) -> Document:
    """A mesh that was read, with marks of edges if it has any.

    Raises:
        MeshError: the mesh is too large.
    """
    topology = mesh.topology
    if topology.num_vertices > MOST_VERTICES:
        raise MeshError(f"the mesh has {topology.num_vertices} vertices, at most {MOST_VERTICES} can be designed with")
    vertices = mesh.vertices.to(torch.float64).numpy().copy()
    marks = None if path is None else _marks(mesh, path)
    first: dict[str, Any] = {"do": "open", "source": title, "repair": list(repair)}
    return Document(
        title=Path(title.removeprefix("example:")).stem if path is not None else title.removeprefix("example:"),
        mode="fair",
        faces=faces_of(topology),
        start=vertices,
        vertices=vertices,
        principal=marks,
        names=_names(mesh),
        history=(first,),
        attributes=mesh.attributes,
    )


def _names(mesh: PolygonMesh) -> Ints | None:
    """(V,) number of each vertex in the file; None where they are the same."""
    names = mesh.names
    if names.vertices is None and names.first == 0:
        return None
    rows = np.arange(mesh.topology.num_vertices) if names.vertices is None else np.asarray(names.vertices)
    return rows.astype(np.int64) + names.first


def _marks(mesh: PolygonMesh, path: Path) -> np.ndarray | None:
    """Principal edges that a file marks; None without, or for meshes that cannot have any."""
    marks = edge_labels_path(path)
    if not mesh.topology.is_triangular or not marks.exists():
        return None
    try:
        labels = load_edge_labels(marks, mesh.topology, vertex_map=mesh.vertex_map)
    except TorchfairError:
        return None
    return labels.numpy().copy() if bool(labels.any()) else None
