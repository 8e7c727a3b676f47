"""Prescribed tangent planes along the boundary."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor
from torch.linalg import cross, vector_norm

from ..geometry import face_area_vectors
from ..geometry._ops import scatter_sum
from ..geometry.normals import normalise
from ..projection import ElementTerm
from ..topology import Topology
from .base import Constraint
from .boundary_jets import BoundaryJets, slopes_of_patch
from .star_stencils import open_star_stencils

NAME = "tangent planes"
_LARGEST_SHARE = 0.8
_STEEPEST = 0.3  # tangent of the angle up to which a patch is turned
_SMOOTH = 0.02  # mean misfit of a patch over its reach: more is a crease


class BoundaryNormals(NamedTuple):
    """What normals at the boundary of a mesh look like from inside.

    The normal of an open star is that of the surface near the centroid of its faces, not at the boundary vertex.
    Where the surface is smooth, the normal at the vertex is that of a quadratic patch through the vertices around
    (:class:`BoundaryJets`). Elsewhere it is extrapolated: along a line from the boundary inwards normals change
    linearly to first order, so it is ``(star - share * inner) / (1 - share)``.

    Attributes:
        star: (V, 3) unit normals of the sums of area vectors around vertices.
        inner: (V, 3) mean of the star normals of neighbours inside.
        share: (V,) how far the centroid of the star is on the way to them, 0 to 0.8; 0 where there are none.
        at_boundary: (V, 3) unit normals at boundary vertices; zero inside.
    """

    star: Tensor
    inner: Tensor
    share: Tensor
    at_boundary: Tensor

    @classmethod
    def of(cls, vertices: Tensor, topology: Topology) -> BoundaryNormals:
        """Those of one mesh (V, 3)."""
        count = topology.num_vertices
        areas = face_area_vectors(vertices, topology)
        star = normalise(scatter_sum(areas[topology.corner_faces], topology.corners, count), 0.0)
        inside = (~topology.is_boundary_vertex)[:, None].to(vertices.dtype)
        v, w = topology.edges.unbind(1)
        ends, others = torch.cat([v, w]), torch.cat([w, v])

        def mean_inside(values: Tensor) -> Tensor:
            total = scatter_sum((values * inside)[others], ends, count)
            return total / scatter_sum(inside[others], ends, count).clamp_min(1.0)

        inwards = mean_inside(vertices) - vertices
        inwards = inwards - _along(inwards, _boundary_chords(vertices, topology))
        sizes = vector_norm(areas, dim=1, keepdim=True)
        corners = topology.corner_faces
        centres = scatter_sum(vertices[topology.corners], corners, topology.num_faces)
        centres = centres / topology.face_sizes[:, None]
        total = scatter_sum(sizes[corners], topology.corners, count).clamp_min(1e-300)
        centroid = scatter_sum((sizes * centres)[corners], topology.corners, count) / total - vertices
        share = (centroid * inwards).sum(1) / (inwards * inwards).sum(1).clamp_min(1e-300)
        has_inside = scatter_sum(inside[others], ends, count)[:, 0] > 0
        share = torch.where(has_inside, share.clamp(0.0, _LARGEST_SHARE), torch.zeros_like(share))
        extrapolated = normalise(star - share[:, None] * mean_inside(star), 0.0)
        return cls(star, mean_inside(star), share, _at_boundary(vertices, topology, extrapolated))

    def star_targets(self, normals: Tensor) -> Tensor:
        """(V, 3) unit star normals that belong to prescribed unit ``normals`` (V, 3) at the vertices."""
        share = self.share[:, None]
        return normalise((1.0 - share) * normals + share * self.inner, 0.0)


def _at_boundary(vertices: Tensor, topology: Topology, extrapolated: Tensor) -> Tensor:
    """Normals (V, 3) of patches at boundary vertices where these fit, else the ``extrapolated`` ones (V, 3)."""
    chosen = torch.nonzero(topology.is_boundary_vertex & (extrapolated != 0.0).any(1)).squeeze(1)
    result = torch.zeros_like(extrapolated)
    if chosen.numel():
        normals = extrapolated[chosen]
        first, second = tangent_frames(normals)
        jets = BoundaryJets.of(vertices, topology, chosen, normals, (first, second))
        found = normals - jets.slopes[:, :1] * first - jets.slopes[:, 1:] * second
        result[chosen] = torch.where((jets.misfit < _SMOOTH)[:, None], normalise(found, 0.0), normals)
    return result


def tilt(x: Tensor, first: Tensor, second: Tensor) -> Tensor:
    """Components of the unit normal of an open star along two directions: sines of the angles it tilts by.

    ``x[0]`` is the vertex, ``x[1:]`` its ring; the normal is that of the sum of its area vectors.
    """
    spokes = x[1:] - x[0]
    area = cross(spokes[:-1], spokes[1:]).sum(0)
    normal = area / vector_norm(area)
    return torch.stack([torch.dot(normal, first), torch.dot(normal, second)])


def tangent_plane_terms(
    topology: Topology, vertices: Tensor, normals: Tensor, *, weight: float, block: str = "vertices"
) -> list[ElementTerm]:
    """Turns the stars of boundary ``vertices`` (n,) until their normals are ``normals`` (n, 3), unit vectors.

    The residual is an angle in radians (its sine); opposite normals are not told apart, so the start must be
    on the right side. Normals of stars differ from those at their vertices, see :class:`BoundaryNormals`.

    Args:
        topology: Triangle mesh.
        vertices: Numbers of boundary vertices.
        normals: Unit normals of stars.
        weight: Of half the squares; dimensionless.
        block: Name of the vertex block.
    """
    first, second = tangent_frames(normals)
    terms = []
    for chosen, stencil in open_star_stencils(topology, vertices):
        data = (first[chosen], second[chosen])
        terms.append(ElementTerm(NAME, tilt, [(block, stencil)], data=data, weight=weight))
    return terms


def tangent_patch_terms(
    vertices: Tensor, topology: Topology, chosen: Tensor, normals: Tensor, *, weight: float, block: str = "vertices"
) -> list[ElementTerm]:
    """Turns the surface at boundary vertices until quadratic patches there are orthogonal to given unit normals.

    More exact than :func:`tangent_plane_terms`, but only near a solution: patches are frozen in the plane. Where they
    do not fit or the surface is far from the prescribed plane, the stars are turned instead.

    Args:
        vertices: (V, 3) near which the terms are used.
        topology: Triangle mesh.
        chosen: (n,) numbers of boundary vertices.
        normals: (n, 3) unit normals of the surface.
        weight: Of half the squares; dimensionless.
        block: Name of the vertex block.
    """
    jets = BoundaryJets.of(vertices, topology, chosen, normals, tangent_frames(normals))
    fits = (jets.misfit < _SMOOTH) & (vector_norm(jets.slopes, dim=1) < _STEEPEST)
    terms = []
    if bool(fits.any()):
        stencil, data = [(block, jets.stencil[fits])], (jets.weights[fits], normals[fits])
        terms.append(ElementTerm(NAME, slopes_of_patch, stencil, data=data, weight=weight, linear=True))
    if not bool(fits.all()):
        prescribed = torch.zeros_like(vertices)
        prescribed[chosen] = normals
        targets = BoundaryNormals.of(vertices, topology).star_targets(prescribed)[chosen]
        terms += tangent_plane_terms(topology, chosen[~fits], targets[~fits], weight=weight, block=block)
    return terms


class TangentStars(Constraint):
    """Module form of :func:`tangent_plane_terms`: half the sum of squared sines of angles, dimensionless.

    Unchanged if the mesh is moved along or scaled. Normals opposite to the prescribed ones cost nothing.

    Args:
        topology: Triangle mesh.
        vertices: (n,) numbers of boundary vertices.
        normals: (n, 3) unit normals of stars, see :class:`BoundaryNormals`.

    Example:
        >>> import torch
        >>> from torchfair.constraints import TangentStars
        >>> from torchfair.shapes import Catenoid, principal_triangles
        >>> mesh = principal_triangles(Catenoid(), 8, 16)
        >>> rim = torch.nonzero(mesh.topology.is_boundary_vertex).squeeze(1)
        >>> constraint = TangentStars(mesh.topology, rim, mesh.normals[rim])
        >>> constraint(mesh.vertices)
        tensor(0.1750, dtype=torch.float64)
    """

    def __init__(self, topology: Topology, vertices: Tensor, normals: Tensor) -> None:
        super().__init__(tangent_plane_terms(topology, vertices, normals, weight=1.0))


class TangentPatches(Constraint):
    """Module form of :func:`tangent_patch_terms`: half the sum of squared slopes, dimensionless.

    Patches are frozen at given vertices; make another module where the surface has changed much.

    Args:
        vertices: (V, 3) near which the module is used.
        topology: Triangle mesh.
        chosen: (n,) numbers of boundary vertices.
        normals: (n, 3) unit normals of the surface.

    Example:
        >>> import torch
        >>> from torchfair.constraints import TangentPatches
        >>> from torchfair.shapes import Catenoid, principal_triangles
        >>> mesh = principal_triangles(Catenoid(), 8, 16)
        >>> rim = torch.nonzero(mesh.topology.is_boundary_vertex).squeeze(1)
        >>> constraint = TangentPatches(mesh.vertices, mesh.topology, rim, mesh.normals[rim])
        >>> constraint(mesh.vertices)
        tensor(4.5993e-05, dtype=torch.float64)
    """

    def __init__(self, vertices: Tensor, topology: Topology, chosen: Tensor, normals: Tensor) -> None:
        super().__init__(tangent_patch_terms(vertices.detach(), topology, chosen, normals, weight=1.0))


def tangent_frames(normals: Tensor) -> tuple[Tensor, Tensor]:
    """Two unit vectors (n, 3) orthogonal to unit ``normals`` and to each other."""
    smallest = normals.abs().argmin(1)
    helper = torch.eye(3, dtype=normals.dtype, device=normals.device)[smallest]
    first = cross(normals, helper)
    first = first / vector_norm(first, dim=1, keepdim=True)
    return first, cross(normals, first)


def _boundary_chords(vertices: Tensor, topology: Topology) -> Tensor:
    """(V, 3) from the previous to the next boundary vertex; zero inside."""
    start, end = topology.boundary_edges.unbind(1)
    edges = vertices[end] - vertices[start]
    return scatter_sum(torch.cat([edges, edges]), torch.cat([start, end]), topology.num_vertices)


def _along(vectors: Tensor, axes: Tensor) -> Tensor:
    """Parts of vectors along axes of any length; zero where an axis is."""
    squared = (axes * axes).sum(1, keepdim=True)
    return (vectors * axes).sum(1, keepdim=True) / torch.where(squared > 0, squared, 1.0) * axes
