"""Planar strips that stand on the edges of a mesh and end on its offset: a support structure without torsion."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import torch
from torch import Tensor

from .._one_mesh import one_mesh
from ..errors import TorchfairError
from ..geometry import edge_vectors, face_normals, offset_directions, planarity
from ..geometry._ops import unit
from ..topology import Topology


@dataclass(frozen=True, eq=False, repr=False)
class SupportStructure:
    r"""A mesh, its offset, and one quad for every edge between both, made by :func:`support_structure`.

    ::

        v' ------- w'      v' = v + distance x(v), x the offset direction
        |  quad e  |
        v -------- w

    Attributes:
        mesh_vertices: (V, 3) of the mesh.
        mesh_topology: its connectivity.
        distance: by which faces are moved along their normals, in the unit of the vertices.
        offset: (V, 3) vertices of the offset, with the topology of the mesh.
        vertices: (4 E, 3) corners ``v, w, w', v'`` of the quads, for one edge e = (v, w) of the mesh after the other.
        topology: the quads, without common vertices: more than two of them meet in a line at a vertex.
    """

    mesh_vertices: Tensor
    mesh_topology: Topology
    distance: float
    offset: Tensor
    vertices: Tensor
    topology: Topology

    def __repr__(self) -> str:
        return f"SupportStructure({self.topology.num_faces} quads, distance {self.distance:g})"

    @cached_property
    def planarity(self) -> Tensor:
        """(E,) distance of the diagonals of every quad over its mean edge; 0 for parallel edges."""
        return planarity(self.vertices, self.topology)

    @cached_property
    def distance_errors(self) -> Tensor:
        """(C,) how far every corner of the offset is from its face moved by the distance, over the distance."""
        topology = self.mesh_topology
        normals = face_normals(self.mesh_vertices, topology)[topology.corner_faces]
        moved = (self.offset - self.mesh_vertices)[topology.corners]
        errors: Tensor = ((moved * normals).sum(1) / self.distance - 1.0).abs()
        return errors

    @cached_property
    def parallelity(self) -> Tensor:
        """(E,) sine of the angle between every edge and its offset; 0 in a parallel mesh."""
        first, second = (unit(edge_vectors(points, self.mesh_topology)) for points in (self.mesh_vertices, self.offset))
        sines: Tensor = torch.linalg.vector_norm(torch.linalg.cross(first, second), dim=1)
        return sines

    @cached_property
    def tilts(self) -> Tensor:
        """(I,) sine of the angle between every quad on an interior edge and the plane that halves the dihedral angle.

        A quad in that plane stands orthogonal on the mesh.
        """
        topology = self.mesh_topology
        left, right = face_normals(self.mesh_vertices, topology)[topology.interior_edge_faces].unbind(1)
        count = topology.num_interior_edges
        standing = unit(face_normals(self.vertices, self.topology)[:count])
        return (standing * unit(left + right)).sum(1).abs()


def support_structure(vertices: Tensor, topology: Topology, distance: float) -> SupportStructure:
    """The offset of a mesh at a distance, and strips of quads orthogonal to the mesh along all of its edges.

    Paper, section 1.1: principal quad meshes have offsets at constant distance and support structures without torsion.
    On conical meshes all faces of the offset are parallel to those of the mesh, at the distance; edges are parallel to
    edges, quads between them are planar, and those on interior edges halve the angles there. On other meshes the offset
    is the best at each vertex on its own, and what is missing is measured.

    Example::

        structure = support_structure(quads.vertices, quads.topology, 0.1)
        structure.distance_errors.max(), structure.planarity.max()

    Args:
        vertices: positions (V, 3).
        topology: connectivity; any polygons with planar faces.
        distance: in the unit of the vertices, along face normals; negative to the other side.

    Raises:
        ShapeError: if ``vertices`` are not one mesh that fits the topology.
        TorchfairError: if the distance is zero or not finite, or vertices have no offset because normals around them
            cancel; the first few are named.
    """
    vertices = one_mesh(vertices, topology)
    if not (distance < 0 or distance > 0) or abs(distance) == float("inf"):
        raise TorchfairError(f"distance must be a finite number other than 0, got {distance!r}")
    directions = offset_directions(vertices, topology)
    lost = torch.nonzero(~(directions != 0).any(1) & (topology.valences > 0)).squeeze(1)
    if lost.numel():
        raise TorchfairError(f"{lost.numel()} vertices have no offset, since normals cancel there: {lost.tolist()[:5]}")
    offset = vertices + distance * directions
    v, w = topology.edges.unbind(1)
    corners = torch.stack([vertices[v], vertices[w], offset[w], offset[v]], dim=1).flatten(0, 1)
    quads = Topology.from_faces(torch.arange(len(corners)).view(-1, 4), len(corners)).to(topology.device)
    return SupportStructure(vertices, topology, distance, offset, corners, quads)
