"""Reflections of an environment in a mesh, as pictures."""

from __future__ import annotations

from typing import Literal, NamedTuple

from torch import Tensor

from ..topology import Topology
from .camera import Camera, Size
from .environments import Environment

Shading = Literal["flat", "smooth"]


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
    raise NotImplementedError
