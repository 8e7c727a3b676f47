"""Paper Fig. 14: meshes with good reflections, coarse and fine.

The inner, negatively curved part of a torus as an irregular triangle mesh, as a principal-symmetric triangle mesh, as a
principal quad mesh, as the quads that principal meshing makes of the irregular triangles alone, and as the smooth
surface itself, each at two levels or more. All mirror the same stripes. The paper says that principal-symmetric meshes
and principal quads reproduce the pattern of the smooth surface faithfully. Here the surface is known, and the second
and third are laid out on its principal curvature lines.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass

import torch
from _common import ExperimentConfig, Report, Results, run_experiment, setting
from _layouts import ELONGATED, IRREGULAR, QUADS, layout, meshed_quads
from _mirrors import Mirror, mirror_picture, panel_width, panels, plane_panels, smooth_mirror, striped

from torchfair.energies import normal_variation
from torchfair.meshing import QuadMesh
from torchfair.reflection import ReflectionSetup, SmoothReference, reflection_score
from torchfair.shapes import ShapeMesh, Torus
from torchfair.viewing import fit_camera

NAME = "fig14_reflections"
PICTURE = "reflections.png"
SURFACE = Torus(2.0, 1.0, (math.pi - 1.1, math.pi + 1.1), angles=(-1.2, 1.2))
TRIANGLES, MESHED, SMOOTH = "triangle mesh", "principal quads, meshed", "smooth surface"
PANELS = {TRIANGLES: IRREGULAR, "principal-symmetric triangles": ELONGATED, "principal quads": QUADS}
COLUMNS = (*PANELS, MESHED)


@dataclass(frozen=True)
class Config(ExperimentConfig):
    """Settings of the experiment."""

    rows: tuple[int, ...] = setting((24, 48), "square roots of the numbers of vertices, about", least=6)
    frequency: float = setting(2.0, "stripe pairs per unit of the mirrored direction", least=0.1)
    size: int = setting(256, "pixels along the pictures that are scored", least=32)
    joints: float = setting(0.35, "opacity of the joints between panels", least=0.0)
    width: int = setting(2600, "columns of pixels of the picture", least=300)


def files(config: Config | None = None) -> list[str]:
    """Names of the meshes, for the given or the default levels."""
    levels = (config or Config()).rows
    return [
        f"{name.replace(' ', '_').replace('-', '_').replace(',', '')}_{rows}.obj" for rows in levels for name in COLUMNS
    ]


def experiment(config: Config, results: Results) -> Report:
    """Meshes, measures, draws."""
    reference = SmoothReference.of_surface(SURFACE)
    setup = ReflectionSetup.for_reference(reference, size=config.size)
    names = iter(files(config))
    report: dict[str, dict[str, Report]] = {name: {} for name in COLUMNS}
    meshing: Report = {}
    mirrors: list[list[Mirror]] = []
    for rows in config.rows:
        laid_out = {name: layout(SURFACE, kind, rows, config.seed) for name, kind in PANELS.items()}
        meshes: dict[str, ShapeMesh | QuadMesh] = {**laid_out}
        meshes[MESHED] = made = meshed_quads(laid_out[TRIANGLES], rows)
        meshing[str(rows)] = made.report
        for name, mesh in meshes.items():
            score = reflection_score(mesh.vertices, mesh.topology, setup)
            report[name][str(rows)] = {
                "vertices": mesh.topology.num_vertices,
                "normal_variation": normal_variation(mesh.vertices, mesh.topology),
                "score": score.score,
                "reflection_variation": score.reflection_variation,
                "rms": score.rms,
                "wobble": score.wobble,
            }
            results.mesh(next(names), mesh.vertices, mesh.topology)
        print(f"{rows}: " + ", ".join(f"{name} {float(report[name][str(rows)]['score']):.4f}" for name in COLUMNS))
        mirrors.append([*map(plane_panels, meshes.values()), smooth_mirror(reference)])
    draw(config, mirrors, report, results)
    return {"total_absolute_curvature": SURFACE.total_absolute_curvature(), "meshes": report, "meshing": meshing}


def draw(config: Config, mirrors: list[list[Mirror]], report: dict[str, dict[str, Report]], results: Results) -> None:
    """A row of pictures for each level."""
    camera, pixels = fit_camera(
        mirrors[0][-1].vertices, towards_eye=torch.tensor([-1.0, 0.15, 0.08]), up=torch.tensor([0, 0, 1.0]),
        width=panel_width(config.width, len(mirrors[0])), margin=0.02,
    )  # fmt: skip
    stripes = striped(torch.tensor([0.25, 0.35, 1.0]), config.frequency)
    pictures = [[mirror_picture(mirror, camera, pixels, stripes, joints=config.joints) for mirror in row]
                for row in mirrors]  # fmt: skip
    captions = {SMOOTH: [f"$C$ = {SURFACE.total_absolute_curvature():.2f}"]}
    for name, levels in report.items():
        energies = ", ".join(f"{row['normal_variation']:.2f}" for row in levels.values())
        scores = ", ".join(f"{row['score']:.3f}" for row in levels.values())
        captions[name] = [f"$E$ = {energies}", f"score {scores}"]
    sheet = panels(pictures, config.width, {name: captions[name] for name in (*COLUMNS, SMOOTH)})
    sheet.write(results.path(PICTURE), overwrite=results.force)


def main(arguments: list[str] | None = None) -> int:
    """The experiment from the command line."""
    return run_experiment(NAME, __doc__, Config, experiment, [PICTURE, *files()], arguments)


if __name__ == "__main__":
    sys.exit(main())
