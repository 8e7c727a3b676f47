"""Denoising by E, the total variation of the normal, beside Taubin smoothing and bilateral normal filtering.

Clean shapes get Gaussian noise along normals or in all directions. ``denoise`` runs with its defaults on every mesh and
estimates the noise itself; with ``curved`` it runs a second time. The filters get what they do not have in practice: of
several settings, for every mesh the one that is best against the clean mesh.

Shown are the mean angle between normals of faces and those of the clean mesh, the mean distance of vertices from the
clean surface, the change of volume, and faces that are flipped: seen along normals of the clean mesh, smoothed over two
rings. (A face that ends on the other side of a right-angled edge has turned by 90 degrees, but is not flipped.)
"""

from __future__ import annotations

import statistics
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from time import process_time

import torch
from _common import ExperimentConfig, Report, Results, run_experiment, setting
from _denoise_baselines import bilateral_normals, taubin
from _denoise_shapes import Mesh, block, cylinder
from torch import Tensor

from torchfair import Topology
from torchfair.formfinding import DenoiseSettings, denoise
from torchfair.formfinding.denoise.measures import volume
from torchfair.formfinding.denoise.neighbourhoods import Neighbourhoods
from torchfair.formfinding.denoise.unfolding import Sides
from torchfair.geometry import ReferenceSurface, edge_lengths, face_normals, vertex_normals
from torchfair.shapes import Paraboloid, Sphere, Surface, irregular_triangles
from torchfair.viewing import MeshView, fit_camera
from torchfair.viewing.shading import shade_faces
from torchfair.viewing.sheet import CAPTION, GAP, MARGIN, Sheet

NAME = "denoise_shapes"
TABLE, PICTURE = "table.md", "shapes.png"
METHODS = ("noisy", "denoise", "curved", "bilateral", "taubin")
DRAWN = ("noisy", "denoise", "bilateral", "taubin")
SHAPES, NOISES = ("block", "cylinder", "sphere", "saddle", "blend"), ("normal", "all")
TAUBIN_ROUNDS = (5, 10, 20, 50)
BILATERAL_WIDTHS = (0.2, 0.3, 0.45)
BILATERAL_ROUNDS = (5, 20)
EYE, UP = (torch.tensor(axis, dtype=torch.float64) for axis in ([0.5, -1.0, 0.7], [0.0, 0.0, 1.0]))
Meshes = tuple[dict[str, Tensor], Topology]  # vertices by method


@dataclass(frozen=True)
class Config(ExperimentConfig):
    """Settings of the experiment."""

    faces: int = setting(13000, "faces of every shape", least=500)
    shapes: tuple[str, ...] = setting(SHAPES, "shapes", choices=SHAPES)
    noises: tuple[str, ...] = setting(NOISES, "along normals, or in all directions", choices=NOISES)
    levels: tuple[float, ...] = setting((0.1, 0.3, 0.5), "noise in mean edge lengths", least=0.0)
    repeats: int = setting(3, "random generators", least=1)
    width: int = setting(1600, "columns of pixels of the picture", least=300)


@dataclass(frozen=True)
class Blend(Surface):
    """A square, flat where x, y < 0, a parabolic cylinder where one of them is above 0, a bowl where both are."""

    @property
    def domain(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """The square."""
        return ((-1.0, 1.0), (-1.0, 1.0))

    def _position(self, u: Tensor, v: Tensor) -> Tensor:
        return torch.stack([u, v, 0.5 * (u.clamp_min(0.0).square() + v.clamp_min(0.0).square())], dim=-1)


def shape(name: str, faces: int, seed: int) -> Mesh:
    """A clean mesh by name."""
    if name in ("block", "cylinder"):
        return {"block": block, "cylinder": cylinder}[name](faces, seed)
    surfaces: dict[str, Surface] = {"sphere": Sphere(), "saddle": Paraboloid(1.0, -1.0), "blend": Blend()}
    mesh = irregular_triangles(surfaces[name], faces // 2, seed)
    return mesh.vertices, mesh.topology


def with_noise(mesh: Mesh, kind: str, level: float, seed: int) -> Tensor:
    """Vertices with Gaussian noise of ``level`` mean edges along normals, or in each of three directions."""
    vertices, topology = mesh
    random = torch.Generator().manual_seed(seed)
    size = level * float(edge_lengths(vertices, topology).mean())
    if kind == "all":
        return vertices + size * torch.randn(len(vertices), 3, generator=random, dtype=vertices.dtype)
    along = torch.randn(len(vertices), 1, generator=random, dtype=vertices.dtype)
    return vertices + size * along * vertex_normals(vertices, topology)


def angles(clean: Mesh, vertices: Tensor) -> Tensor:
    """(F,) degrees between normals of faces and those of the clean mesh."""
    cosine = (face_normals(vertices, clean[1]) * face_normals(*clean)).sum(1)
    return torch.rad2deg(torch.acos(cosine.clamp(-1.0, 1.0)))


def against(clean: Mesh, surface: ReferenceSurface, vertices: Tensor) -> dict[str, float]:
    """Errors of a mesh against the clean one: degrees, mean edges, shares."""
    start, topology = clean
    turned = angles(clean, vertices)
    edge = float(edge_lengths(start, topology).mean())
    sides = Sides.of(start, topology, Neighbourhoods.of(topology))
    errors = {
        "degrees": float(turned.mean()),
        "distance": float(surface.closest(vertices).distances.mean()) / edge,
        "flipped": float(sides.flipped(vertices, topology).sum()),
    }
    if not bool(topology.is_boundary_vertex.any()):
        errors["volume"] = volume(vertices, topology) / volume(start, topology) - 1.0
    return errors


def filters(vertices: Tensor, topology: Topology) -> dict[str, list[Callable[[], Tensor]]]:
    """The filters with all their settings."""
    return {
        "taubin": [partial(taubin, vertices, topology, rounds) for rounds in TAUBIN_ROUNDS],
        "bilateral": [
            partial(bilateral_normals, vertices, topology, width=width, rounds=rounds)
            for width in BILATERAL_WIDTHS
            for rounds in BILATERAL_ROUNDS
        ],
    }


def rows(config: Config) -> Iterator[tuple[Report, Meshes]]:
    """One row for each mesh, with a part for each method, and the meshes that they made."""
    for name in config.shapes:
        clean = shape(name, config.faces, config.seed)
        surface, topology = ReferenceSurface(*clean), clean[1]
        for kind in config.noises:
            for level in config.levels:
                for repeat in range(config.repeats):
                    noisy = with_noise(clean, kind, level, config.seed + repeat)
                    row: Report = {"shape": name, "noise": kind, "level": level, "repeat": repeat}
                    row["noisy"] = against(clean, surface, noisy)
                    made = {"noisy": noisy}
                    for method, curved in (("denoise", False), ("curved", True)):
                        begin = process_time()
                        result = denoise(noisy, topology, settings=DenoiseSettings(curved=curved))
                        made[method] = result.vertices
                        row[method] = {
                            **against(clean, surface, result.vertices),
                            "estimate": result.after["noise"] / float(edge_lengths(*clean).mean()),
                            "arrived_flipped": result.before["flipped_faces"],
                            "left_flipped": result.after["flipped_faces"],
                            "steps": result.steps,
                            "seconds": process_time() - begin,
                        }
                    for method, candidates in filters(noisy, topology).items():
                        tried = [candidate() for candidate in candidates]
                        best = min(tried, key=lambda vertices: float(angles(clean, vertices).mean()))
                        row[method] = against(clean, surface, best)
                        made[method] = best
                    yield row, (made, topology)


def table(found: list[Report]) -> str:
    """Means over the random generators, as a Markdown table."""
    lines = [
        "| shape | noise | " + " | ".join(f"{method} °" for method in METHODS) + " | distances | volume % | flipped |",
        "|---" * (len(METHODS) + 5) + "|",
    ]
    groups: dict[tuple[str, str, float], list[Report]] = {}
    for row in found:
        groups.setdefault((row["shape"], row["noise"], row["level"]), []).append(row)
    for (name, kind, level), members in groups.items():

        def mean(method: str, what: str, members: list[Report] = members) -> float:
            return statistics.fmean(row[method][what] for row in members)

        degrees = " | ".join(f"{mean(method, 'degrees'):.2f}" for method in METHODS)
        distances = " / ".join(f"{mean(method, 'distance'):.3f}" for method in METHODS)
        swollen = f"{100 * mean('denoise', 'volume'):+.2f}" if "volume" in members[0]["denoise"] else "open"
        flipped = f"{mean('noisy', 'flipped'):.0f} > {mean('denoise', 'flipped'):.1f}"
        lines.append(f"| {name} | {kind} {level:g} | {degrees} | {distances} | {swollen} | {flipped} |")
    return "\n".join(lines) + "\n"


def draw(chosen: list[tuple[Report, Meshes]], results: Results, width: int) -> None:
    """A line for each shape: the noisy mesh, and what the methods make of it."""
    panel = (width - 2 * MARGIN - (len(DRAWN) - 1) * GAP) // len(DRAWN)
    views = [fit_camera(made["noisy"], towards_eye=EYE, up=UP, width=panel) for _, (made, _) in chosen]
    sheet = Sheet(width, sum(CAPTION + size[0] for _, size in views) + MARGIN)
    top = 0
    for (row, (made, topology)), (camera, size) in zip(chosen, views, strict=True):
        for column, method in enumerate(DRAWN):
            left = MARGIN + column * (panel + GAP)
            sheet.caption(f"{method}, {row[method]['degrees']:.1f}°", left, top, panel)
            mesh = MeshView(made[method], topology, camera, size)
            sheet.image(mesh.paint(shade_faces(made[method], topology, camera)), left, top + CAPTION)
        top += CAPTION + size[0]
    sheet.write(results.path(PICTURE), overwrite=results.force)


def experiment(config: Config, results: Results) -> Report:
    """All meshes by all methods."""
    found, chosen = [], []
    middle = config.levels[len(config.levels) // 2]
    for row, meshes in rows(config):
        found.append(row)
        if (row["noise"], row["level"], row["repeat"]) == (config.noises[0], middle, 0):
            chosen.append((row, meshes))
        shown = ", ".join(f"{method} {row[method]['degrees']:.2f}" for method in METHODS)
        print(f"{row['shape']} {row['noise']} {row['level']:g} #{row['repeat']}: {shown} degrees", flush=True)
    results.text(TABLE, table(found))
    draw(chosen, results, config.width)
    return {"rows": found}


def main(arguments: list[str] | None = None) -> int:
    """The experiment from the command line."""
    return run_experiment(NAME, __doc__, Config, experiment, (TABLE, PICTURE), arguments)


if __name__ == "__main__":
    sys.exit(main())
