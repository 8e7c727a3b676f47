"""Colours that a mesh mirrors: per face where they are the same all over it, else at single places."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Protocol

import torch
from torch import Tensor

from ..cameras import Camera, Size
from ..errors import ShapeError
from ..geometry._ops import gather
from ..geometry.normals import normalise
from ._scene import Scene
from .environments import Environment
from .mirror import mirror_directions


@dataclass(frozen=True, eq=False)
class Surroundings:
    """What a mesh is seen with.

    Attributes:
        camera: the views.
        size: of the picture that places are given in.
        environment: what is mirrored.
        background: a number or (channels,), where nothing is seen.
    """

    camera: Camera
    size: Size
    environment: Environment
    background: Tensor | float

    def mirrored(self, directions: Tensor, normals: Tensor) -> Tensor:
        """Values of the environment (..., channels), and a 1 for coverage: (..., channels + 1)."""
        rays = mirror_directions(directions, normals)
        values = self.environment(rays)
        if values.ndim != rays.ndim or values.shape[:-1] != rays.shape[:-1]:
            raise ShapeError("values of the environment", f"{(*rays.shape[:-1], 'channels')}", tuple(values.shape))
        return torch.nn.functional.pad(values.to(normals), (0, 1), value=1.0)

    def nothing(self, like: Tensor) -> Tensor:
        """The background and a 0 for coverage, (channels + 1,), beside values ``like`` (..., channels + 1)."""
        channels = like.shape[-1] - 1
        background = torch.as_tensor(self.background).to(like)
        if background.shape not in ((), (channels,)):
            raise ShapeError("background", f"a number or ({channels},)", tuple(background.shape))
        return torch.nn.functional.pad(background.expand(channels), (0, 1))


class Shader(Protocol):
    """Colours of the triangles of a scene."""

    uses_places: bool
    """Whether a triangle has not the same colour all over it."""

    def __call__(self, triangle: Tensor, places: Tensor) -> Tensor:
        """Colours (n, channels + 1) of triangles (n,), -1 for none, at places (n, 2) in pixels."""


class ConstantShader:
    """For parallel views of flat faces with ``normals`` (meshes, F, 3): one colour per face."""

    uses_places = False

    def __init__(self, scene: Scene, normals: Tensor, around: Surroundings) -> None:
        directions = around.camera.middle_directions.to(normals)
        colors = around.mirrored(directions[:, None], normals.unsqueeze(1))  # (meshes, views, F, channels + 1)
        table = colors.reshape(-1, colors.shape[-1])
        rows = scene.pictures * normals.shape[1] + scene.faces
        self._table = torch.cat([table, around.nothing(table)[None]])
        self._rows = torch.cat([rows, rows.new_tensor([table.shape[0]])])  # -1 picks the last

    def __call__(self, triangle: Tensor, places: Tensor) -> Tensor:
        return self._table.index_select(0, self._rows[triangle])


class PlaceShader:
    """For any views of faces, or of smooth surfaces, with ``normals`` (meshes, F or V, 3)."""

    uses_places = True

    def __init__(self, scene: Scene, normals: Tensor, around: Surroundings, *, smooth: bool) -> None:
        self._scene, self._around, self._smooth, self._count = scene, around, smooth, normals.shape[1]
        self._normals = scene.at_points(normals.reshape(-1, 3)) if smooth else normals.reshape(-1, 3)

    def __call__(self, triangle: Tensor, places: Tensor) -> Tensor:
        scene, camera = self._scene, self._around.camera
        seen = torch.nonzero(triangle >= 0).squeeze(1)
        triangle, there = triangle.index_select(0, seen), places.index_select(0, seen)
        picture = scene.pictures.index_select(0, triangle)
        view = torch.remainder(picture, scene.num_views)
        if self._smooth:
            normals = self._interpolated(triangle, there)
        else:
            mesh = torch.div(picture, scene.num_views, rounding_mode="floor")
            normals = self._normals.index_select(0, mesh * self._count + scene.faces.index_select(0, triangle))
        directions = camera.directions_at(there, self._around.size, view).to(normals)
        colors = self._around.mirrored(directions, normals)
        return self._around.nothing(colors).expand(places.shape[0], -1).index_copy(0, seen, colors)

    def _interpolated(self, triangle: Tensor, places: Tensor) -> Tensor:
        """Unit normals (n, 3) at places of triangles, straight in space."""
        points = self._scene.triangles.index_select(0, triangle)
        corners = gather(self._scene.points.to(torch.float64), points)
        first, second, third = (corner - places for corner in corners[..., :2].unbind(1))
        weights = torch.stack([_wedge(second, third), _wedge(third, first), _wedge(first, second)], dim=-1)
        weights = self._around.camera.weights_in_space(weights, corners[..., 2]).to(self._normals)
        # Only the direction of the sum counts, and the sign of a normal does not: no division by the area. One corner
        # after the other: a sum over an axis of three costs ten times as much.
        parts = (weights[:, k, None] * gather(self._normals, points[:, k]) for k in range(3))
        total = functools.reduce(torch.add, parts)
        return normalise(total, 1e-12 * weights.detach().abs().sum(-1)).to(self._normals)


def _wedge(a: Tensor, b: Tensor) -> Tensor:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
