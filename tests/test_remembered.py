"""Quantities that are remembered while a mesh is measured: the same, worked out once, and forgotten at the end."""

from __future__ import annotations

import pytest
import torch
from geometry_meshes import torus
from helpers import wavy_grid
from torch import Tensor

from torchfair import Topology
from torchfair._remembered import is_remembering, remembered, remembering
from torchfair.energies import angle_variation, total_absolute_curvature, willmore_energy
from torchfair.geometry import corner_angles, dihedral_angles, face_normals, tangential_shape_operators
from torchfair.geometry._unit import in_its_unit
from torchfair.measuring import measure_mesh, measurements, worst_edges, worst_panels


@pytest.fixture
def calls() -> list[tuple[object, ...]]:
    return []


@pytest.fixture
def doubled(calls: list[tuple[object, ...]]):
    @remembered
    def twice(vertices: Tensor, topology: Topology | None = None, power: int = 1, *, name: str = "") -> Tensor:
        calls.append((power, name))
        return 2**power * vertices

    return twice


def test_equal_arguments_are_looked_up_and_others_are_not(doubled, calls) -> None:
    vertices, topology = torus()
    other = Topology.from_faces(topology.face_lists())
    with remembering():
        first = doubled(vertices, topology)
        assert doubled(vertices.detach(), topology) is first  # another tensor of the same numbers in memory
        assert len(calls) == 1
        for given, named in (
            ((vertices.clone(), topology), {}),
            ((vertices[1:], topology), {}),
            ((vertices.view(1, -1, 3), topology), {}),
            ((vertices, other), {}),
            ((vertices, topology, 2), {}),
            ((vertices, topology), {"name": "x"}),
            ((vertices, topology), {"name": "y"}),
        ):
            before = len(calls)
            assert doubled(*given, **named) is doubled(*given, **named)
            assert len(calls) == before + 1
        vertices += 1.0  # in place
        assert torch.equal(doubled(vertices, topology), 2 * vertices)


def test_nothing_is_remembered_outside_nor_of_what_is_differentiated(doubled, calls) -> None:
    vertices, topology = torus()
    with remembering():
        doubled(vertices, topology)
        with remembering():  # ends with the outer one
            doubled(vertices, topology)
        doubled(vertices, topology)
        assert len(calls) == 1
        for given in (vertices.clone().requires_grad_(), torch.nn.Parameter(vertices.clone())):
            assert doubled(given, topology) is not doubled(given, topology)
        torch.func.grad(lambda x: doubled(doubled(x)).sum())(vertices)
    assert not is_remembering()
    before = len(calls)
    doubled(vertices, topology), doubled(vertices, topology)
    assert len(calls) == before + 2
    with pytest.raises(ZeroDivisionError), remembering():
        1 / 0  # noqa: B018
    assert not is_remembering()


@pytest.mark.parametrize("size", [1.0, 1e-90, 1e90])
def test_quantities_are_the_same_to_the_last_bit(size: float) -> None:
    for vertices, topology in (torus(), wavy_grid(5, 6)):
        vertices = size * vertices.double()
        both = vertices, topology
        functions = (
            angle_variation,
            total_absolute_curvature,
            willmore_energy,
            face_normals,
            corner_angles,
            dihedral_angles,
            lambda *given: tangential_shape_operators(*given, sine=False),
            tangential_shape_operators,
            lambda *given: tangential_shape_operators(*given, estimator="corrected"),
        )
        plain = [function(*both) for function in functions]
        with remembering():
            for _ in range(2):
                assert all(map(torch.equal, (function(*both) for function in functions), plain))
            assert torch.equal(in_its_unit(vertices)[0] * in_its_unit(vertices)[1], vertices)


def test_measures_are_those_without_and_normals_are_worked_out_once(monkeypatch: pytest.MonkeyPatch) -> None:
    vertices, topology = wavy_grid(6, 7)
    vertices = vertices.double()
    found = measure_mesh(vertices, topology), worst_edges(vertices, topology, 5), worst_panels(vertices, topology, 5)
    assert not is_remembering()
    from contextlib import nullcontext

    from torchfair.measuring import element_measures

    for module in (measurements, element_measures):
        monkeypatch.setattr(module, "remembering", nullcontext)
    assert found == (
        measure_mesh(vertices, topology),
        worst_edges(vertices, topology, 5),
        worst_panels(vertices, topology, 5),
    )
