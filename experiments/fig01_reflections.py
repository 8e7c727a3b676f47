"""Paper Fig. 1: a reflective surface reveals the deficiencies of a mesh; principal meshes have least.

A funnel of glass, part of a catenoid, in five ways with about as many vertices each: as an irregular triangle mesh, as
a principal-symmetric triangle mesh, as a principal quad mesh laid out on known curvature lines, as the quads that
principal meshing makes of the irregular triangles alone, and as the smooth surface. Above they mirror an evening sky,
below the stripes that car makers judge surfaces by. The energy E, the reflection score (against the smooth surface,
mean over default views) and the reflection variation stand beside each.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass

import torch
from _common import ExperimentConfig, Report, Results, run_experiment, setting
from _layouts import ELONGATED, IRREGULAR, QUADS, layout, meshed_quads
from _mirrors import Mirror, evening_sky, mirror_picture, panel_width, panels, plane_panels, smooth_mirror, striped

from torchfair.energies import normal_variation
from torchfair.meshing import QuadMesh
from torchfair.reflection import ReflectionSetup, SmoothReference, reflection_score
from torchfair.shapes import Catenoid, ShapeMesh
from torchfair.viewing import fit_camera

NAME = "fig01_reflections"
PICTURE = "reflections.png"
SURFACE = Catenoid(1.0, (-1.3, 0.7))
TRIANGLES, MESHED, SMOOTH = "triangle mesh", "principal quads, meshed", "smooth surface"
PANELS = {TRIANGLES: IRREGULAR, "principal-symmetric triangles": ELONGATED, "principal quads": QUADS}
MESHES = {TRIANGLES: "triangles.obj", "principal-symmetric triangles": "principal_symmetric.obj",
          "principal quads": "principal_quads.obj", MESHED: "meshed_quads.obj"}  # fmt: skip


@dataclass(frozen=True)
class Config(ExperimentConfig):
    """Settings of the experiment."""

    rows: int = setting(52, "square root of the number of vertices, about", least=6)
    frequency: float = setting(3.5, "stripe pairs per unit of the mirrored direction", least=0.1)
    size: int = setting(256, "pixels along the pictures that are scored", least=32)
    joints: float = setting(0.35, "opacity of the joints between panels", least=0.0)
    width: int = setting(2600, "columns of pixels of the picture", least=300)


def experiment(config: Config, results: Results) -> Report:
    """Meshes, measures, draws."""
    reference = SmoothReference.of_surface(SURFACE)
    setup = ReflectionSetup.for_reference(reference, size=config.size)
    laid_out = {name: layout(SURFACE, kind, config.rows, config.seed) for name, kind in PANELS.items()}
    meshes: dict[str, ShapeMesh | QuadMesh] = {**laid_out}
    meshes[MESHED] = made = meshed_quads(laid_out[TRIANGLES], config.rows)
    report: dict[str, Report] = {}
    for name, mesh in meshes.items():
        score = reflection_score(mesh.vertices, mesh.topology, setup)
        report[name] = {
            "vertices": mesh.topology.num_vertices,
            "normal_variation": normal_variation(mesh.vertices, mesh.topology),
            "score": score.score,
            "reflection_variation": score.reflection_variation,
            "rms": score.rms,
            "wobble": score.wobble,
        }
        results.mesh(MESHES[name], mesh.vertices, mesh.topology)
        row = report[name]
        print(f"{name}: {row['vertices']} vertices, E {row['normal_variation']:.4g}, score {row['score']:.4f}")
    draw(config, {name: plane_panels(mesh) for name, mesh in meshes.items()} | {SMOOTH: smooth_mirror(reference)},
         report, results)  # fmt: skip
    return {"total_absolute_curvature": SURFACE.total_absolute_curvature(), "meshes": report, "meshing": made.report}


def draw(config: Config, mirrors: dict[str, Mirror], report: dict[str, Report], results: Results) -> None:
    """Two rows of pictures."""
    camera, pixels = fit_camera(
        mirrors[SMOOTH].vertices, towards_eye=torch.tensor([1.0, -0.35, 0.32]), up=torch.tensor([0, 0, 1.0]),
        width=panel_width(config.width, len(mirrors)), margin=0.02,
    )  # fmt: skip
    surroundings = (evening_sky(), striped(torch.tensor([0.0, 0, 1]), config.frequency))
    rows = [[mirror_picture(mirror, camera, pixels, around, joints=config.joints) for mirror in mirrors.values()]
            for around in surroundings]  # fmt: skip
    words = {SMOOTH: f"$C$ = {SURFACE.total_absolute_curvature():.1f}"}
    words |= {name: f"$E$ = {row['normal_variation']:.1f},  score {row['score']:.3f}" for name, row in report.items()}
    sheet = panels(rows, config.width, {name: [words[name]] for name in mirrors})
    sheet.write(results.path(PICTURE), overwrite=results.force)


def main(arguments: list[str] | None = None) -> int:
    """The experiment from the command line."""
    return run_experiment(NAME, __doc__, Config, experiment, [PICTURE, *MESHES.values()], arguments)


if __name__ == "__main__":
    sys.exit(main())
