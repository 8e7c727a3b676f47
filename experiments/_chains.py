"""What experiments share that mesh surfaces along their principal directions: stages, their figures and pictures."""

from __future__ import annotations

from typing import NamedTuple

import torch
from _common import Report, Results
from _mirrors import panel_width, panels
from torch import Tensor

from torchfair import Topology
from torchfair.energies import normal_variation
from torchfair.formfinding import planar_quads
from torchfair.geometry import planarity
from torchfair.meshing import QuadMesh, principal_quads
from torchfair.viewing import MeshView, ViewDirection, fit_camera
from torchfair.viewing.shading import shade_faces
from torchfair.viewing.wireframe import quiet_edges

Mesh = tuple[Tensor, Topology]
QUADS, PLANAR = "principal quads", "planar principal quads"


class Chain(NamedTuple):
    """Principal quads of a surface, as they were meshed and made planar, and what was measured and said."""

    meshed: QuadMesh
    planar: QuadMesh
    report: Report

    def meshes(self) -> dict[str, Mesh]:
        """Both by name."""
        return {
            QUADS: (self.meshed.vertices, self.meshed.topology),
            PLANAR: (self.planar.vertices, self.planar.topology),
        }


def chain(surface: Mesh, count: int) -> Chain:
    """Surface, principal quads, planar quads."""
    meshed = principal_quads(*surface, count=count)
    planar, job = planar_quads(meshed, surface)
    said = {"notes": planar.notes, "promises": [str(promise) for promise in job.promises], "holds": job.holds}
    return Chain(meshed, planar, {QUADS: meshed.report, PLANAR: planar.report, **said})


def figures_on(meshed: QuadMesh, vertices: Tensor, topology: Topology) -> Report:
    """E of a mesh, C of the surface of principal quads that it stands for, their ratio, and planarity."""
    energy, floor = float(normal_variation(vertices, topology)), meshed.surface.total_absolute_curvature
    deviation = planarity(vertices, topology)
    return {
        "vertices": topology.num_vertices,
        "faces": topology.num_faces,
        "normal_variation": energy,
        "total_absolute_curvature": floor,
        "variation_over_curvature": energy / floor,
        "planarity_mean": float(deviation.mean()),
        "planarity_max": float(deviation.max()),
    }


def words_of(row: Report) -> list[str]:
    """Two lines under a picture."""
    flat = row["planarity_max"] < 1e-9
    return [
        f"$E$ = {row['normal_variation']:.2f} = {row['variation_over_curvature']:.2f} $C$",
        "plane faces" if flat else f"planarity at most {row['planarity_max']:.1g}",
    ]


def in_words(row: Report) -> str:
    """One line for the console."""
    return (
        f"{row['vertices']} vertices, E {row['normal_variation']:.4g}, C {row['total_absolute_curvature']:.4g}, "
        f"E/C {row['variation_over_curvature']:.4g}, planarity at most {row['planarity_max']:.2g}"
    )


def draw_stages(
    file: str, rows: list[dict[str, Mesh]], captions: dict[str, list[str]], view: ViewDirection, width: int,
    results: Results,
) -> None:  # fmt: skip
    """Meshes shaded with their edges, all seen alike: a column for every stage."""
    every = [mesh for row in rows for mesh in row.values()]
    panel = panel_width(width, len(rows[0]))
    camera, size = fit_camera(*(v for v, _ in every), towards_eye=view.towards_eye, up=view.up, width=panel)
    pictures = []
    for row in rows:
        views = [MeshView(*mesh, camera, size) for mesh in row.values()]
        pictures.append([x.paint(shade_faces(x.vertices, x.topology, camera), edges=quiet_edges(x)) for x in views])
    panels(pictures, width, captions).write(results.path(file), overwrite=results.force)


def direction(*towards_eye: float) -> ViewDirection:
    """A view in which z is up."""
    towards = torch.tensor(towards_eye, dtype=torch.float64)
    return ViewDirection(towards / towards.norm(), torch.tensor([0.0, 0.0, 1.0], dtype=torch.float64))
