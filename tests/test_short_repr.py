"""Results say in a line what they are, and in a notebook with a picture."""

from __future__ import annotations

import base64
import io
import re
from collections.abc import Callable
from dataclasses import dataclass, field

import pytest
import torch
from helpers import wavy_grid
from PIL import Image

from torchfair import repair_mesh
from torchfair._short_repr import short_repr
from torchfair.formfinding import FairSettings, JobResult, Level, minimise_normal_variation
from torchfair.formfinding.job import notebook
from torchfair.io import PolygonMesh
from torchfair.meshing import principal_quads
from torchfair.projection import ProjectionSettings, Status
from torchfair.reflection import reflection_score
from torchfair.shapes import Torus, irregular_triangles


@pytest.fixture(scope="module")
def result() -> JobResult[Level]:
    settings = FairSettings(projection=ProjectionSettings(max_iterations=3))
    return minimise_normal_variation(*wavy_grid(6, 7), settings=settings)


def quads() -> object:
    mesh = irregular_triangles(Torus(2.0, 0.8), 500)
    return principal_quads(mesh.vertices, mesh.topology, count=150)


LARGE: dict[str, Callable[[], object]] = {
    "mesh of a file": lambda: PolygonMesh(*wavy_grid(20, 20)),
    "shape": lambda: irregular_triangles(Torus(2.0, 0.8), 300),
    "repaired": lambda: repair_mesh(wavy_grid(9, 9)[0], wavy_grid(9, 9)[1].face_lists()),
    "score": lambda: reflection_score(*wavy_grid(6, 6), size=32),
    "quads": quads,
}


@pytest.mark.parametrize("name", LARGE)
def test_large_objects_have_a_short_repr(name: str) -> None:
    words = repr(LARGE[name]())
    assert len(words) < 400
    assert "tensor(" not in words
    assert "\n" not in words


def test_a_result_says_what_was_reached(result: JobResult[Level]) -> None:
    words = repr(result)
    energies = f"E {result.before['normal_variation']:.5g} -> {result.after['normal_variation']:.5g}"
    assert words.startswith(
        f"JobResult({result.topology.num_vertices} vertices, {result.topology.num_faces} faces, {energies}, "
    )
    kept = sum(promise.holds for promise in result.promises)
    assert f"{kept} of {len(result.promises)} promises kept, {result.steps} steps" in words
    for part in (result.levels[0], result.projection):
        assert len(repr(part)) < 400
    assert f"status={result.projection.status.name}" in repr(result.projection)


def test_every_kind_of_field_is_short() -> None:
    @dataclass
    class Thing:
        number: float = 1.5
        tensor: torch.Tensor = field(default_factory=lambda: torch.zeros(3, 2))
        scalar: torch.Tensor = field(default_factory=lambda: torch.tensor(0.25))
        words: str = "w" * 500
        few: tuple[int, ...] = (1, 2)
        many: list[int] = field(default_factory=lambda: [7] * 500)
        table: dict[int, int] = field(default_factory=lambda: dict.fromkeys(range(100), 0))
        status: Status = Status.SETTLED
        hidden: int = field(default=3, repr=False)
        __repr__ = short_repr

    assert repr(Thing()) == (
        f"{Thing.__name__}(number=1.5, tensor=<float32 (3, 2)>, scalar=0.25, words='{'w' * 57}...', few=(1, 2), "
        "many=<500 int>, table=<100 entries>, status=SETTLED)"
    )


def test_a_notebook_shows_figures_promises_and_a_picture(result: JobResult[Level]) -> None:
    page = result._repr_html_()
    assert "<th>normal variation</th>" in page
    assert f"<td>{result.before['normal_variation']:.5g}</td><td>{result.after['normal_variation']:.5g}</td>" in page
    assert page.count("<li>") == len(result.promises) + len(result.notes)
    (data,) = re.findall(r"base64,([^\"]+)", page)
    with Image.open(io.BytesIO(base64.b64decode(data))) as picture:
        assert picture.width == 800
        assert len(picture.convert("RGB").getcolors(1 << 24)) > 50


def test_what_is_said_cannot_become_a_part_of_the_page(
    result: JobResult[Level], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(notebook, "_MOST_FACES", 10)
    page = JobResult(result.levels, ["<script>alert(1)</script>"], True)._repr_html_()
    assert "<script>" not in page
    assert "&lt;script&gt;" in page
    assert "<img" not in page
    assert ", stopped)" in page
