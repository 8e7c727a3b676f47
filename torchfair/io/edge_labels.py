"""Marked edges in files: the line elements of an OBJ file, or a small JSON file beside a mesh of any format."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from .._atomic import atomic_write_text
from .._graph import edge_numbers
from ..errors import MeshFileError, ShapeError
from ..topology import Topology
from .obj import obj_words, statement_rows, vertex_numbers
from .raw_mesh import Ints
from .reading import read_bytes

_FORMAT = "torchfair edges"


def edge_labels_path(mesh_path: str | os.PathLike[str]) -> Path:
    """Where the marked edges of a mesh file stand: in an OBJ file itself, else in ``NAME.edges.json`` beside it."""
    path = Path(mesh_path)
    return path if path.suffix.lower() == ".obj" else path.with_suffix(".edges.json")


def save_edge_labels(
    path: str | os.PathLike[str], topology: Topology, labels: Tensor, *, overwrite: bool = False
) -> None:
    """Writes marked edges to a JSON file, as pairs of vertex numbers from zero; the file appears whole or not at all.

    For OBJ files there are line elements instead, see ``polylines`` of :func:`save_mesh`.

    Args:
        path: the file, with the extension .json.
        topology: the mesh.
        labels: (E,) bool.
        overwrite: whether an existing file may be replaced.

    Raises:
        ShapeError: if ``labels`` is not a bool tensor (E,).
        MeshFileError: if the extension is another one or the file cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() != ".json":
        raise MeshFileError(path, "edge labels are written to .json files. In OBJ files polylines hold them")
    if labels.shape != (topology.num_edges,) or labels.dtype != torch.bool:
        raise ShapeError("labels", f"a bool tensor ({topology.num_edges},)", f"{tuple(labels.shape)} {labels.dtype}")
    pairs = ",\n".join(f"[{v}, {w}]" for v, w in topology.edges[labels].tolist())
    head = f'{{"format": "{_FORMAT}", "version": 1, "num_vertices": {topology.num_vertices}, "edges": ['
    atomic_write_text(path, f"{head}\n{pairs}\n]}}\n", overwrite=overwrite)


def load_edge_labels(path: str | os.PathLike[str], topology: Topology, *, vertex_map: Tensor | None = None) -> Tensor:
    """Marked edges of a file.

    Args:
        path: an OBJ file, whose line elements (``l``) run along the edges; or a file of :func:`save_edge_labels`.
        topology: the mesh.
        vertex_map: number in it of each vertex of the file, from ``PolygonMesh.vertex_map``, where it was welded or
            repaired; marks of edges that this took away are left out.

    Returns:
        (E,) bool.

    Raises:
        MeshFileError: if the file cannot be read, has another extension, does not mark any edges (OBJ), was made for
            another number of vertices, or marks what is no edge of the mesh; with the line number in OBJ files.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in (".obj", ".json"):
        remedy = f"Those of this mesh belong into {edge_labels_path(path).name}"
        raise MeshFileError(path, f"edge labels are read from .obj and .json files. {remedy}")
    data = read_bytes(path)
    num_vertices, pairs, lines = _obj_lines(path, data) if suffix == ".obj" else _json_pairs(path, data)
    expected = topology.num_vertices if vertex_map is None else len(vertex_map)
    if num_vertices != expected:
        raise MeshFileError(
            path,
            f"its vertices are {num_vertices}, those of the mesh {expected}. "
            "Edge labels need the mesh with the vertex numbers of the file, or vertex_map where it was repaired",
        )
    first = 1 if suffix == ".obj" else 0
    outside = np.flatnonzero(((pairs < 0) | (pairs >= num_vertices)).any(1))
    if outside.size:
        v, w = (pairs[outside[0]] + first).tolist()
        fault = f"marks the edge ({v}, {w}), but the vertices are numbered {first}..{num_vertices - 1 + first}"
        raise MeshFileError(path, fault, _line(lines, outside[0]))
    ends = torch.from_numpy(pairs).to(topology.device)
    if vertex_map is not None:
        ends = vertex_map.to(topology.device)[ends]
    numbers = edge_numbers(topology, ends)
    if vertex_map is not None:
        numbers = numbers[numbers >= 0]
    missing = torch.nonzero(numbers < 0).squeeze(1).tolist()
    if missing:
        v, w = (pairs[missing[0]] + first).tolist()
        fault = f"vertices {v} and {w} are not joined by an edge of the mesh, so they cannot be marked as one"
        raise MeshFileError(path, fault, _line(lines, missing[0]))
    labels = torch.zeros(topology.num_edges, dtype=torch.bool, device=topology.device)
    labels[numbers] = True
    return labels


def _line(lines: Ints | None, row: int) -> int | None:
    return None if lines is None else int(lines[row])


def _obj_lines(path: Path, data: bytes) -> tuple[int, Ints, Ints]:
    """Number of vertices, steps (n, 2) of the line elements, and where in the file each step stands."""
    text = obj_words(path, data)
    vertex_rows, rows = statement_rows(path, text, (b"v",), (b"l",))
    if not rows.size:
        raise MeshFileError(path, "marks no edges: there are no line elements such as l 1 2 3")
    corners, sizes = vertex_numbers(
        path, text, vertex_rows, rows, slashes=b"/" in data, what="a point of a line element"
    )
    short = np.flatnonzero(sizes < 2)
    if short.size:
        raise MeshFileError(path, "a line element needs two or more vertices", int(text.lines[rows[short[0]]]))
    last = np.zeros(len(corners), np.bool_)
    last[np.cumsum(sizes) - 1] = True
    begin = np.flatnonzero(~last)
    return len(vertex_rows), np.stack([corners[begin], corners[begin + 1]], 1), np.repeat(text.lines[rows], sizes - 1)


def _json_pairs(path: Path, data: bytes) -> tuple[int, Ints, None]:
    """Number of vertices and marked edges (n, 2)."""
    try:
        content = json.loads(data)
    except (ValueError, RecursionError) as error:
        raise MeshFileError(path, f"is no JSON file ({error})") from None
    if not isinstance(content, dict) or content.get("format") != _FORMAT or content.get("version") != 1:
        raise MeshFileError(path, f'is no file of edge labels: "format": "{_FORMAT}" and "version": 1 are missing')
    count, edges = content.get("num_vertices"), content.get("edges")
    if type(count) is not int or not isinstance(edges, list) or not all(map(_is_pair, edges)):
        raise MeshFileError(path, '"num_vertices" must be a whole number and "edges" a list of pairs of vertex numbers')
    return count, np.array(edges, np.int64).reshape(-1, 2), None


def _is_pair(item: object) -> bool:
    return isinstance(item, list) and len(item) == 2 and all(type(v) is int and abs(v) < 2**62 for v in item)
