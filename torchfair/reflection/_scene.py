"""All pictures of a batch in all views as one list of points, triangles and edges on the screen."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from ..cameras import Camera, Size
from ..geometry._ops import cross, dot
from ..topology import Topology
from ..triangulation import triangulate
from ._clip import clip_edges, clip_triangles
from ._seams import edge_faces


@dataclass(frozen=True, eq=False)
class Scene:
    """Picture ``b views + i`` is mesh b of the batch in view i.

    Attributes:
        num_meshes: meshes in the batch.
        num_views: views of each.
        points: (P, 3) pixel coordinates and depth, differentiable.
        vertices: (N,) vertex, numbered through the batch, of the first N points.
        blends: (P - N, 2) the two points that each further point lies between, where something was cut away.
        weights: (P - N,) share of the second of them.
        triangles: (T, 3) points.
        faces: (T,) face of each triangle.
        pictures: (T,) picture of each triangle.
        edges: (E, 2) points: the edges of the mesh, and cuts through polygons along which they fold on the screen.
        edge_faces: (E, 2) faces beside each edge, one of them twice where there is no other.
        edge_pictures: (E,) picture of each edge.
        edge_shares: (E,) 1, or less where edges of separate parts lie upon each other.
    """

    num_meshes: int
    num_views: int
    points: Tensor
    vertices: Tensor
    blends: Tensor
    weights: Tensor
    triangles: Tensor
    faces: Tensor
    pictures: Tensor
    edges: Tensor
    edge_faces: Tensor
    edge_pictures: Tensor
    edge_shares: Tensor

    @property
    def num_pictures(self) -> int:
        """Meshes times views."""
        return self.num_meshes * self.num_views

    def at_points(self, values: Tensor) -> Tensor:
        """Values (P, d) at the points from values (vertices of the batch, d) at the vertices."""
        return _extended(values.index_select(0, self.vertices), self.blends, self.weights)


def build_scene(vertices: Tensor, topology: Topology, camera: Camera, size: Size) -> Scene:
    """The scene of ``vertices`` (meshes, V, 3)."""
    meshes, count, _ = vertices.shape
    views, device = camera.num_views, vertices.device
    local = camera.local(vertices).reshape(-1, 3)
    pictures = torch.arange(meshes * views, device=device)
    vertex = torch.arange(meshes * count, device=device).view(meshes, 1, count).expand(-1, views, -1).reshape(-1)
    view = torch.arange(views, device=device).view(1, views, 1).expand(meshes, -1, count).reshape(-1)

    cut = triangulate(vertices, topology)
    first = (pictures * count)[:, None, None]
    triangles = cut.triangles.repeat_interleave(views, 0) + first
    folds, fold_faces, fold_pictures = _folds(local.detach(), triangles, cut.faces, camera)
    beside, shares = (part.repeat_interleave(views, 0).flatten(0, 1) for part in edge_faces(vertices, topology))
    edges = torch.cat([(topology.edges + first).view(-1, 2), folds])
    beside = torch.cat([beside, fold_faces])
    edge_pictures = torch.cat([pictures.repeat_interleave(topology.num_edges), fold_pictures])
    shares = torch.cat([shares, shares.new_ones(folds.shape[0])])
    faces, triangle_pictures = cut.faces.repeat(meshes * views), pictures.repeat_interleave(cut.faces.shape[0])
    triangles = triangles.view(-1, 3)

    blends, weights = vertex.new_zeros(0, 2), local.new_zeros(0)
    near = camera.near
    if near is not None:
        distance = local.detach()[:, 2] - near.to(local)[view]
        if not bool((distance > 0).all()):
            left = clip_triangles(triangles, distance, local.shape[0])
            kept = clip_edges(edges, distance, local.shape[0] + left.blends.shape[0])
            triangles, faces, triangle_pictures = left.items, faces[left.source], triangle_pictures[left.source]
            edges, beside, edge_pictures = kept.items, beside[kept.source], edge_pictures[kept.source]
            shares = shares[kept.source]
            blends, weights = torch.cat([left.blends, kept.blends]), torch.cat([left.weights, kept.weights])
            # Points that were cut away are no longer used; a place in front of the eye keeps their derivatives finite.
            behind = torch.cat([distance <= 0, torch.zeros_like(weights, dtype=torch.bool)])[:, None]
            local = torch.where(behind, local.new_tensor([0.0, 0, 1]), _extended(local, blends, weights))
            view = torch.cat([view, view[blends[:, 0]]])
    points = camera.to_screen(local, size, view)
    return Scene(
        meshes, views, points, vertex, blends, weights,
        triangles, faces, triangle_pictures, edges, beside, edge_pictures, shares,
    )  # fmt: skip


def _extended(values: Tensor, blends: Tensor, weights: Tensor) -> Tensor:
    """``values`` (N, d) followed by those between two of them."""
    if blends.shape[0] == 0:
        return values
    first, second = values.index_select(0, blends[:, 0]), values.index_select(0, blends[:, 1])
    return torch.cat([values, torch.lerp(first, second, weights.to(values)[:, None])])


def _folds(local: Tensor, triangles: Tensor, faces: Tensor, camera: Camera) -> tuple[Tensor, Tensor, Tensor]:
    """Cuts between two triangles of one polygon that show different sides: points, the face twice, picture."""
    inner = torch.nonzero(faces[1:] == faces[:-1]).squeeze(1)
    if inner.shape[0] == 0:
        return triangles.new_zeros(0, 2), triangles.new_zeros(0, 2), triangles.new_zeros(0)
    a, b, c = local[triangles].unbind(-2)
    area = cross(b - a, c - a)
    facing = dot(a, area) if camera.central else area[..., 2]
    picture, number = torch.nonzero(facing[:, inner] * facing[:, inner + 1] < 0).unbind(1)
    second = inner[number] + 1
    return triangles[picture, second, :2], faces[second, None].expand(-1, 2), picture
