"""Paper Fig. 3: the cotangent mean curvature of two meshes of a saddle, one whose stars are saddles, one whose are not.

Both meshes are inscribed in ``z = x^2 - y^2/2`` over the same square. Their vertices lie above the same lattice of
isosceles triangles, once with the base along y and once, turned by a right angle, with the base along x; then every
vertex is moved a little in the parameter plane, by the same random amounts. Triangles are congruent in the plane, and
vertices lie on the surface exactly, so that both approximate it equally well. But along y the surface bends down and
along the legs it bends up, and stars are good saddles; with the base along x it bends up in all three directions, and
a star is neither convex nor a saddle, as in the paper's Fig. 2c.

Shown are the errors of ``|H_v / A_v - H n|`` over ``|H|`` (H_v by the cotangent formula, A_v a third of the areas
around v) over the size of the perturbation, by class of star, and the fields themselves.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import torch
from _charts import BLUE, DASHES, GREEN, ORANGE, RED, add_chart, add_legend
from _common import ExperimentConfig, Report, Results, run_experiment, setting
from torch import Tensor

from torchfair import Topology
from torchfair.geometry import face_normals, mean_curvature_vectors, vertex_areas, vertex_normals
from torchfair.shapes import Paraboloid
from torchfair.stars import StarKind, classify_stars, pyramid_self_intersections
from torchfair.viewing import MeshView, fit_camera
from torchfair.viewing.sheet import CAPTION, GAP, MARGIN, Sheet, points

if TYPE_CHECKING:
    from torchfair.stars import StarClasses

NAME = "fig03_mean_curvature"
PICTURE, CHART = "fields.png", "errors.png"
MESHES = ("saddles.obj", "no_saddles.obj")
SURFACE = Paraboloid(a=2.0, b=-1.0, half_widths=(2.0, 2.0))
LATTICES = {"stars are saddles": True, "stars are no saddles": False}
"""Whether the base of the triangles runs along y."""

CLASSES = {"good": ("good saddles", GREEN), "bad": ("bad saddles", ORANGE), "neither": ("neither", RED)}
Mesh = tuple[Tensor, Topology]


@dataclass(frozen=True)
class Config(ExperimentConfig):
    """Settings of the experiment."""

    rows: int = setting(32, "rows of triangles across the square", least=6)
    base_angle: float = setting(50.0, "angle at the base of the triangles, in degrees", least=40)
    half_width: float = setting(0.25, "half the side of the square; H vanishes at x = 0.5", least=0.01)
    drawn: float = setting(0.1, "perturbation in the pictures, in lengths of the shorter edge", least=0)
    perturbations: tuple[float, ...] = setting(
        (0.0, 0.01, 0.02, 0.05, 0.1, 0.15, 0.2, 0.25), "largest moves to try, in lengths of the shorter edge", least=0
    )


# ---- meshes --------------------------------------------------------------------------------------------


def lattice(config: Config, turned: bool) -> tuple[Tensor, Topology, float]:
    """Places (V, 2) in the square, triangles, and the length of the shorter edge; the base runs along x or y."""
    height = 2 * config.half_width / config.rows
    base = 2 * height / math.tan(math.radians(config.base_angle))
    columns = int(2 * config.half_width / base)
    i = torch.arange(config.rows + 1)[:, None]
    x = (torch.arange(columns + 1) + 0.5 * (i % 2)) * base
    x = x - x.mean()
    y = (i * height - config.half_width).expand_as(x)
    places = torch.stack([-y, x] if turned else [x, y], dim=-1).reshape(-1, 2).to(torch.float64)
    index = torch.arange(len(places)).view(config.rows + 1, columns + 1)
    faces = []
    for row in range(config.rows):
        a, b = index[row], index[row + 1]
        if row % 2 == 0:
            corners = ((a[:-1], a[1:], b[:-1]), (a[1:], b[1:], b[:-1]))
        else:
            corners = ((a[:-1], b[1:], b[:-1]), (a[:-1], a[1:], b[1:]))
        faces += [torch.stack(triple, dim=1) for triple in corners]
    return places, Topology.from_faces(torch.cat(faces)), min(base, math.hypot(base / 2, height))


def inscribed(config: Config, turned: bool, perturbation: float) -> Mesh:
    """The mesh after its vertices have been moved by up to ``perturbation`` in each parameter."""
    places, topology, edge = lattice(config, turned)
    generator = torch.Generator().manual_seed(config.seed)
    moves = 2 * torch.rand(places.shape, generator=generator, dtype=torch.float64) - 1
    return SURFACE.position(*(places + perturbation * edge * moves).unbind(1)), topology


def field(vertices: Tensor, topology: Topology) -> tuple[Tensor, Tensor]:
    """Mean-curvature vectors per area, computed and exact: both (V, 3)."""
    computed = mean_curvature_vectors(vertices, topology) / vertex_areas(vertices, topology)[:, None]
    u, v = vertices[:, 0], vertices[:, 1]
    return computed, SURFACE.principal_curvatures(u, v).mean(-1, keepdim=True) * SURFACE.normal(u, v)


# ---- measuring -----------------------------------------------------------------------------------------


def measure(vertices: Tensor, topology: Topology) -> Report:
    """Errors of H and of normals, and the classes of the stars."""
    classes = classify_stars(vertices, topology)
    computed, exact = field(vertices, topology)
    errors = (computed - exact).norm(dim=1) / exact.norm(dim=1)
    centres = vertices[topology.triangles].mean(1)
    tilts = _angle(face_normals(vertices, topology), SURFACE.normal(centres[:, 0], centres[:, 1]))
    own = _angle(vertex_normals(vertices, topology), SURFACE.normal(vertices[:, 0], vertices[:, 1]))
    masks = _masks(classes)
    inner = masks["all"]
    return {
        "stars": {name: int(mask.sum()) for name, mask in masks.items()},
        "self_intersecting_pyramids": int((pyramid_self_intersections(vertices, topology) > 0).sum()),
        "error": {name: _mean_square(errors[mask]) for name, mask in masks.items()},
        "face_normal_error_degrees": _mean_square(tilts),
        "vertex_normal_error_degrees": _mean_square(own[inner]),
    }


def _masks(classes: StarClasses) -> dict[str, Tensor]:
    """Vertices by class, all inner ones first."""
    return {
        "all": ~classes.is_kind(StarKind.EXCLUDED),
        "good": classes.good,
        "bad": classes.bad_saddles,
        "neither": classes.is_kind(StarKind.NEITHER),
        "convex": classes.is_kind(StarKind.CONVEX),
    }


def _angle(a: Tensor, b: Tensor) -> Tensor:
    return torch.atan2(torch.linalg.cross(a, b).norm(dim=-1), (a * b).sum(-1)).rad2deg()


def _mean_square(values: Tensor) -> float | None:
    """Root of the mean square; None of nothing."""
    return float(values.square().mean().sqrt()) if values.numel() else None


# ---- pictures ------------------------------------------------------------------------------------------


def draw_fields(config: Config, reports: dict[str, Report], results: Results) -> None:
    """Both meshes from above, coloured by the mean curvature along the exact normal over its exact value."""
    import matplotlib

    table = torch.from_numpy(matplotlib.colormaps["RdBu_r"](torch.linspace(0, 1, 256).numpy())[:, :3])
    panel = (config.width - 2 * MARGIN - GAP) // 2
    meshes = [inscribed(config, turned, config.drawn) for turned in LATTICES.values()]
    above, north = torch.tensor([0.0, 0, 1]), torch.tensor([0.0, 1, 0])
    camera, size = fit_camera(*(v for v, _ in meshes), towards_eye=above, up=north, width=panel)
    sheet = Sheet(config.width, 3 * CAPTION + size[0] + MARGIN)
    for column, (name, (vertices, topology), file) in enumerate(zip(LATTICES, meshes, MESHES, strict=True)):
        computed, exact = field(vertices, topology)
        ratio = (computed * exact).sum(1) / (exact * exact).sum(1)
        ratio = torch.where(topology.is_boundary_vertex, 1.0, ratio)
        colors = table[((ratio - 1).clamp(-1, 1) * 127.5 + 127.5).round().to(torch.int64)]
        left = MARGIN + column * (panel + GAP)
        report = reports[name][f"{config.drawn:g}"]
        sheet.caption(name, left, 0, panel)
        sheet.caption(f"error of $H$: {100 * report['error']['all']:.0f} %", left, CAPTION, panel)
        sheet.image(MeshView(vertices, topology, camera, size).paint_vertices(colors), left, 2 * CAPTION)
        results.mesh(file, vertices, topology)
    words = "computed over exact mean curvature: white 1, red 2 and more, blue 0 and less"
    sheet.text(words, config.width / 2, 2.5 * CAPTION + size[0], 22, ha="center", va="center")
    sheet.write(results.path(PICTURE), overwrite=results.force)


def draw_errors(reports: dict[str, Report], results: Results) -> None:
    """Errors of H and of the face normals over the perturbation, and the errors of H by class."""
    sheet = Sheet(1900, 660)
    charts = [
        add_chart(sheet, 110 + k * 620, 80, 500, 440, title=title, x="perturbation, in edges")
        for k, title in enumerate(("error of $H$", "error of $H$ by class", "error of face normals, degrees"))
    ]
    for (name, rows), color in zip(reports.items(), (BLUE, RED), strict=True):
        sizes = [float(size) for size in rows]
        style: dict[str, Any] = {"color": color, "marker": "o", "markersize": points(8), "linewidth": points(3)}
        style["label"] = name
        charts[0].plot(sizes, [row["error"]["all"] for row in rows.values()], **style)
        charts[2].plot(sizes, [row["face_normal_error_degrees"] for row in rows.values()], **style)
        for key, (label, tint) in CLASSES.items():
            known = [(size, row["error"][key]) for size, row in zip(sizes, rows.values(), strict=True)
                     if row["stars"][key] >= 10]  # fmt: skip
            if known:
                line = "-" if name == next(iter(reports)) else DASHES
                x, y = zip(*known, strict=True)
                where = "left" if line == "-" else "right"
                style = {"marker": "o", "markersize": points(7), "linewidth": points(2.5), "color": tint}
                charts[1].plot(x, y, linestyle=line, label=f"{label}, {where} mesh", **style)
    for chart in charts:
        chart.set_ylim(bottom=0)
        add_legend(chart, loc="upper left" if chart is not charts[2] else "lower left")
    sheet.write(results.path(CHART), overwrite=results.force)


# ---- experiment ----------------------------------------------------------------------------------------


def experiment(config: Config, results: Results) -> Report:
    """Perturbs, measures, draws, and prints what came out."""
    reports: dict[str, Report] = {}
    for name, turned in LATTICES.items():
        reports[name] = {}
        for size in sorted({*config.perturbations, config.drawn}):
            row = measure(*inscribed(config, turned, size))
            reports[name][f"{size:g}"] = row
            stars, errors = row["stars"], row["error"]
            print(
                f"{name}, perturbation {size:g}: {stars['good']} good, {stars['bad']} bad, {stars['neither']} neither; "
                f"error of H {errors['all']:.3f}, of face normals {row['face_normal_error_degrees']:.2f} degrees"
            )
    draw_fields(config, reports, results)
    draw_errors(reports, results)
    return {"lattices": reports}


def main(arguments: list[str] | None = None) -> int:
    """The experiment from the command line."""
    return run_experiment(NAME, __doc__, Config, experiment, [PICTURE, CHART, *MESHES], arguments)


if __name__ == "__main__":
    sys.exit(main())
