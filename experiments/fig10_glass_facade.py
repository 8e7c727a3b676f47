"""Paper Fig. 10: a free-form glass facade, a principal quad mesh on the surface of least absolute curvature C.

A wall between two wavy curves and two straight sides: the surface of least C with that boundary, quads along its
principal curvature lines, and the same quads planar. Beside them stand the triangles of the surface itself, with about
as many vertices, and triangles with about as many panels whose vertices lie on the surface. All mirror an evening sky
as a facade would, and the stripes that their score is about.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from typing import Any

import torch
from _chains import PLANAR, QUADS, Mesh, chain, direction, figures_on
from _common import ExperimentConfig, Report, Results, run_experiment, setting
from _forms import solve
from _mirrors import Mirror, evening_sky, mirror_picture, panel_width, panels, smooth_mirror, striped
from _reflected_designs import reflection_scores, smooth_surface

from torchfair.curves import ClosedCurve
from torchfair.formfinding import start_surface
from torchfair.geometry import ReferenceSurface
from torchfair.reflection import SmoothReference
from torchfair.viewing import fit_camera, picture_curvature, picture_edges, picture_principal_mesh
from torchfair.viewing.sheet import Sheet

NAME = "fig10_glass_facade"
PICTURE, GLASS, CURVATURE, EDGES, MESH = "reflections.png", "facade.png", "curvature.png", "edges.png", "mesh.png"
TRIANGLES, PANELS, SMOOTH = "triangles of the surface", "as many triangular panels", "smooth surface"
FILES = {TRIANGLES: "surface.obj", PANELS: "triangles.obj", QUADS: "principal_quads.obj",
         PLANAR: "planar_quads.obj"}  # fmt: skip
VIEW = direction(-0.25, -1.0, 0.06)
_LENGTH, _HEIGHT = 4.4, 1.8
_SINGLE = 1600  # columns of pixels of pictures of one mesh, at most


@dataclass(frozen=True)
class Config(ExperimentConfig):
    """Settings of the experiment."""

    vertices: int = setting(650, "vertices of the start, about", least=60)
    levels: int = setting(1, "how often it is refined", least=0)
    quads: int = setting(2400, "quads, about", least=20)
    frequency: float = setting(3.5, "stripe pairs per unit of the mirrored direction", least=0.1)
    size: int = setting(256, "pixels along the pictures that are scored", least=32)
    joints: float = setting(0.35, "opacity of the joints between panels", least=0.0)
    width: int = setting(3000, "columns of pixels of the picture", least=300)


def wall() -> ClosedCurve:
    """Wavy above and below, straight at both ends; counterclockwise seen from the street."""
    low = lambda x: (x, 0.35 * math.sin(1.6 * x), 0.0)  # noqa: E731
    high = lambda x: (x, 0.45 * math.sin(1.6 * x + 2.0), _HEIGHT + 0.15 * math.cos(1.2 * x))  # noqa: E731
    steps, rungs, end = 40, 16, _LENGTH / 2
    along = [-end + _LENGTH * i / steps for i in range(steps)]

    def side(a: tuple[float, ...], b: tuple[float, ...]) -> list[tuple[float, ...]]:
        return [tuple(p + (q - p) * i / rungs for p, q in zip(a, b, strict=True)) for i in range(rungs)]

    points = [low(x) for x in along] + side(low(end), high(end))
    points += [high(-x) for x in along] + side(high(-end), low(-end))
    corners = (0, steps, steps + rungs, 2 * steps + rungs)
    return ClosedCurve(torch.tensor(points, dtype=torch.float64), corners=corners)


def as_many_panels(surface: SmoothReference, curves: list[ClosedCurve], faces: int) -> Mesh:
    """Triangles that know nothing of directions, with vertices on the surface."""
    vertices, topology = start_surface(curves, round(0.56 * faces))
    vertices = solve(vertices, topology, curves=curves)[0].vertices
    inner = ~topology.is_boundary_vertex
    vertices[inner] = ReferenceSurface(surface.vertices, surface.topology).closest(vertices[inner]).positions
    return vertices, topology


def experiment(config: Config, results: Results) -> Report:
    """The surface, its meshes, figures and pictures."""
    curves = [wall()]
    found, form = solve(*start_surface(curves, config.vertices), curves=curves, levels=config.levels)
    surface = (found.vertices, found.topology)
    print(f"surface: {found.topology.num_vertices} vertices, C {form['after']['total_absolute_curvature']:.4g}")
    quads = chain(surface, config.quads)
    reference = smooth_surface(*surface, times=2)
    panelled = as_many_panels(reference, curves, quads.meshed.topology.num_faces)
    meshes = {TRIANGLES: surface, PANELS: panelled, **quads.meshes()}
    scores = reflection_scores(meshes, reference, config.size)
    report = {name: {**figures_on(quads.meshed, *mesh), **scores[name]} for name, mesh in meshes.items()}
    for name, mesh in meshes.items():
        results.mesh(FILES[name], *mesh)
    draw(config, meshes, reference, report, results)
    draw_facade(config, meshes[PLANAR], results)
    same: dict[str, Any] = {"view": VIEW, "width": min(config.width, _SINGLE), "overwrite": results.force}
    picture_curvature(results.path(CURVATURE), [("surface of least C", *surface)], **same)
    shown = {name: mesh for name, mesh in meshes.items() if name != PANELS}
    picture_edges(results.path(EDGES), {name: v for name, (v, _) in shown.items()}, [t for _, t in shown.values()],
                  columns=1, **same)  # fmt: skip
    made = quads.planar
    picture_principal_mesh(results.path(MESH), made.vertices, made.topology, made.singular_points,
                           made.singular_indices, **same)  # fmt: skip
    return {"form": form, "chain": quads.report, "meshes": report}


def draw(config: Config, meshes: dict[str, Mesh], reference: SmoothReference, report: Report, results: Results) -> None:
    """A column for every mesh and the smooth surface: sky above, stripes below."""
    mirrors = {name: Mirror(*mesh) for name, mesh in meshes.items()} | {SMOOTH: smooth_mirror(reference)}
    camera, pixels = fit_camera(reference.vertices, towards_eye=VIEW.towards_eye, up=VIEW.up,
                                width=panel_width(config.width, len(mirrors)), margin=0.02)  # fmt: skip
    surroundings = (evening_sky(), striped(torch.tensor([1.0, 0.0, 0.4]), config.frequency))
    rows = [[mirror_picture(mirror, camera, pixels, around, joints=config.joints) for mirror in mirrors.values()]
            for around in surroundings]  # fmt: skip
    captions = {name: [f"$E/C$ = {row['variation_over_curvature']:.2f},  {row['faces']} panels",
                       f"score {row['score']:.3f}"] for name, row in report.items()}  # fmt: skip
    floor = next(iter(report.values()))["total_absolute_curvature"]
    captions[SMOOTH] = [f"$C$ = {floor:.2f}"]
    panels(rows, config.width, captions).write(results.path(PICTURE), overwrite=results.force)


def draw_facade(config: Config, mesh: Mesh, results: Results) -> None:
    """The planar quads alone, larger, as the street would see them."""
    width = min(config.width, _SINGLE)
    camera, pixels = fit_camera(mesh[0], towards_eye=VIEW.towards_eye, up=VIEW.up, width=width,
                                margin=0.02)  # fmt: skip
    sheet = Sheet(width, pixels[0])
    sheet.image(mirror_picture(Mirror(*mesh), camera, pixels, evening_sky(), joints=2 * config.joints), 0, 0)
    sheet.write(results.path(GLASS), overwrite=results.force)


def main(arguments: list[str] | None = None) -> int:
    """The experiment from the command line."""
    files = [PICTURE, GLASS, CURVATURE, EDGES, MESH, *FILES.values()]
    return run_experiment(NAME, __doc__, Config, experiment, files, arguments)


if __name__ == "__main__":
    sys.exit(main())
