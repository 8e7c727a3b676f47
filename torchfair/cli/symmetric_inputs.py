"""What ``torchfair symmetric`` needs to know of a mesh: principal edges, fixed vertices, polylines."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from .._names import Names
from ..errors import MeshError
from .chosen_vertices import NEAR, NUMBERS, ChosenVertices, parts_of
from .edge_marks import marks_file
from .errors import CommandError
from .reading import in_numbers_of

if TYPE_CHECKING:
    from torch import Tensor

    from ..io import PolygonMesh
    from ..principal import PrincipalEdges


_FEW_EXCEPTIONS = 0.1  # share of regular vertices at which marks of INPUT may not fit together
_MOST_SLIDE = 1.4
"""Edges. Turned lattices of 10 and 20 rows on six surfaces were met up to 1.36 and mostly missed from 1.45 on."""

_OPTIONS = {
    "allow_exceptions=True": "--allow-exceptions",
    "seed_edge:": "--seed:",
    "Give a direction at one or more of its vertices": "Choose the family by one of its edges, with --seed V W",
    "go without conditions there": "go without conditions there with --allow-exceptions",
}
"""What errors of the library call options, in words of the command line."""


def add_labels(parser: argparse.ArgumentParser) -> None:
    """The options that say which edges are principal."""
    labels = parser.add_mutually_exclusive_group()
    labels.add_argument("--labels", metavar="FILE", help="OBJ or JSON file that marks the principal edges (default: "
        "INPUT if it marks any, else those along principal directions)")  # fmt: skip
    labels.add_argument("--seed", metavar="V W", help=f"an edge that is principal, by its vertices ({NUMBERS}), or "
        "'near X Y Z' for the edge there; the others follow straight on and in parallel")  # fmt: skip
    parser.add_argument(
        "--allow-exceptions", action="store_true", help="leave out vertices where principal edges do not fit together"
    )


def read_principal_edges(arguments: argparse.Namespace, chosen: ChosenVertices) -> tuple[PrincipalEdges, list[str]]:
    """Principal edges as asked for, and what was decided, in words."""
    from ..principal import misalignment_of

    try:
        with in_numbers_of(chosen.mesh, arguments.input):
            edges, origin = _chosen_edges(arguments, chosen)
    except MeshError as error:
        words = str(error)
        for argument, option in _OPTIONS.items():
            words = words.replace(argument, option)
        raise CommandError(words) from None
    return edges, [
        _alignment(origin, misalignment_of(chosen.mesh.vertices, edges)),
        *_exceptions(edges, chosen.mesh.names),
    ]


def _chosen_edges(arguments: argparse.Namespace, chosen: ChosenVertices) -> tuple[PrincipalEdges, str]:
    """Principal edges, and where they come from."""
    from ..io import load_edge_labels
    from ..principal import PrincipalEdges, principal_edges_from_directions, principal_edges_from_seed

    mesh, allow = chosen.mesh, arguments.allow_exceptions
    topology = mesh.topology
    if arguments.seed is not None:
        seed = seed_edge(arguments.seed, chosen)
        edges = principal_edges_from_seed(topology, seed, allow_exceptions=allow)
        return edges, f"principal edges are parallel to the edge {chosen.edge_name(seed)}"
    file = marks_file(arguments)
    if file is not None:
        edges = PrincipalEdges(topology, load_edge_labels(file, topology, vertex_map=mesh.vertex_map))
        own = arguments.labels is None  # marks of INPUT itself, such as those of torchfair mesh
        return (
            edges if allow or (own and _mostly_fit(edges)) else edges.check()
        ), f"principal edges are those of {file}"
    aligned = principal_edges_from_directions(mesh.vertices, topology, allow_exceptions=allow)
    return aligned.edges, "principal edges are the family that follows principal directions best"


def _mostly_fit(edges: PrincipalEdges) -> bool:
    """Whether principal edges do not fit together at a few vertices only."""
    wrong = edges.exceptions.numel()
    return wrong <= _FEW_EXCEPTIONS * (wrong + edges.stars().vertices.numel())


def _alignment(origin: str, misalignment: float) -> str:
    """Where principal edges come from, how well they follow the surface, and what to do if they do not."""
    from ..principal import LARGE_MISALIGNMENT

    words = f"{origin}, {math.degrees(misalignment):.0f} degrees off the nearer principal direction on average"
    if misalignment <= LARGE_MISALIGNMENT:
        return words
    return (
        f"{words}. WARNING: edges at random are 22 degrees off; the surface will have to bend to fit such edges. "
        "Choose another family by one of its edges, with --seed V W, or remesh by torchfair mesh --triangles N"
    )


def slide_warnings(name: str, mesh: PolygonMesh, edges: PrincipalEdges) -> list[str]:
    """What to do where principal edges are too far off for a mesh to become symmetric in its shape.

    To turn them, vertices on the rim slide by their angle times half the width of the mesh, about sqrt(V) / 2 edges.
    """
    from ..principal import misalignment_of

    angle = misalignment_of(mesh.vertices, edges)
    slide = 0.5 * angle * float(mesh.topology.num_vertices) ** 0.5
    if slide <= _MOST_SLIDE:
        return []
    return [
        f"principal edges are {math.degrees(angle):.0f} degrees off the nearer principal direction on average: to "
        f"follow it, vertices would slide by about {slide:.1f} edges, and above {_MOST_SLIDE} most surfaces bend "
        "or get less smooth. Rather lay edges anew: "
        f"torchfair mesh {name} --triangles {mesh.topology.num_faces} -o lattice.obj, "
        "then torchfair symmetric lattice.obj; or let the surface bend by --free"
    ]


def vertex_mask(chosen: Sequence[int], mesh: PolygonMesh) -> Tensor:
    """(V,) bool of chosen vertices of a mesh."""
    import torch

    mask = torch.zeros(mesh.topology.num_vertices, dtype=torch.bool)
    mask[list(chosen)] = True
    return mask


def polyline_vertices(chosen: Sequence[int], mesh: PolygonMesh, edges: PrincipalEdges) -> Tensor:
    """Vertices of the principal polylines through the chosen ones."""
    import torch

    mask = vertex_mask(chosen, mesh)
    lines = [line for line in edges.polylines() if bool(mask[line].any())]
    if not lines:
        raise CommandError(f"--on: no principal polyline passes through {', '.join(map(mesh.names.vertex, chosen))}")
    on_lines: Tensor = torch.unique(torch.cat(lines))
    return on_lines


def seed_edge(words: str, chosen: ChosenVertices) -> int:
    """Number of the edge that ``--seed`` names by its ends, or by a place near it."""
    import torch

    from .._graph import edge_numbers

    parts = list(parts_of("--seed", words, (NEAR,)))
    if [kind for kind, _ in parts] == [NEAR]:
        return chosen.edge_near("--seed", parts[0][1])
    ends = chosen.of("--seed", words)
    if len(ends) != 2:
        raise CommandError(f"--seed: expected two vertices V W, or near X Y Z, got '{words}'")
    number = int(edge_numbers(chosen.mesh.topology, torch.tensor([ends]))[0])
    if number < 0:
        v, w = map(chosen.mesh.names.vertex, ends)
        raise CommandError(f"--seed: vertices {v} and {w} are not joined by an edge")
    return number


def _exceptions(edges: PrincipalEdges, names: Names) -> list[str]:
    notes = []
    for what, vertices in (("singular", edges.singular), ("with principal edges that do not fit", edges.exceptions)):
        if vertices.numel():
            some = ", ".join(map(names.vertex, vertices[:8].tolist()))
            more = ", ..." if vertices.numel() > 8 else ""
            notes.append(f"no conditions at {vertices.numel()} vertices {what}: {some}{more}")
    return notes
