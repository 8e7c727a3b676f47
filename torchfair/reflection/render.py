"""Reflections of an environment in a mesh, as pictures."""

from __future__ import annotations

import functools
from typing import Literal, NamedTuple

import torch
from torch import Tensor

from ..geometry import face_normals, vertex_normals
from ..rasterisation.rasterise import visible_triangles
from ..topology import Topology
from ._edge_terms import edge_terms
from ._scene import build_scene
from ._shading import ConstantShader, PlaceShader, Shader, Surroundings
from .camera import Camera, Size, height_and_width
from .environments import Environment

Shading = Literal["flat", "smooth"]

_BAND = 1 << 16  # samples coloured at a time on a CPU: keeps every temporary inside the cache


class Reflection(NamedTuple):
    """What :func:`render_reflection` sees. Row 0 of a picture is its top row.

    Attributes:
        image: (*batch, views, channels, H, W), the background where nothing is seen.
        coverage: (*batch, views, H, W), the part of each pixel that the mesh covers, 0 to 1.
        face_index: (*batch, views, supersampling H, supersampling W) int64, the face seen at each sample, -1 for none.
    """

    image: Tensor
    coverage: Tensor
    face_index: Tensor


def render_reflection(
    vertices: Tensor,
    topology: Topology,
    camera: Camera,
    environment: Environment,
    *,
    size: Size = 256,
    supersampling: int = 1,
    antialias: bool = False,
    shading: Shading = "flat",
    normals: Tensor | None = None,
    background: Tensor | float = 0.0,
) -> Reflection:
    """The environment as the mesh mirrors it, one picture for every view."""
    height, width = height_and_width(size)
    fine = (height * supersampling, width * supersampling)
    meshes = vertices.reshape(-1, topology.num_vertices, 3)
    smooth = shading == "smooth"
    if normals is None:
        normals = vertex_normals(meshes, topology) if smooth else face_normals(meshes, topology)
    scene = build_scene(meshes, topology, camera, fine)
    around = Surroundings(camera, fine, environment, background)
    shade: Shader = (
        PlaceShader(scene, normals, around, smooth=smooth)
        if smooth or camera.near is not None
        else ConstantShader(scene, normals, around)
    )
    triangle = visible_triangles(
        scene.points, scene.triangles, fine[1], fine[0], pictures=scene.pictures, num_pictures=scene.num_pictures
    )
    image = _sampled(shade, triangle, supersampling)
    if antialias or (torch.is_grad_enabled() and (image.requires_grad or scene.points.requires_grad)):
        pixel, terms = edge_terms(scene, shade, fine, smooth=smooth, antialias=antialias)
        image = image.index_add(0, _coarse(pixel, fine, supersampling), terms / supersampling**2)
    faces = torch.cat([scene.faces, scene.faces.new_tensor([-1])])[triangle]
    lead = (*vertices.shape[:-2], camera.num_views)
    image = image.view(*lead, height, width, -1).movedim(-1, -3)
    return Reflection(image[..., :-1, :, :].contiguous(), image[..., -1, :, :].contiguous(), faces.view(*lead, *fine))


def _sampled(shade: Shader, triangle: Tensor, factor: int) -> Tensor:
    """Mean colours (pictures H W, channels + 1) of the samples at the centres of the pixels of ``triangle``."""
    pictures, height, width = triangle.shape
    rows = triangle.view(-1, factor * width)  # those of one row of pixels
    step = max(1, _BAND // rows.shape[1]) if triangle.device.type == "cpu" else rows.shape[0]
    bands = []
    for first in range(0, rows.shape[0], step):
        band = rows[first : first + step]
        places = _centres(first * factor, band.shape[0] * factor, width, height, band) if shade.uses_places else band
        colors = shade(band.reshape(-1), places)
        cells = colors.view(band.shape[0], factor, width // factor, factor, colors.shape[1])
        parts = [cells[:, row, :, column] for row in range(factor) for column in range(factor)]
        bands.append((functools.reduce(torch.add, parts) / factor**2).view(-1, colors.shape[1]))
    return torch.cat(bands)


def _centres(first: int, count: int, width: int, height: int, like: Tensor) -> Tensor:
    """Pixel centres (count * width, 2) of some rows of a stack of pictures, float64."""
    x = torch.arange(width, dtype=torch.float64, device=like.device) + 0.5
    y = torch.remainder(torch.arange(first, first + count, dtype=torch.float64, device=like.device), height) + 0.5
    return torch.stack([x.expand(count, -1), y[:, None].expand(-1, width)], dim=-1).view(-1, 2)


def _coarse(pixel: Tensor, fine: tuple[int, int], factor: int) -> Tensor:
    """Numbers of the pixels that samples are part of."""
    if factor == 1:
        return pixel
    height, width = fine
    column = torch.remainder(pixel, width)
    row = torch.div(pixel, width, rounding_mode="floor")  # through the stack of pictures
    return torch.div(row, factor, rounding_mode="floor") * (width // factor) + torch.div(
        column, factor, rounding_mode="floor"
    )
