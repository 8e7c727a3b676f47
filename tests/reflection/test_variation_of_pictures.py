"""The closed form of the reflection variation is the total variation of rendered pictures."""

from __future__ import annotations

import math

import pytest
import torch
from helpers import DOUBLE

from torchfair.reflection import OrthographicCamera, edge_visibility, reflection_variation, render_reflection
from torchfair.shapes import PrincipalParaboloid, irregular_triangles, principal_quads, principal_triangles

SADDLE = PrincipalParaboloid(1.0, -0.5, (0.8, 0.8))
VIEW = torch.tensor([0.2, 0.1, -1.0], dtype=DOUBLE)
ROLLS = 12
HALF_WIDTH = 1.3


def variation_of_pictures(vertices, topology, size):
    """By Cauchy and Crofton: pi/2 times the mean over rolls of the camera of the jumps along its rows."""
    turns = torch.arange(ROLLS, dtype=DOUBLE) * (math.pi / ROLLS) + 0.1
    ups = torch.stack([turns.cos(), turns.sin(), torch.zeros_like(turns)], dim=-1)
    camera = OrthographicCamera(VIEW.expand(ROLLS, 3), half_widths=HALF_WIDTH, ups=ups)
    picture = render_reflection(vertices, topology, camera, lambda r: r, size=size)
    jumps = picture.image.diff(dim=-1).norm(dim=1)
    inside = (picture.coverage[..., 1:] == 1) & (picture.coverage[..., :-1] == 1)
    per_roll = (jumps * inside).sum((-2, -1)) * (2 * HALF_WIDTH / size)
    return math.pi / 2 * per_roll.mean()


@pytest.mark.parametrize("mesh", [
    lambda: irregular_triangles(SADDLE, 90),
    lambda: principal_quads(SADDLE, 8, 8),
    lambda: principal_triangles(SADDLE, 8, 8, along="v"),
], ids=["irregular", "quads", "principal-symmetric"])  # fmt: skip
def test_variation_of_pictures_tends_to_the_closed_form(mesh):
    vertices, topology = mesh().vertices, mesh().topology
    shares = edge_visibility(vertices, topology, OrthographicCamera(VIEW, half_widths=HALF_WIDTH))
    exact = reflection_variation(vertices, topology, VIEW[None], visibility=shares)[0]
    coarse, fine = (variation_of_pictures(vertices, topology, size) for size in (160, 320))
    assert abs(fine / exact - 1) < 0.06
    assert abs(fine / exact - 1) < 0.7 * abs(coarse / exact - 1)
    assert (2 * fine - coarse) / exact == pytest.approx(1, abs=0.02)  # the error is of first order
