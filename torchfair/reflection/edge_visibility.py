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
from ..geometry._ops import dot
from ..rasterisation.planes import SeenPlanes
from ..rasterisation.rasterise import visible_triangles
from ..topology import Topology
from ..triangulation import triangulate

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
    pixels = height_and_width(size)
    triangles = triangulate(mesh, topology).triangles
    ends = mesh[topology.interior_edges]
    steps = (torch.arange(samples, device=mesh.device, dtype=mesh.dtype) + 0.5) / samples
    normals = face_normals(mesh, topology)[topology.interior_edge_faces]
    sides = dot(normals, camera.view_directions(ends.mean(1))[..., None, :]).sign()  # (views, I, 2)
    same_side = sides.prod(-1) > 0
    views = [
        _View.of(points, triangles, visible_triangles(points, triangles, pixels[1], pixels[0]))
        for points in camera.project(mesh, size)
    ]
    shares = []
    for some in torch.split(ends, max(1, _PORTION // samples)):
        along = torch.lerp(some[:, :1], some[:, 1:], steps[:, None]).reshape(-1, 3)
        seen = [
            view.sees(places).view(-1, samples).to(mesh.dtype).mean(-1)
            for places, view in zip(camera.project(along, size), views, strict=True)
        ]
        shares.append(torch.stack(seen))
    return (same_side * torch.cat(shares, 1)).to(vertices)


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
