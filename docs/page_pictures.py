"""Draws pictures of the pages on form-finding, stars and the command line: ``python docs/page_pictures.py``.

They are least_curvature.png, star_classes.png, star_pyramids.png and fair_edges.png in docs/images, as the library and
the commands write them, made smaller; with a folder as argument they go there.
"""

from __future__ import annotations

import math
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import torch
from gallery import shrink

from torchfair.curves import ClosedCurve
from torchfair.formfinding import minimise_absolute_curvature, minimise_normal_variation, start_surface
from torchfair.shapes import example_roof
from torchfair.stars import StarKind, classify_stars, pyramid_self_intersections
from torchfair.viewing import picture_curvature, picture_edges, picture_pyramids, picture_star_classes

IMAGES = Path(__file__).resolve().parent / "images"


def least_curvature(path: Path) -> None:
    """The example of the page on form-finding: before and after."""

    def rim(t: torch.Tensor) -> torch.Tensor:
        angle = 2 * math.pi * t
        return torch.stack([1.2 * angle.cos(), angle.sin(), 0.5 * torch.cos(2 * angle)], 1)

    curve = ClosedCurve.from_function(rim)
    vertices, topology = start_surface([curve], 300)
    result = minimise_absolute_curvature(vertices, topology, curves=[curve], levels=1)
    meshes = [("start", vertices, topology), ("least C", result.vertices, result.topology)]
    picture_curvature(path, meshes, width=1400)


def star_classes(path: Path) -> None:
    """Classes of the stars of the roof."""
    vertices, topology = example_roof()
    crossings = pyramid_self_intersections(vertices, topology)
    picture_star_classes(path, vertices, classify_stars(vertices, topology), crossings, width=1400)


def star_pyramids(path: Path) -> None:
    """A convex star, a good saddle and one that is neither, with their normal pyramids."""
    vertices, topology = example_roof()
    classes, crossings = classify_stars(vertices, topology), pyramid_self_intersections(vertices, topology)
    kinds = (classes.is_kind(StarKind.CONVEX) & ~classes.flat, classes.good, classes.is_kind(StarKind.NEITHER))
    chosen = [int(kind.nonzero()[len(kind.nonzero()) // 2]) for kind in kinds]
    picture_pyramids(path, vertices, classes, crossings, chosen, width=1400)


def fair_edges(path: Path) -> None:
    """What `torchfair fair example:roof` writes of the edges."""
    vertices, topology = example_roof()
    after = minimise_normal_variation(vertices, topology).vertices
    picture_edges(path, {"before": vertices, "after": after}, topology, width=1400)


PICTURES: list[Callable[[Path], None]] = [least_curvature, star_classes, star_pyramids, fair_edges]


def main() -> None:
    """Writes the pictures."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else IMAGES
    with tempfile.TemporaryDirectory() as work:
        for draw in PICTURES:
            large = Path(work) / f"{draw.__name__}.png"
            draw(large)
            print(draw.__name__, shrink(large, folder / large.name))


if __name__ == "__main__":
    main()
