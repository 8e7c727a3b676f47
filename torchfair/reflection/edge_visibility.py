"""Which share of every edge a viewer sees."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from .._one_mesh import one_mesh
from .._precision import in_single_at_least
from ..cameras.camera import Camera, Size, check_camera, height_and_width
from ..errors import ShapeError, TorchfairError
from ..geometry import face_normals
from ..geometry._ops import dot, gather
from ..rasterisation.planes import SeenPlanes
from ..rasterisation.rasterise import visible_triangles
from ..topology import Topology
from ..triangulation import triangulate
from ._edge_boxes import BoxedPoints, DepthLimits, roundings

_PORTION = 1 << 18  # points looked at together

_SLACK = (1.5, 1e-3)
"""What is not counted as in front: pixels along the slope of the nearest triangle, and a part of the depth range."""


@in_single_at_least
def edge_visibility(
    vertices: Tensor, topology: Topology, camera: Camera, *, size: Size = 1024, samples: int = 8
) -> Tensor:
    """Visible share of every interior edge in each view: (views, I).

    An edge counts where nothing hides it and the viewer sees the same side of both its faces: only there does one
    mirror picture pass into another. Where a face turns away, the edge is part of an outline and has share 0. Both
    sides of a face mirror. What lies outside of the picture is not seen.

    Shares come from ``samples`` points per edge that are compared with the nearest triangle at their pixel. They are
    right to one sample per edge, except for edges within two pixels of an outline.

    Args:
        vertices: positions (V, 3) of one mesh, finite.
        topology: connectivity; any polygons, mixed.
        camera: the views, such as ``OrthographicCamera.fit(vertices, directions=...)``.
        size: pixels of the pictures.
        samples: points per edge, at least 1.

    Returns:
        (views, I) in [0, 1], multiples of ``1/samples``, in the dtype of the vertices. Constant for autograd: shares
        jump, and what moves an outline is not differentiated.

    Raises:
        ShapeError: if ``vertices`` is not one mesh that fits the topology, or for a size without pixels.
        TorchfairError: if a vertex is not finite.
        TypeError: if ``camera`` is no :class:`~torchfair.cameras.Camera`.
    """
    check_camera(camera)
    mesh = one_mesh(vertices, topology).to(torch.float64)
    if not bool(torch.isfinite(mesh).all()):
        raise TorchfairError("a vertex is not finite: visibility needs positions without NaN and infinity")
    if samples < 1:
        raise ShapeError("samples", "at least 1", samples)
    return visible_shares(mesh, topology, camera, height_and_width(size), samples).to(vertices)


def visible_shares(
    mesh: Tensor,
    topology: Topology,
    camera: Camera,
    size: tuple[int, int],
    samples: int = 8,
    nearest: Tensor | None = None,
) -> Tensor:
    """The same, float64, of a finite ``mesh`` (V, 3) of float64.

    With ``nearest`` (views, height, width) triangles need not be looked for again: numbers of those of
    ``triangulate`` that are seen at the pixel centres, -1 for none.

    In parallel views edges within a few pixels are settled first that all of the surface there is behind, or before:
    nearly all edges of fine meshes. Only what is left is looked at point by point.
    """
    triangles = triangulate(mesh, topology).triangles
    normals = face_normals(mesh, topology)
    margins = None if camera.central else roundings(mesh, camera, size[1])
    shares = []
    for number in range(camera.num_views):
        one = camera.select(slice(number, number + 1))
        points = one.project(mesh, size)[0]
        shown = visible_triangles(points, triangles, size[1], size[0]) if nearest is None else nearest[number]
        view = _View.of(points, triangles, shown)
        share = mesh.new_zeros(topology.num_interior_edges)
        left = torch.nonzero(_same_side(mesh, topology, normals, one)).squeeze(1)
        if margins is not None:
            left = _settle(share, left, view, BoxedPoints.of(points, size, margins[number]), topology.interior_edges)
        _look(share, left, view, mesh, topology.interior_edges, one, samples)
        shares.append(share)
    return torch.stack(shares) if shares else mesh.new_zeros(0, topology.num_interior_edges)


def _same_side(mesh: Tensor, topology: Topology, normals: Tensor, view: Camera) -> Tensor:
    """(I,) whether one view sees the same side of both faces of edges."""
    if view.central:
        directions = view.view_directions(mesh[topology.interior_edges].mean(1))[0]
        return dot(normals[topology.interior_edge_faces], directions[:, None]).sign().prod(-1) > 0
    signs = dot(normals, view.middle_directions.to(mesh)).sign().to(torch.int8)
    left, right = (signs.index_select(0, faces) for faces in topology.interior_edge_faces.unbind(1))
    return left * right > 0


def _settle(share: Tensor, chosen: Tensor, view: _View, ends: BoxedPoints, edges: Tensor) -> Tensor:
    """Writes the shares of those of the chosen edges that are all seen or all hidden; the others."""
    limits = view.limits()
    left = []
    for some in torch.split(chosen, _PORTION):
        seen, told = limits.told(ends, edges.index_select(0, some))
        share[some[seen]] = 1.0
        left.append(some[~told])
    return torch.cat(left)


def _look(
    share: Tensor, chosen: Tensor, view: _View, mesh: Tensor, edges: Tensor, camera: Camera, samples: int
) -> None:
    """Writes the shares of the chosen edges, from so many points of each."""
    steps = (torch.arange(samples, device=mesh.device, dtype=mesh.dtype) + 0.5) / samples
    for some in torch.split(chosen, max(1, _PORTION // samples)):
        ends = gather(mesh, edges.index_select(0, some))
        along = torch.lerp(ends[:, :1], ends[:, 1:], steps[:, None]).reshape(-1, 3)
        places = camera.project(along, view.shape)[0]
        share[some] = view.sees(places).view(-1, samples).to(mesh.dtype).mean(-1)


def _extent(points: Tensor) -> Tensor | float:
    """Range of the depths of projected points (V, 3)."""
    levels = points[:, 2]
    levels = levels[torch.isfinite(levels)]
    return levels.amax() - levels.amin() if levels.shape[0] else 0.0


class _View(NamedTuple):
    """What hides places in one view.

    Attributes:
        seen: the planes that are seen.
        slack: depth by which places may lie behind.
    """

    seen: SeenPlanes
    slack: Tensor | float

    @classmethod
    def of(cls, points: Tensor, triangles: Tensor, nearest: Tensor) -> _View:
        """With projected points (V, 3) and the nearest triangle (H, W) at every pixel."""
        return cls(SeenPlanes.of(points, triangles, nearest), _SLACK[1] * _extent(points))

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of the picture."""
        height, width = self.seen.number.shape
        return height, width

    def limits(self) -> DepthLimits:
        """Depths that decide for whole squares of pixels."""
        planes = self.seen.planes
        ends = (depths + _SLACK[0] * planes.slopes() + self.slack for depths in (planes.nearest(), planes.farthest()))
        everywhere = planes.rows.new_tensor([torch.inf])  # -1, where nothing is, picks the last
        return DepthLimits.of(*(torch.cat([end, everywhere])[self.seen.number] for end in ends))

    def sees(self, places: Tensor) -> Tensor:
        """Whether projected places (N, 3) lie on or before the surface at their pixel, inside the picture: (N,)."""
        height, width = self.seen.number.shape
        row, column = places[:, 1].floor(), places[:, 0].floor()
        seen = (row >= 0) & (row < height) & (column >= 0) & (column < width)  # false for NaN, behind the eye
        inside = torch.nonzero(seen).squeeze(1)
        plane = self.seen.number.view(-1).index_select(0, (row[inside] * width + column[inside]).long())
        hit = torch.nonzero(plane >= 0).squeeze(1)
        covered = inside[hit]
        at = places.index_select(0, covered)
        depths, slopes = self.seen.planes.at(plane[hit], at[:, :2])
        seen[covered] = at[:, 2] <= depths + _SLACK[0] * slopes + self.slack
        return seen
