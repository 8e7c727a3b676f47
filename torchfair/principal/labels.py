"""Principal edges from a seed edge, or from the lattice that a mesh was made on."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from .._names import PlacedError, few, few_groups
from ..errors import MeshError, ShapeError
from ..shapes.shape_mesh import Direction, ShapeMesh
from ..topology import Topology
from ._families import Differences, Ints, differences, mark, seams, spread
from .principal_edges import REGULAR, PrincipalEdges


def principal_edges_from_seed(
    topology: Topology, seed_edge: int | Tensor, *, allow_exceptions: bool = False
) -> PrincipalEdges:
    r"""The family of edges that are parallel to a seed edge.

    Two triangles with a common edge make a parallelogram whose opposite sides are parallel, so that every triangle
    has one edge of the family. At regular vertices two opposite edges belong to it: the family runs straight on,
    and spreads from each polyline to the next. It passes the boundary in the same way, whatever the valence there;
    so in the half triangles at the straight ends of a lattice the edge across the boundary is principal.

    Around an interior vertex of valence k the family comes back turned by k - 6 times 60 degrees: nothing is in the
    way of a choice at valence 3, 9, ..., which is what umbilics of index 1/2 and -1/2 look like, but at every other
    singular vertex it comes back as another family. That can also happen around a handle or a hole, as on a torus
    that is closed with a twist.

    Args:
        topology: a triangle mesh.
        seed_edge: number of an edge in ``topology.edges``, or (n,) numbers, at least one in every component.
        allow_exceptions: whether the choice may break along seams, where no choice is possible, or may leave out
            components without seed. Every triangle then takes the side that is found on a shortest path from a
            seed, and regular vertices without two opposite principal edges are ``exceptions`` of the result.

    Raises:
        MeshError: if there is no such edge, a face is not a triangle, two seeds lie in one triangle; and, unless
            exceptions are allowed, if no choice is possible, naming the singular vertices, the seeds or the edges
            where it breaks, or if a component has no seed.
    """
    rule = differences(topology)
    seeds = _checked_seeds(topology, seed_edge)
    faces, sides = _faces_of(rule, topology, seeds)
    found = spread(rule, faces, sides)
    if not allow_exceptions:
        _require_all(topology, found)
        require_no_seams(topology, seams(rule, found), len(seeds))
    return PrincipalEdges(topology, torch.from_numpy(mark(rule, found)).to(topology.device))


def principal_edges_of_lattice(mesh: ShapeMesh, along: Direction | None = None) -> PrincipalEdges:
    """The principal edges of a mesh made by :func:`torchfair.shapes.principal_triangles`, those on parameter lines.

    Args:
        mesh: a half-shifted lattice; also one that :func:`torchfair.shapes.parameter_triangles` made.
        along: the direction of the principal edges, as the lattice was made with. If left out, the direction in
            which more regular vertices have two opposite edges on parameter lines.

    Raises:
        MeshError: if a regular vertex does not have two opposite edges on the parameter lines.
    """
    if along is not None:
        return PrincipalEdges(mesh.topology, mesh.edges_along(along)).check()
    both = [PrincipalEdges(mesh.topology, mesh.edges_along(direction)) for direction in ("u", "v")]
    return min(both, key=lambda edges: (edges.exceptions.numel(), -int(edges.mask.sum()))).check()


def _checked_seeds(topology: Topology, seed_edge: int | Tensor) -> Ints:
    seeds = torch.as_tensor(seed_edge)
    if seeds.ndim > 1 or seeds.dtype not in (torch.int64, torch.int32) or not seeds.numel():
        raise ShapeError("seed_edge", "an edge number or edge numbers (n,)", f"{tuple(seeds.shape)} {seeds.dtype}")
    numbers: Ints = seeds.reshape(-1).cpu().numpy().astype(np.int64)
    outside = numbers[(numbers < 0) | (numbers >= topology.num_edges)].tolist()
    if outside:
        raise MeshError(f"seed_edge: no such edges: {outside[:5]}; the mesh has {topology.num_edges}")
    return np.unique(numbers)


def _faces_of(rule: Differences, topology: Topology, seeds: Ints) -> tuple[Ints, Ints]:
    """Faces beside the seeds, each once, and which of their sides the seeds are."""
    corner_faces = np.arange(rule.side_edges.size) // 3
    is_seed = np.isin(rule.side_edges.ravel(), seeds)
    faces, sides = corner_faces[is_seed], np.flatnonzero(is_seed) % 3
    crowded = faces[:-1][faces[:-1] == faces[1:]]
    if crowded.size:
        raise PlacedError(
            "seed_edge: several seeds lie in one triangle: faces ", few("face", crowded),
            ". Only one edge of a triangle can be principal."
        )  # fmt: skip
    return faces, sides


def _require_all(topology: Topology, sides: Ints) -> None:
    missing = np.flatnonzero(sides < 0)
    if missing.size:
        vertex = int(topology.corners[3 * missing[0]])
        raise PlacedError(
            f"seed_edge: {missing.size} face(s) are not connected with any seed, such as face ",
            ("face", int(missing[0])), " at vertex ", ("vertex", vertex),
            ". Give a seed edge for every component of the mesh."
        )  # fmt: skip


def require_no_seams(topology: Topology, broken: Ints, num_seeds: int = 1) -> None:
    """Raises MeshError that says why there are broken edges, if there are any."""
    if not broken.size:
        return
    valences = topology.valences.cpu().numpy()
    inside = ~topology.is_boundary_vertex.cpu().numpy() & (valences > 0)
    culprits = np.flatnonzero(inside & (valences % 3 != 0))
    remedy = "Pass allow_exceptions=True to go without conditions along the seams"
    if culprits.size:
        shown = [(("vertex", v), f" (valence {valences[v]})") for v in culprits[:5].tolist()]
        raise PlacedError(
            f"no family of edges is consistent around {culprits.size} singular vertex(es): vertices ",
            few_groups(shown, culprits.size),
            f". Singular vertices must have a valence divisible by {REGULAR // 2}. {remedy}, or remesh."
        )  # fmt: skip
    pairs = topology.edges[torch.from_numpy(broken[:5])].tolist()
    ends = [("(", ("vertex", v), ", ", ("vertex", w), ")") for v, w in pairs]
    reason = "the families change places around a handle or a hole"
    if num_seeds > 1:
        reason += ", or the seeds are not of one family"
    raise PlacedError(
        f"no consistent choice: {reason}. It breaks at edges ", few_groups(ends, broken.size), f". {remedy}."
    )  # fmt: skip
