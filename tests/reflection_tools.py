"""Cameras, environments and slow references that tests of reflections share."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import torch
from helpers import DOUBLE
from torch import Tensor

from torchfair import Topology
from torchfair.cameras import Camera, OrthographicCamera, PerspectiveCamera
from torchfair.geometry import face_normals, vertex_normals
from torchfair.reflection import Stripes, cone_directions, mirror_directions
from torchfair.triangulation import triangulate

STRIPES = Stripes(torch.tensor([[1.0, 0.3, 0.2], [0.1, -0.4, 1.0]]), 1.0, 2.0)
EACH_KIND: dict[str, type[OrthographicCamera] | type[PerspectiveCamera]] = {
    "parallel": OrthographicCamera,
    "perspective": PerspectiveCamera,
}
VIEWS = cone_directions(torch.tensor([0.3, 0.2, -1.0], dtype=DOUBLE), 120, 3)

each_kind = pytest.mark.parametrize("kind", EACH_KIND.values(), ids=EACH_KIND)


def vector(*numbers: float) -> Tensor:
    return torch.tensor(numbers, dtype=DOUBLE)


def straight_down(half_width: float) -> OrthographicCamera:
    """A parallel view along -z with x to the right and y upwards."""
    return OrthographicCamera(vector(0, 0, -1), vector(0, 0, 0), half_width, vector(0, 1, 0))


def random_soup(count: int, seed: int) -> tuple[Tensor, Topology]:
    """Triangles of all sizes, every one by itself, that hide and penetrate each other."""
    generator = torch.Generator().manual_seed(seed)
    centres = torch.rand(count, 1, 3, dtype=DOUBLE, generator=generator)
    sizes = torch.logspace(-2, -0.5, count, dtype=DOUBLE)[:, None, None]
    corners = centres + sizes * torch.randn(count, 3, 3, dtype=DOUBLE, generator=generator)
    return corners.reshape(-1, 3), Topology.from_faces(np.arange(3 * count).reshape(count, 3))


def ray_cast(vertices: Tensor, topology: Topology, camera: Camera, size: int) -> Tensor:
    """The nearest face along the ray through each pixel centre, -1 for none: (views, size, size)."""
    cut = triangulate(vertices, topology)
    a, b, c = vertices[cut.triangles].unbind(1)
    origins, directions = (part.reshape(-1, 1, 3) for part in camera.rays(size))
    normal = torch.linalg.cross(b - a, c - a)
    facing = (directions * normal).sum(-1)
    distance = ((a - origins) * normal).sum(-1) / facing
    places = origins + distance[..., None] * directions
    inside = torch.ones_like(distance, dtype=torch.bool)
    for start, stop in ((a, b), (b, c), (c, a)):
        inside &= (torch.linalg.cross((stop - start).expand_as(places), places - start) * normal).sum(-1) >= 0
    if camera.central:
        inside &= distance > 0
    distance = torch.where(inside, distance, torch.inf)
    face = torch.where(inside.any(1), cut.faces[distance.argmin(1)], -1)
    return face.view(camera.num_views, size, size)


def exact_functional(
    vertices: Tensor,
    topology: Topology,
    camera: Camera,
    environment: Stripes,
    weight: Callable[[Tensor], Tensor],
    *,
    smooth: bool = False,
) -> Tensor:
    """Integral over the unit picture of ``weight`` times the first channel of the reflection, nothing being hidden.

    Quadrature over every triangle, cut into 16, of degree 5; the points move with the triangle, so that autograd gives
    the exact gradient, the motion of edges included.
    """
    projected = camera.project(vertices, 1)[0][topology.triangles]
    corners = projected[..., :2]
    shares, weights = _quadrature(4)
    places = torch.einsum("qk,fkd->fqd", shares, corners)
    (ax, ay), (bx, by) = ((corners[:, k] - corners[:, 0]).unbind(-1) for k in (1, 2))
    areas = (ax * by - ay * bx).abs() / 2
    normals = face_normals(vertices, topology)[:, None]
    if smooth:
        in_space = shares * -projected[..., 2][:, None] if camera.central else shares
        normals = torch.einsum("...qk,fkd->fqd", in_space, vertex_normals(vertices, topology)[topology.triangles])
        normals = torch.nn.functional.normalize(normals, dim=-1)
    rays = mirror_directions(camera.directions_at(places[None], 1)[0], normals)
    return (areas[:, None] * weights * environment(rays)[..., 0] * weight(places)).sum()


def _quadrature(pieces: int) -> tuple[Tensor, Tensor]:
    """Barycentric coordinates (n, 3) and weights (n,) of the rule of degree 5 on a triangle cut into pieces^2."""
    a, b, c, d = 0.059715871789770, 0.470142064105115, 0.797426985353087, 0.101286507323456
    points = [[1 / 3] * 3, [a, b, b], [b, a, b], [b, b, a], [c, d, d], [d, c, d], [d, d, c]]
    weights = [0.225] + [0.132394152788506] * 3 + [0.125939180544827] * 3
    parts = []
    for i in range(pieces):
        for j in range(pieces - i):
            corners = [(i, j), (i + 1, j), (i, j + 1)]
            parts.append(corners)
            if i + j < pieces - 1:
                parts.append([(i + 1, j), (i + 1, j + 1), (i, j + 1)])
    cells = torch.tensor([[[p / pieces, q / pieces, 1 - (p + q) / pieces] for p, q in part] for part in parts])
    shares = torch.einsum("qk,tkc->tqc", torch.tensor(points, dtype=DOUBLE), cells.to(DOUBLE)).reshape(-1, 3)
    return shares, torch.tensor(weights, dtype=DOUBLE).repeat(len(parts)) / pieces**2


def pixel_places(size: int) -> Tensor:
    """Pixel centres (size, size, 2) of the unit picture."""
    ticks = (torch.arange(size, dtype=DOUBLE) + 0.5) / size
    return torch.stack(torch.meshgrid(ticks, ticks, indexing="xy"), dim=-1)
