"""Designs with hidden handles, and what they do: a surface through points, a mesh that mirrors stripes."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import torch
from _common import ExperimentConfig, setting
from torch import Tensor

from torchfair import Topology
from torchfair.cameras import OrthographicCamera
from torchfair.curves import ClosedCurve
from torchfair.formfinding import FairRecipe, FairSettings, FormRecipe, FormSettings, JobLayer, start_surface
from torchfair.geometry import ReferenceSurface
from torchfair.reflection import Stripes, cone_directions, render_reflection
from torchfair.shapes import Paraboloid, parameter_quads

FREQUENCY = 1.0
STRIPES = torch.tensor([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], dtype=torch.float64)


@dataclass(frozen=True)
class Config(ExperimentConfig):
    """Settings of the experiment."""

    designs: tuple[str, ...] = setting(("points",), "what is looked for", choices=("points", "reflection"))
    vertices: int = setting(80, "vertices of the surface of least C, about", least=40)
    smoothing: float = setting(
        0.3, "of E, in mean edges, and of C, as a fraction of the mean curvature of a star", least=1e-6
    )
    rows: int = setting(8, "cells along the mesh of least E", least=4)
    handles: int = setting(2, "handles of each design", least=1)
    points: int = setting(8, "points that the surface of least C is to pass through", least=1)
    size: int = setting(64, "pixels along the pictures that are compared", least=16)
    pull: float = setting(0.8, "how far hidden handles are pulled, in mean edges", least=0.01)
    steps: int = setting(20, "steps of Adam", least=1)
    rate: float = setting(0.15, "learning rate at first, in mean edges; falls by a cosine", least=1e-6)
    difference_steps: int = setting(5, "steps of it with finite differences", least=1)
    difference: float = setting(1e-3, "finite differences, in mean edges", least=1e-12)
    tolerance: float = setting(1e-6, "of finished meshes, relative to their extent", least=1e-12)


@dataclass(frozen=True)
class Design:
    """A job with handles, where they are hidden, and what is wanted of the finished mesh.

    Attributes:
        name: Of the design.
        recipe: With handles where they start.
        hidden: (h, 3) targets that do what is wanted.
        loss: Of the finished vertices; 0 at the hidden design.
        points: (n, 3) that the mesh is to pass through, if that is what is wanted.
    """

    name: str
    recipe: FormRecipe | FairRecipe
    hidden: Tensor
    loss: Callable[[Tensor], Tensor]
    points: Tensor | None = None


def hidden_places(vertices: Tensor, chosen: Tensor, reach: float) -> Tensor:
    """Chosen vertices pulled up and sideways, each another way."""
    turn = torch.arange(len(chosen), dtype=vertices.dtype) * 2.4
    ways = torch.stack(
        [0.3 * turn.cos(), 0.3 * turn.sin(), (1.0 + 0.5 * turn.sin()) * (-1.0) ** torch.arange(len(chosen))], 1
    )
    return vertices[chosen] + reach * ways


def spread(vertices: Tensor, topology: Topology, count: int) -> Tensor:
    """Inner vertices far from each other and from the boundary."""
    chosen = torch.nonzero(topology.is_boundary_vertex).squeeze(1)
    picked: list[int] = []
    for _ in range(count):
        picked.append(int(torch.cdist(vertices, vertices[chosen]).amin(1).argmax()))
        chosen = torch.cat([chosen, torch.tensor(picked[-1:])])
    return torch.tensor(sorted(picked))


def through_points(config: Config) -> Design:
    """A ring between two wavy curves, of least C; points where the faces of the hidden design have their centres."""
    vertices, topology = start_surface([wavy_ring(2.0, 0.0), wavy_ring(0.7, 0.7)], config.vertices)
    chosen = spread(vertices, topology, config.handles)
    handles = dict(zip(chosen.tolist(), vertices[chosen].tolist(), strict=True))
    settings = FormSettings(smoothing=config.smoothing, coarse_smoothing=max(0.3, config.smoothing))
    recipe = FormRecipe(vertices, topology, handles=handles, settings=settings)
    hidden = hidden_places(vertices, chosen, config.pull * recipe.unit.length)
    mesh, _ = JobLayer(recipe)({"targets": hidden})
    faces = torch.linspace(0, topology.num_faces - 1, config.points).long()
    points, unit = mesh[topology.triangles[faces]].mean(1), recipe.unit.length

    def loss(found: Tensor) -> Tensor:
        """Mean squared distance of the points from the mesh, in mean edges squared."""
        return ((feet_of(points, found, topology) - points) / unit).square().sum(1).mean()

    return Design("points", recipe, hidden, loss, points)


def feet_of(points: Tensor, vertices: Tensor, topology: Topology) -> Tensor:
    """The places (n, 3) of a mesh of triangles that are closest to the points, functions of its vertices."""
    surface = ReferenceSurface(vertices, topology)
    closest = surface.closest(points)
    return (closest.weights[:, :, None] * vertices[surface.pieces[closest.pieces]]).sum(1)


def wavy_ring(radius: float, height: float) -> ClosedCurve:
    turn = torch.arange(40, dtype=torch.float64) * 2 * math.pi / 40
    return ClosedCurve(torch.stack([radius * turn.cos(), radius * turn.sin(), height + 0.15 * (2 * turn).sin()], dim=1))


def mirroring(config: Config) -> Design:
    """A mesh of quads over a saddle, of least E with its boundary fixed; pictures of the hidden design."""
    mesh = parameter_quads(Paraboloid(0.6, -0.4), config.rows, config.rows)
    vertices, topology = mesh.vertices, mesh.topology
    chosen = spread(vertices, topology, config.handles)
    handles = dict(zip(chosen.tolist(), vertices[chosen].tolist(), strict=True))
    settings = FairSettings(boundary="fixed", smoothing=config.smoothing, distance_limit=None, closeness_weight=0.0)
    recipe = FairRecipe(vertices, topology, handles=handles, settings=settings)
    hidden = hidden_places(vertices, chosen, config.pull * recipe.unit.length)
    wanted, _ = JobLayer(recipe)({"targets": hidden})
    camera = OrthographicCamera.fit(wanted, directions=cone_directions(torch.tensor([0.0, 0.0, 1.0]), 25.0, 4))
    stripes = Stripes(STRIPES, FREQUENCY, 2.0)

    def picture(found: Tensor) -> Tensor:
        return render_reflection(
            found, topology, camera, stripes, size=config.size, antialias=True, shading="smooth"
        ).image

    there = picture(wanted)
    return Design("reflection", recipe, hidden, lambda found: (picture(found) - there).square().mean())
