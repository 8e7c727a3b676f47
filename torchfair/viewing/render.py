"""A mesh seen through a camera: visibility worked out once, coloured as often as wanted."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from functools import cached_property

import torch
from torch import Tensor

from .._one_mesh import one_mesh
from ..cameras import Camera
from ..cameras.camera import Size, height_and_width
from ..rasterisation.rasterise import interpolate, visible_triangles
from ..topology import Topology
from ..triangulation import Triangulation, triangulate
from .camera import check_one_view
from .lines import EdgeStyle, Surface, visible_lines

Color = tuple[float, float, float]

WHITE: Color = (1.0, 1.0, 1.0)
_BAND = 1 << 17  # samples coloured at a time: keeps every temporary inside the cache


class MeshView:
    """One mesh ``(V, 3)`` seen through one camera, with several samples per pixel.

    Args:
        vertices: ``(V, 3)``.
        topology: connectivity, any polygons.
        camera: the view, such as from :func:`~torchfair.viewing.fit_camera`.
        size: pixels of the final picture, (height, width) or one number for a square.
        supersampling: samples per pixel along each side; 1 for none.

    Raises:
        ShapeError: if ``vertices`` are not one mesh that fits the topology, the camera has several views, or the
            picture no pixels.
        TypeError: if ``camera`` is no :class:`~torchfair.cameras.Camera`.
    """

    def __init__(
        self, vertices: Tensor, topology: Topology, camera: Camera, size: Size, *, supersampling: int = 3
    ) -> None:
        check_one_view(camera)
        self.vertices = one_mesh(vertices, topology)
        self.topology = topology
        self.camera = camera
        self.height, self.width = height_and_width(size)
        self.supersampling = supersampling

    @property
    def samples(self) -> tuple[int, int]:
        """Rows and columns of samples."""
        return self.height * self.supersampling, self.width * self.supersampling

    @cached_property
    def triangulation(self) -> Triangulation:
        """The triangles that are drawn."""
        return triangulate(self.vertices, self.topology)

    @cached_property
    def points(self) -> Tensor:
        """``(V, 3)`` positions on the screen in samples, and depth."""
        return self.camera.project(self.vertices, self.samples)[0]

    @cached_property
    def triangle_index(self) -> Tensor:
        """Triangle of :attr:`triangulation` at each sample, -1 where there is none."""
        rows, columns = self.samples
        return visible_triangles(self.points, self.triangulation.triangles, columns, rows)

    @cached_property
    def face_index(self) -> Tensor:
        """Face at each sample (int32), -1 where there is none."""
        faces = torch.nn.functional.pad(self.triangulation.faces.to(torch.int32), (0, 1), value=-1)
        return faces[self.triangle_index]  # -1 picks the last

    def paint(self, face_colors: Tensor, *, edges: EdgeStyle | None = None, background: Color = WHITE) -> Tensor:
        """The picture ``(height, width, 3)`` in 0..1, float32.

        Args:
            face_colors: ``(F, 3)`` one colour per face, as it shall appear (see
                :func:`~torchfair.viewing.shading.shade_faces`).
            edges: how to draw edges; none by default.
            background: colour where nothing is seen.
        """
        table = torch.cat([face_colors.new_tensor([background]), face_colors]).to(torch.float32)
        if edges is not None:
            lines, line_colors = self._lines(edges)
            rim = self._rim(edges.rim) if edges.rim > 0 else None
        bands = []
        for band in self._bands():
            samples = table.index_select(0, (self.face_index[band] + 1).view(-1))
            if edges is not None:
                line = lines[band].reshape(-1)
                covered = torch.nonzero(line >= 0).squeeze(1)
                ink = line_colors.index_select(0, line[covered])
                samples[covered] = torch.lerp(samples[covered], ink, edges.opacity)
                if rim is not None:
                    beside = torch.nonzero(rim[band].reshape(-1) & (line < 0)).squeeze(1)
                    ink = edges.colors.to(samples).reshape(-1, 3)[:1]
                    samples[beside] = torch.lerp(samples[beside], ink, edges.opacity)
            bands.append(self._average(samples))
        return torch.cat(bands)

    def paint_vertices(
        self, vertex_colors: Tensor, *, face_shades: Tensor | None = None, background: Color = WHITE
    ) -> Tensor:
        """The picture ``(height, width, 3)`` with colours blended across each triangle from its corners.

        Args:
            vertex_colors: ``(V, 3)`` in 0..1.
            face_shades: ``(F,)`` brightness that multiplies the colours; 1 by default.
            background: colour where nothing is seen.
        """
        colors = vertex_colors.to(torch.float32)
        shades = colors.new_ones(self.topology.num_faces) if face_shades is None else face_shades.to(torch.float32)
        corners = torch.nn.functional.pad(self.triangulation.triangles, (0, 0, 0, 1))
        weights = self._surface_weights().to(torch.float32)
        bands = []
        for band in self._bands():
            corner = corners[self.triangle_index[band]]
            blended = (weights[band][..., k, None] * colors[corner[..., k]] for k in range(3))
            face = self.face_index[band]
            shade = torch.nn.functional.pad(shades, (0, 1))[face]
            samples = functools.reduce(torch.add, blended) * shade[..., None]
            samples = torch.where((face >= 0)[..., None], samples, samples.new_tensor(background))
            bands.append(self._average(samples))
        return torch.cat(bands).clamp(0, 1)

    def _surface_weights(self) -> Tensor:
        """Barycentric weights on the surface in space (on the screen they are distorted by perspective)."""
        triangles = self.triangulation.triangles
        weights, _ = interpolate(self.points, triangles, self.triangle_index)
        if not self.camera.central:
            return weights
        corners = torch.nn.functional.pad(triangles, (0, 0, 0, 1))[self.triangle_index]
        weights = self.camera.weights_in_space(weights, self.points[:, 2][corners])
        total = weights.sum(-1, keepdim=True)
        return weights / torch.where(total > 0, total, 1)

    def _lines(self, style: EdgeStyle) -> tuple[Tensor, Tensor]:
        """Position in the drawing order of the edge on top of each sample, and the colours in that order."""
        count, device = self.topology.num_edges, self.points.device
        widths = torch.as_tensor(style.widths, dtype=torch.float64, device=device).expand(count)
        widths = torch.where(widths > 0, (widths * self.supersampling).clamp(min=1), 0)
        surface = Surface(self.points, self.triangulation.triangles, self.triangle_index)
        colors = style.colors.to(device, torch.float32).expand(count, 3)
        if style.order is None:
            return visible_lines(surface, self.topology.edges, widths), colors
        order = style.order.to(device).argsort(stable=True)
        places = torch.empty_like(order).scatter_(0, order, torch.arange(count, device=device))
        return visible_lines(surface, self.topology.edges, widths, places), colors[order]

    def _rim(self, width: float) -> Tensor:
        """Samples of the mesh within a distance, in pixels, of the background."""
        reach = max(1, round(width * self.supersampling))
        empty = (self.face_index < 0).to(torch.float32)[None, None]
        for kernel in ((2 * reach + 1, 1), (1, 2 * reach + 1)):
            padding = (kernel[0] // 2, kernel[1] // 2)
            empty = torch.nn.functional.max_pool2d(empty, kernel, stride=1, padding=padding)
        return (empty[0, 0] > 0) & (self.face_index >= 0)

    def _bands(self) -> Iterator[slice]:
        """The rows of samples, a whole number of pixel rows at a time."""
        height, width = self.samples
        rows = max(1, _BAND // (width * self.supersampling)) * self.supersampling
        return (slice(top, top + rows) for top in range(0, height, rows))

    def _average(self, samples: Tensor) -> Tensor:
        """Mean colour of the samples of each pixel of some rows."""
        factor = self.supersampling
        cells = samples.view(-1, factor, self.width, factor, 3)
        parts = (cells[:, row, :, column] for row in range(factor) for column in range(factor))
        return functools.reduce(torch.add, parts) / factor**2
