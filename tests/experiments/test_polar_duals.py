"""Good saddles dualise to simple hexagons where the centre is on one side of their planes."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import torch
from helpers import DOUBLE

from torchfair.io import load_mesh

Run = Callable[..., dict[str, Any]]


def test_simple_faces_of_good_saddles(run: Run, tmp_path: Path) -> None:
    report = run("polar_duals", "--surfaces", "paraboloid", "catenoid", "--rows", "10")
    below, inside = report["all"]["below"], report["all"]["inside"]
    assert below["one_sided"] == below["faces"]
    assert below["disagree"] == inside["disagree"] == 0
    assert below["good saddle"]["simple"] == below["good saddle"]["faces"] > 200
    assert below["good saddle"]["convex_corners"] == pytest.approx(4, abs=0.05)
    assert below["neither"]["simple"] == 0
    assert inside["one_sided"] < inside["faces"]
    assert inside["good saddle"]["simple"] < inside["good saddle"]["faces"]
    dual = load_mesh(tmp_path / "out" / "dual.obj")
    assert dual.topology.face_sizes.unique().tolist() == [6]


def test_polygons_are_judged_in_their_planes(script: Callable[[str], ModuleType]) -> None:
    module = script("polar_duals")
    angles = torch.arange(6, dtype=DOUBLE) * math.pi / 3
    circle = torch.stack([angles.cos(), angles.sin(), 0 * angles], dim=1)
    dented = circle * torch.tensor([1, 0.2, 1, 1, 1, 1], dtype=DOUBLE)[:, None]
    bow = circle[[0, 1, 2, 3, 5, 4]]
    turn, _ = torch.linalg.qr(torch.tensor([[1.0, 2, 3], [0, 1, 4], [5, 6, 0]], dtype=DOUBLE))
    flat = module.flattened(torch.stack([circle, dented, bow]) @ turn + 7.0)
    assert module.is_simple(flat).tolist() == [True, True, False]
    assert module.convex_corners(flat[:2]).tolist() == [6, 5]
    inside = 1.5 * math.sqrt(3)
    lost = math.sqrt(3) / 2 - math.sin(math.pi / 3) * 0.2
    torch.testing.assert_close(
        module.area_shares(flat[:2]), torch.tensor([1.0, (inside - lost) / (inside - math.sqrt(3) / 4)], dtype=DOUBLE)
    )
