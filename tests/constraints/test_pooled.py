"""Polygons of different sizes as elements of one term are what they are by themselves."""

from __future__ import annotations

import inspect
from collections.abc import Callable

import pytest
import torch
from helpers import DOUBLE, wavy_grid
from torch import Tensor

from torchfair import Topology
from torchfair import constraints as c
from torchfair.constraints import _pooled as module
from torchfair.constraints._pooled import Pooled, pooled, pooled_faces
from torchfair.energies import normal_variation
from torchfair.geometry import face_areas
from torchfair.projection import ElementTerm, GuidedProjection

SIZES = (3, 4, 5, 6, 7)


def fans() -> tuple[Tensor, Topology]:
    """Polygons of many sizes, beside each other in a strip, in generic position: all kinds of pairs."""
    faces, top, bottom = [], [0], [1]
    count = 2
    for size in [*SIZES, *reversed(SIZES), 3, 5, 7, 4, 6, 3]:
        more = [*range(count, count + size - 2)]
        count += size - 2
        upper, lower = (more[0], more[1:]) if size > 3 else (more[0], [])
        faces.append([top[-1], bottom[-1], *lower, upper])
        top.append(upper)
        bottom.append(lower[-1] if lower else bottom[-1])
    generator = torch.Generator().manual_seed(0)
    angle = torch.arange(count, dtype=DOUBLE)
    points = torch.stack([0.7 * angle, (2.1 * angle).sin(), 0.4 * angle.cos()], 1)
    return points + 0.1 * torch.randn(count, 3, dtype=DOUBLE, generator=generator), Topology.from_faces(faces)


Made = Callable[[Tensor, Topology], list[ElementTerm]]
MAKERS: dict[str, Made] = {
    "E": lambda v, t: c.normal_variation_terms(t, smoothing=0.1),
    "areas": lambda v, t: c.face_area_terms(t, 2.5 * face_areas(v, t), weight=0.5),
}


def apart(make: Made, vertices: Tensor, topology: Topology, monkeypatch: pytest.MonkeyPatch) -> list[ElementTerm]:
    """The terms with one for every size."""
    with monkeypatch.context() as patch:
        patch.setattr(module, "_FEW", 0)
        return make(vertices, topology)


@pytest.mark.parametrize("name", MAKERS)
def test_normal_matrix_gradient_and_merit_are_those_of_a_term_for_every_size(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    vertices, topology = fans()
    both = [MAKERS[name](vertices, topology), apart(MAKERS[name], vertices, topology, monkeypatch)]
    assert [len(both[0]), len(both[1]) >= len(SIZES)] == [1, True]
    blocks = {"vertices": vertices}
    systems = []
    for terms in both:
        structure = GuidedProjection(blocks, terms).structure
        system = structure.linearise(blocks)
        systems.append(
            (system.gradient, system.diagonal, structure.evaluate(blocks).merits, _matrix(structure, system))
        )
    for one, other in zip(*systems, strict=True):
        torch.testing.assert_close(one, other, rtol=1e-12, atol=1e-13 * float(other.abs().max()))


def _matrix(structure: object, system: object) -> Tensor:
    lower = structure.lower  # type: ignore[attr-defined]
    columns = torch.repeat_interleave(torch.arange(len(lower.offsets) - 1), torch.as_tensor(lower.offsets).diff())
    dense = torch.zeros(2 * (len(lower.offsets) - 1,), dtype=DOUBLE)
    dense[torch.as_tensor(lower.rows), columns] = system.lower_values  # type: ignore[attr-defined]
    return dense


@pytest.mark.parametrize("name", MAKERS)
def test_closed_forms_are_the_derivatives_of_residuals(name: str) -> None:
    """So what places of one corner have is not lost, and none is counted twice."""
    vertices, topology = fans()
    (term,) = MAKERS[name](vertices, topology)
    arguments = term.arguments({"vertices": vertices})
    _, found = term.linearised(arguments)
    _, expected = term.automatic_derivatives(arguments)
    torch.testing.assert_close(found, expected, rtol=1e-10, atol=1e-12)
    sources = term.data[-1]
    filled = sources != torch.arange(sources.shape[1])
    assert bool(filled.any())
    by_corner = found.view(*found.shape[:2], -1, 3)
    assert not by_corner.transpose(1, 2)[filled].any()
    assert by_corner.transpose(1, 2)[~filled].any()


def test_the_module_is_the_energy_of_edges_of_all_sizes() -> None:
    vertices, topology = fans()
    smooth = c.SmoothNormalVariation(topology, smoothing=1e-12)
    expected = float(normal_variation(vertices, topology))
    assert float(smooth(vertices)) == pytest.approx(expected, rel=1e-9)
    assert not smooth.state_dict()
    assert float(smooth.type(torch.float32).type(DOUBLE)(vertices)) == pytest.approx(expected, rel=1e-9)


def test_only_small_groups_of_few_corners_are_pooled() -> None:
    def group(count: int, *runs: int) -> tuple[Tensor, list[Tensor]]:
        return torch.arange(count), [torch.arange(count * run).view(count, run) for run in runs]

    many, alone = group(256, 2, 1), group(255, 2, 1)
    assert [of.sources for of in pooled([many, alone])] == [None, None]  # one small one is no pool
    whole, pool = pooled([group(3, 2, 1), many, group(2, 2, 3)])
    assert whole.sources is None
    assert pool.runs == [2, 3]
    assert pool.sources is not None
    assert pool.sources.tolist() == [[0, 1, 2, 2, 2]] * 3 + [[0, 1, 2, 3, 4]] * 2
    assert pool.stencil[1].tolist() == [2, 3, 1, 1, 1]
    sizes = [of.stencil.shape[1] for of in pooled([group(2, 16), group(2, 17), group(2, 3)])]
    assert sorted(sizes) == [16, 17]
    assert pooled([]) == []


def test_every_face_is_in_one_group() -> None:
    _, topology = fans()
    numbers = torch.cat([group.numbers for group in pooled_faces(topology)])
    assert numbers.sort().values.tolist() == list(range(topology.num_faces))
    (group,) = pooled_faces(wavy_grid()[1])
    assert group.sources is None


def test_data_have_the_names_that_residuals_give_them() -> None:
    vertices, topology = fans()
    constraint = c.FaceAreas(topology, face_areas(vertices, topology))
    assert list(constraint.state_dict()) == ["parts.0.area"]
    assert list(inspect.signature(Pooled(lambda x, area: x)).parameters) == ["x", "area", "sources"]
