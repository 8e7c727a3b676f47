"""Quad meshes as input of ``torchfair symmetric``: cut by diagonals that lean to one side and the other in turn."""

from __future__ import annotations

import argparse
from collections.abc import Collection
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from .chosen_vertices import ChosenVertices
from .edge_marks import marks_file
from .errors import CommandError
from .symmetric_inputs import seed_edge

if TYPE_CHECKING:
    from torch import Tensor

    from ..principal import PrincipalEdges

_EVENNESS = 3.0


def read_quads(arguments: argparse.Namespace, chosen: ChosenVertices) -> tuple[PrincipalEdges, Tensor, list[str]]:
    """Principal edges, positions (V, 3) to start from, and what was decided, in words."""
    from ..principal import half_shifted, triangles_from_quads

    mesh = chosen.mesh
    seed, note = _seed(arguments, chosen)
    edges = triangles_from_quads(mesh.vertices, mesh.topology, seed)
    cut = f"{mesh.topology.num_faces} quads are cut by diagonals in alternating rows, which start half an edge apart"
    return edges, half_shifted(mesh.vertices, mesh.topology, edges), [cut, note]


def even_settings(asked: Collection[str], settings: Any) -> Any:
    """Settings that keep stars of cut quads even, unless evenness is among the fields that were ``asked`` for."""
    return settings if "evenness_weight" in asked else replace(settings, evenness_weight=_EVENNESS)


def _seed(arguments: argparse.Namespace, chosen: ChosenVertices) -> tuple[int | None, str]:
    """A principal edge, if one is named or marked, and what was decided, in words."""
    from .._graph import edge_numbers
    from ..io import load_edge_labels
    from ..principal import triangles_from_quads

    if arguments.seed is not None:
        return seed_edge(arguments.seed, chosen), "principal edges are those in line with the seed"
    mesh = chosen.mesh
    file = marks_file(arguments)
    if file is None:
        return None, "principal edges are the family of edges that bends less out of the surface"
    marked = load_edge_labels(file, mesh.topology, vertex_map=mesh.vertex_map)
    numbers = marked.nonzero().squeeze(1)
    if not numbers.numel():
        raise CommandError(f"--labels: {file} marks no edge")
    seed = int(numbers[0])
    family = triangles_from_quads(mesh.vertices, mesh.topology, seed)
    pairs = mesh.topology.edges[marked]
    strange = pairs[~family.mask[edge_numbers(family.topology, pairs)]].tolist()
    if strange:
        both = mesh.topology.edges[seed].tolist(), strange[0]
        one, other = (" - ".join(map(mesh.names.vertex, ends)) for ends in both)
        raise CommandError(
            f"--labels: {file} marks edges of both families of the quads, such as {one} and {other}: mark one of them, "
            "or give --seed"
        )
    return seed, f"principal edges are those marked in {file} and in line with them"
