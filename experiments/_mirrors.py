"""Pictures of meshes as mirrors, with surroundings to look at and the joints between panels."""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from torch import Tensor

from torchfair import Topology
from torchfair.cameras import Camera
from torchfair.meshing import QuadMesh
from torchfair.reflection import EquirectangularImage, SmoothReference, Stripes, render_reflection
from torchfair.reflection.environments import Environment
from torchfair.shapes import ShapeMesh
from torchfair.viewing import EdgeStyle, MeshView
from torchfair.viewing.shading import stripe_colors
from torchfair.viewing.sheet import CAPTION, FAINT_TEXT, GAP, MARGIN, Sheet
from torchfair.viewing.wireframe import line_width

_SAMPLES = 4


class Mirror(NamedTuple):
    """A mesh of plane mirrors, or a smooth surface if it has vertex normals."""

    vertices: Tensor
    topology: Topology
    normals: Tensor | None = None


def plane_panels(mesh: ShapeMesh | QuadMesh) -> Mirror:
    """A mesh whose faces are plane mirrors."""
    return Mirror(mesh.vertices, mesh.topology)


def smooth_mirror(reference: SmoothReference) -> Mirror:
    """A smooth surface."""
    return Mirror(reference.vertices, reference.topology, reference.normals)


def mirror_picture(
    mirror: Mirror, camera: Camera, size: tuple[int, int], environment: Environment, *, joints: float = 0.0
) -> Tensor:
    """Colours (height, width, 3) on white paper; ``joints`` is the opacity of lines along the edges of panels."""
    picture = render_reflection(
        mirror.vertices,
        mirror.topology,
        camera,
        environment,
        size=size,
        supersampling=_SAMPLES,
        shading="flat" if mirror.normals is None else "smooth",
        normals=mirror.normals,
    )
    colors = picture.image[0].movedim(0, -1) + (1 - picture.coverage[0])[..., None]
    return colors.clamp(0, 1) * _lines(mirror, camera, size, joints)


def _lines(mirror: Mirror, camera: Camera, size: tuple[int, int], opacity: float) -> Tensor:
    """White with dark lines where the joints are and along the boundary."""
    view = MeshView(mirror.vertices, mirror.topology, camera, size, supersampling=_SAMPLES)
    topology = mirror.topology
    inner = line_width(view, 0.03, 0.3, 1.0) if opacity > 0 and mirror.normals is None else 0.0
    widths = torch.full((topology.num_edges,), inner, dtype=torch.float64)
    widths[topology.num_interior_edges :] = 0.8
    white = torch.ones(topology.num_faces, 3)
    return view.paint(white, edges=EdgeStyle(torch.tensor([0.05, 0.07, 0.12]), widths, opacity=max(opacity, 0.3)))


def panel_width(width: int, columns: int) -> int:
    """Columns of pixels of one of several pictures side by side on a page."""
    return (width - 2 * MARGIN - (columns - 1) * GAP) // columns


def panels(rows: list[list[Tensor]], width: int, captions: dict[str, list[str]]) -> Sheet:
    """A page of pictures; below each column its name, in two lines where it is long, and further words in grey."""
    height, panel = rows[0][0].shape[:2]
    names, lines = [_in_lines(name) for name in captions], max(map(len, captions.values()))
    size = min(34, 1.6 * panel / max(len(line) for name in names for line in name))
    below = MARGIN + len(rows) * (height + GAP)
    under = below + CAPTION + int(1.2 * size * (max(map(len, names)) - 1))
    sheet = Sheet(width, under + int(lines * 1.3 * size) + GAP // 2)
    for column, (name, words) in enumerate(zip(names, captions.values(), strict=True)):
        left = MARGIN + column * (panel + GAP)
        for number, row in enumerate(rows):
            sheet.image(row[column], left, MARGIN + number * (height + GAP))
        sheet.text("\n".join(name), left + panel / 2, (below + under) / 2, size, ha="center", va="center")
        for line, text in enumerate(words):
            place = under + (line + 0.5) * 1.3 * size
            sheet.text(text, left + panel / 2, place, 0.8 * size, FAINT_TEXT, ha="center", va="center")
    return sheet


def _in_lines(name: str, most: int = 16) -> list[str]:
    """A name that is longer than that in two lines, as even as its words allow."""
    words = name.split()
    if len(name) <= most or len(words) == 1:
        return [name]
    ways = [[" ".join(words[:count]), " ".join(words[count:])] for count in range(1, len(words))]
    return min(ways, key=lambda way: max(map(len, way)))


# ---- surroundings --------------------------------------------------------------------------------------


def striped(waves: Tensor, frequency: float, sharpness: float = 6.0) -> Environment:
    """Dark and light stripes across one direction, in the colours of all pictures of torchfair."""
    stripes = Stripes(waves, frequency, sharpness)
    return lambda directions: stripe_colors(stripes(directions)[..., 0])


def evening_sky(height: int = 512) -> EquirectangularImage:
    """A panorama: sky that brightens towards a low sun, streaks of cloud, a skyline, and paving below."""
    theta = (torch.arange(height, dtype=torch.float64) + 0.5) * math.pi / height
    azimuth = math.pi - (torch.arange(2 * height, dtype=torch.float64) + 0.5) * math.pi / height
    level, turn = torch.meshgrid(math.pi / 2 - theta, azimuth, indexing="ij")
    up = level.clamp(min=0) / (math.pi / 2)
    mix = lambda a, b, t: a[:, None, None] + (b - a)[:, None, None] * t  # noqa: E731
    color = lambda *rgb: torch.tensor(rgb, dtype=torch.float64)  # noqa: E731
    sky = mix(color(0.98, 0.84, 0.66), color(0.20, 0.40, 0.70), 1 - (1 - up) ** 2.2)
    glow = torch.exp(-((turn - 0.9) ** 2 / 0.5 + (level - 0.15) ** 2 / 0.06))
    sky = sky + (color(1.0, 0.93, 0.80)[:, None, None] - sky) * glow
    streaks = torch.zeros_like(level)
    for k, m in ((1, 2), (2, 3), (3, 5)):
        wave = torch.sin(k * level * 9 + 1.7 * torch.sin(m * turn + k) + k)
        streaks = streaks + wave * torch.sin(m * turn + 2.1 * k) / k
    cloud = torch.sigmoid(5 * (streaks - 0.55)) * torch.sigmoid(12 * (1.1 - level)) * (level > 0.12)
    sky = sky + (1 - sky) * 0.65 * cloud
    block = torch.floor(turn * 18 / math.pi)
    roofs = 0.05 + 0.11 * torch.remainder(torch.sin(block * 12.9898) * 43758.5453, 1.0)
    town = mix(color(0.10, 0.13, 0.20), color(0.17, 0.21, 0.30), torch.remainder(torch.sin(block * 78.2) * 917.3, 1.0))
    picture = torch.where(level < roofs, town, sky)
    reach = 1 / torch.tan((-level).clamp(min=0.03))
    tiles = torch.sin(2.2 * reach * torch.cos(turn)) * torch.sin(2.2 * reach * torch.sin(turn))
    paving = mix(color(0.28, 0.27, 0.26), color(0.52, 0.50, 0.47), torch.sigmoid(6 * tiles) * torch.exp(-0.05 * reach))
    return EquirectangularImage(torch.where(level < 0, paving, picture).clamp(0, 1).to(torch.float32))
