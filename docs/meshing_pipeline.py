"""Draws the pictures of the chain from a surface to panels: ``python docs/meshing_pipeline.py``.

docs/images/meshing_pipeline.png has every stage of principal meshing, docs/images/surface_to_quads.png its beginning
and its end as mirrors. With a folder as argument the pictures go there.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from torchfair import Topology
from torchfair.cameras import Camera
from torchfair.fields import FaceFrames, directions_of
from torchfair.formfinding import planar_quads
from torchfair.meshing import QuadMesh, attempt, principal_quads
from torchfair.meshing.seamless_map import SeamlessMap
from torchfair.reflection import SmoothReference, Stripes, render_reflection
from torchfair.shapes import FreeFormPatch, irregular_triangles
from torchfair.viewing import MeshView, fit_camera, view_direction
from torchfair.viewing.lines import Surface, visible_lines
from torchfair.viewing.picture_reflections import mirror_colors
from torchfair.viewing.shading import shade_faces
from torchfair.viewing.sheet import CAPTION, MARGIN, Sheet
from torchfair.viewing.wireframe import outline, quiet_edges

IMAGES = Path(__file__).resolve().parent / "images"
STAGE, END = (496, 400), (400, 310)  # columns and rows of pixels of a picture
RED, BLUE, GREEN, INK = (0.75, 0.18, 0.13), (0.12, 0.37, 0.66), (0.13, 0.52, 0.30), (0.2, 0.24, 0.3)
Mesh = tuple[Tensor, Topology]
Lines = list[tuple[np.ndarray, tuple[float, float, float], float]]  # ends (n, 2, 3), colour, width in pixels


@contextmanager
def maps_seen() -> Iterator[list[SeamlessMap]]:
    """The maps that meshes are traced in while this is in force, the last one for the mesh that is returned."""
    seen: list[SeamlessMap] = []
    trace = attempt.trace_cells

    def tracing(found: SeamlessMap, *rest: Any) -> Any:
        seen.append(found)
        return trace(found, *rest)

    attempt.trace_cells = tracing  # type: ignore[assignment]  # watched while it works
    try:
        yield seen
    finally:
        attempt.trace_cells = trace


def back_on_the_surface(found: SeamlessMap, made: QuadMesh) -> SeamlessMap:
    """A map of a surface of one component, which was made in its pose, where the surface is."""
    placed, pose = found.frames, made.surface.parts[0].pose
    return replace(found, frames=FaceFrames.of(torch.from_numpy(pose.back(placed.points)), placed.topology))


# ---- lines on the surface ------------------------------------------------------------------------------


def crosses(found: SeamlessMap, angles: np.ndarray, length: float, chosen: np.ndarray) -> list[np.ndarray]:
    """Segments (n, 2, 3) along directions in triangles, and across them."""
    frames = found.frames
    arms = []
    for turn in (0.0, np.pi / 2):
        turned = angles[chosen] + turn
        along = np.cos(turned)[:, None] * frames.first[chosen] + np.sin(turned)[:, None] * frames.second[chosen]
        centres = frames.centres[chosen]
        arms.append(np.stack([centres - length / 2 * along, centres + length / 2 * along], axis=1))
    return arms


def whole_lines(found: SeamlessMap, coordinate: int) -> np.ndarray:
    """Segments (n, 2, 3) where a coordinate is a whole number."""
    corners = found.values[found.seams.copies]
    values = corners.real if coordinate == 0 else corners.imag
    places = found.frames.points[found.frames.triangles]
    segments = []
    for face in range(len(values)):
        value, place = values[face], places[face]
        for level in range(int(np.ceil(value.min())), int(np.floor(value.max())) + 1):
            ends = []
            for i, j in ((0, 1), (1, 2), (2, 0)):
                if (value[i] < level) != (value[j] < level):
                    share = (level - value[i]) / (value[j] - value[i])
                    ends.append(place[i] + share * (place[j] - place[i]))
            if len(ends) == 2:
                segments.append(ends)
    return np.array(segments)


def cut_lines(found: SeamlessMap) -> np.ndarray:
    """Edges (n, 2, 3) that the surface was cut along."""
    return found.frames.points[found.frames.edges[found.graph.cut]]


def spread(found: SeamlessMap, distance: float) -> np.ndarray:
    """Numbers of triangles that are so far apart, in a fixed order."""
    centres = found.frames.centres
    chosen: list[int] = []
    for face in np.random.default_rng(0).permutation(len(centres)).tolist():
        if not chosen or np.linalg.norm(centres[chosen] - centres[face], axis=1).min() > distance:
            chosen.append(face)
    return np.array(chosen)


# ---- pictures ------------------------------------------------------------------------------------------


def painted(
    mesh: Mesh, camera: Camera, size: tuple[int, int], lines: Lines | tuple[()] = (), *, edges: bool = False
) -> Tensor:
    """A shaded mesh, with its edges or lines on it."""
    view = MeshView(*mesh, camera, size)
    picture = view.paint(shade_faces(*mesh, camera), edges=quiet_edges(view) if edges else outline(view)).float()
    for ends, color, width in lines:
        points = torch.from_numpy(ends).reshape(-1, 3)
        points = points - 0.01 * camera.view_directions(points)[0]  # not hidden by the mesh
        both = torch.cat([view.points, camera.project(points, view.samples)[0]])
        surface = Surface(both, view.triangulation.triangles, view.triangle_index)
        numbers = torch.arange(len(points)).reshape(-1, 2) + len(view.points)
        widths = torch.full((len(ends),), width * view.supersampling, dtype=torch.float64)
        covered = (visible_lines(surface, numbers, widths) >= 0).float()[None, None]
        share = torch.nn.functional.avg_pool2d(covered, view.supersampling)[0, 0, :, :, None]
        picture = torch.lerp(picture, torch.tensor(color), share)
    return picture


def mirrored(mesh: Mesh, camera: Camera, size: tuple[int, int], normals: Tensor | None = None) -> Tensor:
    """A mesh of plane mirrors among stripes, or a smooth one if it has normals."""
    stripes = Stripes(torch.tensor([0.2, 0.5, 1.0], dtype=torch.float64), 2.0)
    seen = render_reflection(
        *mesh, camera, stripes, size=size, supersampling=2, antialias=True, background=torch.tensor(0.0),
        shading="flat" if normals is None else "smooth", normals=normals,
    )  # fmt: skip
    return mirror_colors(seen.image[0, 0], seen.coverage[0]).float()


def stages(surface: Mesh, made: QuadMesh, planar: QuadMesh, found: SeamlessMap, camera: Camera, size: tuple[int, int]
           ) -> dict[str, Tensor]:  # fmt: skip
    """Every stage, by what it is."""
    spacing = made.report["spacing"]
    few = spread(found, 0.75 * spacing)
    bent = directions_of(found.frames)
    sure = few[bent.confidence[few] > 0.05]
    first, second = crosses(found, np.angle(bent.values) / 2, 0.55 * spacing, sure)
    field = np.concatenate(crosses(found, found.graph.angles, 0.55 * spacing, few))
    singular = found.frames.points[found.graph.charges != 0]
    dots = np.stack([singular, singular + 1e-3 * spacing], axis=1)
    lines: Lines = [
        (whole_lines(found, 0), RED, 1.0),
        (whole_lines(found, 1), BLUE, 1.0),
        (cut_lines(found), GREEN, 3.0),
    ]
    marks: Lines = [(dots, INK, 9.0)] if len(dots) else []
    return {
        "1  principal directions": painted(surface, camera, size, [(first, RED, 1.2), (second, BLUE, 1.2)]),
        f"2  field, {len(singular)} singular points": painted(surface, camera, size, [(field, INK, 1.2), *marks]),
        "3  cut, and lines of whole numbers": painted(surface, camera, size, lines + marks),
        f"4  mesh, E/C = {made.report['variation_over_curvature']:.2f}": painted(
            (made.vertices, made.topology), camera, size, edges=True
        ),
        f"5  planar to {planar.report['planarity_max']:.0e} of an edge": painted(
            (planar.vertices, planar.topology), camera, size, edges=True
        ),
        "6  its reflections": mirrored((planar.vertices, planar.topology), camera, size),
    }


def camera_for(surface: Mesh, pixels: tuple[int, int]) -> tuple[Camera, tuple[int, int]]:
    """A view of a surface, and the size of its picture."""
    view = view_direction(*surface)
    return fit_camera(surface[0], towards_eye=view.towards_eye, up=view.up, width=pixels[0], height=pixels[1])


def write(path: Path, pictures: dict[str, Tensor], columns: int, pixels: tuple[int, int]) -> None:
    """Pictures with captions in rows."""
    rows, cell, row = -(-len(pictures) // columns), pixels[0] + 24, pixels[1] + CAPTION
    sheet = Sheet(2 * MARGIN + columns * cell, 2 * MARGIN + rows * row)
    for number, (words, picture) in enumerate(pictures.items()):
        left, top = MARGIN + (number % columns) * cell, MARGIN + (number // columns) * row
        sheet.image(picture, left + 12, top)
        sheet.text(words, left + cell / 2, top + pixels[1] + CAPTION / 2, 21, ha="center", va="center")
    sheet.write(path, overwrite=True)


def draw_stages(path: Path) -> None:
    """From a fine surface to few quads."""
    design = irregular_triangles(FreeFormPatch(), 2500)
    surface = (design.vertices, design.topology)
    with maps_seen() as seen:
        made = principal_quads(*surface, count=350)
    planar, _ = planar_quads(made, surface)
    write(
        path, stages(surface, made, planar, back_on_the_surface(seen[-1], made), *camera_for(surface, STAGE)), 3, STAGE
    )


def draw_ends(path: Path) -> None:
    """Triangles, as many vertices of planar quads, and what both mirror."""
    design = irregular_triangles(FreeFormPatch(), 1300)
    surface = (design.vertices, design.topology)
    planar, _ = planar_quads(principal_quads(*surface, count=1300), surface)
    quads, smooth = (planar.vertices, planar.topology), SmoothReference.of_surface(FreeFormPatch())
    view = camera_for(surface, END)
    pictures = {
        f"surface, {surface[1].num_faces} triangles": painted(surface, *view, edges=True),
        f"{quads[1].num_faces} planar principal quads": painted(quads, *view, edges=True),
        "triangles as mirrors": mirrored(surface, *view),
        "quads as mirrors": mirrored(quads, *view),
        "the smooth surface": mirrored((smooth.vertices, smooth.topology), *view, smooth.normals),
    }
    write(path, pictures, len(pictures), END)


def main() -> None:
    """Writes the pictures."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else IMAGES
    draw_stages(folder / "meshing_pipeline.png")
    draw_ends(folder / "surface_to_quads.png")


if __name__ == "__main__":
    main()
