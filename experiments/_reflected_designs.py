"""Reflections of the levels of a design beside a smooth reference."""

from __future__ import annotations

from typing import Protocol

import torch
from _common import Report, Results
from _mirrors import Mirror, mirror_picture, panel_width, panels, smooth_mirror, striped
from torch import Tensor

from torchfair import Topology
from torchfair.cameras import Camera
from torchfair.energies import normal_variation
from torchfair.reflection import ReflectionSetup, SmoothReference, reflection_score
from torchfair.subdivision import loop
from torchfair.viewing import ViewDirection, fit_camera

Mesh = tuple[Tensor, Topology]
SMOOTH = "smooth reference"
WAVES = torch.tensor([0.6, 0.35, 0.8])
_PANEL = 0.68  # height over width


class Look(Protocol):
    """Settings of pictures with reflections."""

    @property
    def frequency(self) -> float:
        """Stripe pairs per unit of the mirrored direction."""

    @property
    def joints(self) -> float:
        """Opacity of the joints between panels."""

    @property
    def width(self) -> int:
        """Columns of pixels."""


def smooth_surface(vertices: Tensor, topology: Topology, times: int) -> SmoothReference:
    """A triangle mesh refined by Loop subdivision, with vertex normals."""
    for _ in range(times):
        step = loop(topology)
        vertices, topology = step.apply(vertices), step.topology
    return SmoothReference.of_mesh(vertices, topology)


def reflection_scores(meshes: dict[str, Mesh], reference: SmoothReference, size: int) -> Report:
    """E and the reflection score of every mesh, from pictures of ``size`` pixels along each side."""
    setup = ReflectionSetup.for_reference(reference, size=size)
    table: Report = {}
    for name, (vertices, topology) in meshes.items():
        score = reflection_score(vertices, topology, setup)
        table[name] = {
            "vertices": topology.num_vertices,
            "normal_variation": float(normal_variation(vertices, topology)),
            "score": float(score.score),
            "rms": float(score.rms),
        }
        row = table[name]
        print(f"{name}: E {row['normal_variation']:.3f}, reflection score {row['score']:.4f}", flush=True)
    return table


def draw_reflections(
    file: str,
    meshes: dict[str, Mesh],
    reference: SmoothReference,
    cameras: list[tuple[Camera, tuple[int, int]]],
    captions: dict[str, list[str]],
    look: Look,
    results: Results,
) -> None:
    """A column for every mesh and the smooth reference, a row for every camera and its picture size."""
    mirrors = [*(Mirror(*mesh) for mesh in meshes.values()), smooth_mirror(reference)]
    stripes = striped(WAVES, look.frequency)
    pictures = [
        [mirror_picture(mirror, *camera, stripes, joints=look.joints) for mirror in mirrors] for camera in cameras
    ]
    panels(pictures, look.width, captions).write(results.path(file), overwrite=results.force)


def whole_and_near(
    reference: SmoothReference, near: Tensor, view: ViewDirection, width: int, columns: int
) -> list[tuple[Camera, tuple[int, int]]]:
    """Cameras that see the whole surface, and the vertices of the mask ``near``, each with the size of its picture."""
    panel = panel_width(width, columns)
    towards, up = view
    height = round(_PANEL * panel)
    whole = fit_camera(reference.vertices, towards_eye=towards, up=up, width=panel, height=height, margin=0.02)
    chosen = reference.vertices[near]
    return [whole, fit_camera(chosen, towards_eye=towards, up=up, width=panel, height=height, margin=0.0)]


def is_inside(reference: SmoothReference) -> Tensor:
    """(V,) bool: vertices of a ring around the z-axis whose normals point to the axis."""
    level = (reference.normals[:, :2] * reference.vertices[:, :2]).sum(1)
    return level < 0
