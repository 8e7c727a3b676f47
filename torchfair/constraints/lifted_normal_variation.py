"""The energy E in the paper's own variables (section 5.1): normals, lengths and their square roots are unknowns."""

from __future__ import annotations

import math
from dataclasses import replace

import torch
from torch import Tensor
from torch.linalg import cross, vector_norm

from ..geometry import dual_edge_lengths, edge_lengths, face_normals
from ..projection import ElementTerm
from ..topology import Topology
from .normal_variation import NAME, area_vector


def lifted_normal_variation_blocks(vertices: Tensor, topology: Topology) -> dict[str, Tensor]:
    """Auxiliary variables that satisfy their defining constraints at ``vertices``.

    Returns:
        ``normals`` (F, 3), and for interior edges ``lengths`` (I, 4) holding l, l*, delta, mu with
        ``l = delta^2`` and ``l* = mu^2``. With the vertices: 3V + 3F + 4I unknowns.
    """
    length = edge_lengths(vertices, topology)[: topology.num_interior_edges]
    dual = dual_edge_lengths(vertices, topology)
    return {
        "normals": face_normals(vertices, topology),
        "lengths": torch.stack([length, dual, length.sqrt(), dual.sqrt()], dim=1),
    }


def edge_length_residual(x: Tensor, s: Tensor) -> Tensor:
    """``|v - w|^2 - l^2`` and ``l - delta^2``."""
    edge = x[1] - x[0]
    return torch.stack([torch.dot(edge, edge) - s[0, 0] ** 2, s[0, 0] - s[0, 2] ** 2])


def dual_length_residual(n: Tensor, s: Tensor) -> Tensor:
    """``|n - n'|^2 - l*^2`` and ``l* - mu^2``."""
    jump = n[1] - n[0]
    return torch.stack([torch.dot(jump, jump) - s[0, 1] ** 2, s[0, 1] - s[0, 3] ** 2])


def orthogonality_residual(x: Tensor, n: Tensor) -> Tensor:
    """``n . (w - v)`` for an edge of a planar face."""
    return torch.dot(n[0], x[1] - x[0])


def parallel_residual(x: Tensor, n: Tensor, area: Tensor) -> Tensor:
    """``n x A / |A_start|`` for a face that is not planar, A its area vector."""
    turned: Tensor = cross(n[0], area_vector(x)) / area
    return turned


def unit_residual(n: Tensor) -> Tensor:
    """``|n|^2 - 1``."""
    return torch.dot(n[0], n[0]) - 1.0


def energy_residual(s: Tensor) -> Tensor:
    """``sqrt(2) delta mu``, half of whose square is ``l l*``: a sum of squares that equals E."""
    return math.sqrt(2.0) * s[0, 2] * s[0, 3]


def flat_residual(n: Tensor, s: Tensor) -> Tensor:
    """``l*`` and ``n' - n``."""
    return torch.cat([s[0, 1:2], n[1] - n[0]])


def lifted_flat_edge_terms(topology: Topology, edges: Tensor, *, weight: float) -> list[ElementTerm]:
    """``l* = 0`` for interior edges: "quads are kept planar via l* = 0 for all diagonals" (paper, Fig. 18).

    Normals are set equal as well: the derivative of ``|n - n'|^2 - l*^2`` vanishes where ``l* = 0`` asks them to be, so
    by that alone a residual of size r leaves an angle of ``sqrt(r)``.

    Args:
        topology: Any polygon mesh.
        edges: (n,) numbers of interior edges.
        weight: Of half the squares; dimensionless.
    """
    if not edges.numel():
        return []
    where = [("normals", topology.interior_edge_faces[edges]), ("lengths", edges[:, None])]
    return [ElementTerm("flat edges", flat_residual, where, weight=weight, linear=True)]


def lifted_normal_variation_terms(
    vertices: Tensor, topology: Topology, planar: Tensor, *, weight: float, constraint_weight: float
) -> list[ElementTerm]:
    """Defining constraints of the auxiliary variables, and E as the target.

    Args:
        vertices: (V, 3) start, for the scale of the areas.
        topology: Any polygon mesh.
        planar: (F,) bool: faces whose normal is orthogonal to every edge, as in the paper; the normals of the
            others are tied to their area vectors instead.
        weight: Of E, which counts once: half of ``2 delta^2 mu^2``, as a sum of squares.
        constraint_weight: Of half the squared constraints.
    """
    count = topology.num_interior_edges
    edges = torch.arange(count, device=topology.device)[:, None]
    faces = torch.arange(topology.num_faces, device=topology.device)[:, None]
    on_planar = planar[topology.corner_faces]
    sides = torch.stack([topology.corners, topology.corners[topology.next_corners]], dim=1)[on_planar]
    owners = topology.corner_faces[on_planar][:, None]
    terms = [
        ElementTerm("edge lengths", edge_length_residual, [("vertices", topology.interior_edges), ("lengths", edges)]),
        ElementTerm(
            "dual edge lengths",
            dual_length_residual,
            [("normals", topology.interior_edge_faces), ("lengths", edges)],
        ),
        ElementTerm("face normals", orthogonality_residual, [("vertices", sides), ("normals", owners)]),
        ElementTerm("unit normals", unit_residual, [("normals", faces)]),
    ]
    terms += _free_face_terms(vertices, topology, planar)
    target = ElementTerm(NAME, energy_residual, [("lengths", edges)], weight=weight)
    return [*(replace(term, weight=constraint_weight) for term in terms if term.num_elements), target]


def _free_face_terms(vertices: Tensor, topology: Topology, planar: Tensor) -> list[ElementTerm]:
    terms = []
    for numbers, corners in topology.faces_by_size.values():
        free = ~planar[numbers]
        if bool(free.any()):
            areas = vector_norm(torch.func.vmap(area_vector)(vertices[corners[free]]), dim=1)
            stencil = [("vertices", corners[free]), ("normals", numbers[free][:, None])]
            terms.append(ElementTerm("face normals", parallel_residual, stencil, data=(areas,)))
    return terms
