"""Draws the picture of rendering on the page on reflections: ``python docs/reflection_sheet.py``.

It writes docs/images/rendering.png; with a folder as argument the picture goes there.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from torchfair.reflection import (
    Camera,
    Checker,
    Environment,
    EquirectangularImage,
    OrthographicCamera,
    PerspectiveCamera,
    Stripes,
    render_reflection,
)
from torchfair.shapes import Torus, principal_quads
from torchfair.viewing.picture_reflections import mirror_colors
from torchfair.viewing.sheet import CAPTION, MARGIN, Sheet

IMAGES = Path(__file__).resolve().parent / "images"
WIDTH, HEIGHT = 340, 250
DIRECTION = torch.tensor([-0.55, 0.75, -0.8])


def evening() -> EquirectangularImage:
    """A panorama: a bright horizon, a dark ground with rows of lights, a sky that fades upwards."""
    height = torch.linspace(1, -1, 256)[:, None]
    turn = torch.linspace(0, 1, 512)[None]
    sky = torch.tensor([0.16, 0.25, 0.45]) + torch.exp(-3.5 * height.clamp(min=0))[..., None] * torch.tensor(
        [0.80, 0.55, 0.25]
    )
    lights = (torch.sin(40 * torch.pi * turn) * torch.sin(24 * torch.pi * height) > 0.6).float()[..., None]
    ground = torch.tensor([0.13, 0.15, 0.18]) + lights * torch.tensor([0.75, 0.65, 0.35])
    return EquirectangularImage(torch.where(height[..., None] > 0, sky, ground).clamp(0, 1).movedim(-1, 0))


def picture(camera: Camera, environment: Environment, **settings: Any) -> Tensor:
    """Colours (H, W, 3) of a torus of plane quads among its surroundings, on white."""
    mesh = principal_quads(Torus(), 96, 48)
    image, coverage, _ = render_reflection(
        mesh.vertices, mesh.topology, camera, environment, size=(HEIGHT, WIDTH), supersampling=2, antialias=True,
        background=torch.tensor(0.0), **settings,
    )  # fmt: skip
    if image.shape[1] == 1:
        return mirror_colors(image[0, 0], coverage[0])
    return (image[0].movedim(0, -1) + 1 - coverage[0, ..., None]).clamp(0, 1)


def main() -> None:
    """Writes the picture."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else IMAGES
    points = principal_quads(Torus(), 96, 48).vertices
    fit: dict[str, Any] = {"directions": DIRECTION, "aspect": WIDTH / HEIGHT}
    afar, near = OrthographicCamera.fit(points, **fit), PerspectiveCamera.fit(points, fields_of_view=70.0, **fit)
    stripes = Stripes(torch.tensor([1.0, 0.4, 0.3]), 1.25)
    pictures = {
        "stripes, plane faces": picture(afar, stripes),
        "stripes, vertex normals": picture(afar, stripes, shading="smooth"),
        "checker, from nearby": picture(near, Checker(frequency=1.0)),
        "panorama, from nearby": picture(near, evening()),
    }
    sheet = Sheet(2 * MARGIN + len(pictures) * WIDTH, 2 * MARGIN + HEIGHT + CAPTION)
    for column, (words, colors) in enumerate(pictures.items()):
        left = MARGIN + column * WIDTH
        sheet.image(colors.float(), left, MARGIN)
        sheet.text(words, left + WIDTH / 2, MARGIN + HEIGHT + CAPTION / 2, 21, ha="center", va="center")
    sheet.write(folder / "rendering.png", overwrite=True)


if __name__ == "__main__":
    main()
