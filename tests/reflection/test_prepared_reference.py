"""The reference of scores and losses is rendered once, and its pictures serve every mesh after that."""

from __future__ import annotations

import pytest
import torch
from helpers import DOUBLE

import torchfair.reflection.setup as rendering
from torchfair.reflection import OrthographicCamera, ReflectionLoss, ReflectionSetup, reflection_score
from torchfair.shapes import PrincipalParaboloid, irregular_triangles

SADDLE = PrincipalParaboloid(1.0, -0.5, (0.8, 0.8))
CAMERA = OrthographicCamera(torch.tensor([[0.1, 0.2, -1.0], [-0.3, 0.1, -1]], dtype=DOUBLE), half_widths=1.1)


@pytest.fixture
def rendered(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Shadings of all pictures that are rendered, in order."""
    shadings: list[str] = []
    one, several = rendering.render_reflection, rendering.render_shadings

    def counting(*arguments: object, **options: object) -> object:
        shadings.append(str(options.get("shading", "flat")))
        return one(*arguments, **options)

    def counting_several(*arguments: object) -> object:
        shadings.extend(arguments[-1])
        return several(*arguments)

    monkeypatch.setattr(rendering, "render_reflection", counting)
    monkeypatch.setattr(rendering, "render_shadings", counting_several)
    return shadings


def setup(**options: object) -> ReflectionSetup:
    return ReflectionSetup.for_reference(SADDLE, camera=CAMERA, size=64, supersampling=2, **options)


def test_scores_in_one_setup(rendered: list[str]) -> None:
    chosen = setup()
    assert rendered == ["smooth"]  # the probe that chooses the frequency of the stripes
    scores = []
    for number in (40, 60, 40):
        mesh = irregular_triangles(SADDLE, number)
        scores.append(reflection_score(mesh.vertices, mesh.topology, chosen).score)
    assert sorted(rendered[1:]) == ["flat", "flat", "flat", "smooth"]
    assert scores[0] == scores[2] != scores[1]
    reflection_score(mesh.vertices.float(), mesh.topology, chosen)  # in another precision, too
    assert rendered[5:] == ["flat"]


@pytest.mark.parametrize("size", [64, 48])
def test_a_loss_takes_the_pictures_that_its_setup_has(rendered: list[str], size: int) -> None:
    chosen, mesh = setup(frequency=1.5), irregular_triangles(SADDLE, 40)
    reflection_score(mesh.vertices, mesh.topology, chosen)
    rendered.clear()
    loss = ReflectionLoss(mesh.topology, chosen, size=size)
    assert rendered == ([] if size == 64 else ["smooth"])  # other pixels need other pictures
    rendered.clear()
    for step in range(3):
        vertices = (mesh.vertices + 0.01 * step).requires_grad_()
        loss(vertices).backward()
    assert rendered == ["flat"] * 3


def test_only_a_mesh_without_reference_is_its_own(rendered: list[str]) -> None:
    chosen, mesh = setup(frequency=1.5).without_reference(), irregular_triangles(SADDLE, 40)
    loss = ReflectionLoss(mesh.topology, chosen, size=48)
    assert rendered == []
    loss(mesh.vertices)
    assert sorted(rendered) == ["flat", "smooth"]
