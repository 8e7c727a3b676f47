"""A mirroring mesh that turns, as an animated GIF."""

from __future__ import annotations

import io
import os
from collections.abc import Callable

import torch
from torch import Tensor

from .._atomic import atomic_write_bytes
from ..cameras import OrthographicCamera
from ..reflection import Stripes, render_reflection, ring_directions
from ..reflection.smooth_reference import SmoothReference, one_finite_mesh
from ..topology import Topology
from .shading import STRIPES_DARK
from .view_direction import view_direction

_ELEVATION = 38.0
_TURN = 2880  # milliseconds
_BANDS = 8
_COLORS = 32


def turntable(
    path: str | os.PathLike[str],
    vertices: Tensor,
    topology: Topology,
    reference: SmoothReference | None = None,
    *,
    up: Tensor | None = None,
    frames: int = 36,
    size: int = 320,
    progress: Callable[[int], object] | None = None,
    overwrite: bool = False,
) -> None:
    """Writes an animated GIF: the mesh as a mirror on a turntable, and a smooth reference beside it.

    The surroundings have horizontal stripes and stay where they are; so do the lamps of a hall around a model.

    Args:
        path: the GIF file.
        vertices: positions ``(V, 3)``, finite.
        topology: connectivity.
        reference: the smooth surface to show beside the mesh; by default the mesh itself, smoothly shaded.
        up: (3,) the axis of the turntable, by default what :func:`view_direction` takes for up.
        frames: pictures per turn, at least 1.
        size: rows of pixels; there are twice as many columns.
        progress: called with the number of finished frames.
        overwrite: whether an existing file may be replaced.

    Raises:
        ShapeError: if positions are not one mesh that fits the topology, or for less than one frame.
        TorchfairError: if a vertex is not finite.
        MeshFileError: if the file cannot be written.
    """
    from PIL import Image

    smooth = reference or SmoothReference.of_mesh(vertices, topology)
    vertices, smooth = _normalised(one_finite_mesh(vertices, topology), topology, smooth)
    up = view_direction(vertices, topology).up if up is None else up
    directions = ring_directions(up, _ELEVATION, frames)
    stripes = Stripes(up, _BANDS / 2)
    everything = OrthographicCamera.fit(vertices[topology.corners], smooth.vertices, directions=directions, ups=up)
    reach = float(everything.half_widths.max())  # the same scale throughout
    target = everything.targets.mean(0)
    pictures = []
    for frame, direction in enumerate(directions):
        camera = OrthographicCamera(direction, target, reach, up)
        pair = [
            render_reflection(vertices, topology, camera, stripes, size=size, supersampling=2),
            render_reflection(
                smooth.vertices, smooth.topology, camera, stripes, size=size, supersampling=2, shading="smooth",
                normals=smooth.normals,
            ),
        ]  # fmt: skip
        brightness = torch.cat([p.image[0, 0] + 1 - p.coverage[0] for p in pair], dim=1)
        steps = (brightness.clamp(0, 1) * (_COLORS - 1)).round().to("cpu", torch.uint8).numpy()
        pictures.append(Image.fromarray(steps))
        pictures[-1].putpalette(_palette())
        if progress is not None:
            progress(frame + 1)
    data = io.BytesIO()
    pictures[0].save(
        data, "gif", save_all=True, append_images=pictures[1:], duration=_TURN // frames, loop=0, optimize=False
    )
    atomic_write_bytes(path, data.getvalue(), overwrite=overwrite)


def _normalised(vertices: Tensor, topology: Topology, smooth: SmoothReference) -> tuple[Tensor, SmoothReference]:
    """Both of extent 1 about the origin, in float32: enough for pixels, and half the memory that is moved."""
    used = torch.cat([vertices[topology.corners], smooth.vertices.to(vertices)])
    if not used.shape[0]:
        return vertices.to(torch.float32), smooth
    low, high = used.amin(0), used.amax(0)
    middle, extent = (low + high) / 2, (high - low).amax()
    scale = torch.where(extent > 0, extent, 1.0)
    moved, beside = (((v - middle.to(v)) / scale.to(v)).to(torch.float32) for v in (vertices, smooth.vertices))
    return moved, SmoothReference(beside, smooth.topology, smooth.normals.to(torch.float32))


def _palette() -> list[int]:
    """Colours from dark stripes to paper, of which light ones are hardly different; red, green, blue, red, ..."""
    dark, paper = torch.tensor(STRIPES_DARK), torch.ones(3)
    colors = torch.lerp(dark, paper, torch.linspace(0, 1, _COLORS)[:, None])
    numbers: list[int] = (colors * 255).round().to(torch.int64).flatten().tolist()
    return numbers
