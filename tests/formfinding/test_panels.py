"""What the job that lowers E takes for planar, flat, small and free, at the bounds themselves."""

from __future__ import annotations

import math

import pytest
import torch
from helpers import DOUBLE, grid_faces, split_quads
from torch import Tensor

from torchfair import Topology
from torchfair.formfinding import FairRecipe, FairSettings, FormRecipe
from torchfair.formfinding.fair.panel_sizes import own_sizes
from torchfair.formfinding.fair.panels import Panels

QUADS = Topology.from_faces(grid_faces(4, 4))
TRIANGLES = Topology.from_faces(split_quads(grid_faces(4, 4)))


def bent(by: float) -> Tensor:
    """A grid with a fold of that slope along a line."""
    x, y = torch.meshgrid(*(torch.arange(4, dtype=DOUBLE),) * 2, indexing="ij")
    return torch.stack([x, y, by * (x - 1).clamp_min(0.0)], -1).reshape(-1, 3)


def warped(by: float) -> Tensor:
    """A flat grid with one vertex above it."""
    vertices = bent(0.0)
    vertices[5, 2] = by
    return vertices


def test_flat_edges_that_are_folded_come_in_stages() -> None:
    panels = Panels(bent(0.0), TRIANGLES, FairSettings(flat="all"), [])
    assert panels.flat.numel()
    assert not panels.come_in_stages(bent(math.tan(math.radians(1.5))))
    assert panels.come_in_stages(bent(math.tan(math.radians(2.5))))


def test_faces_that_became_less_planar_are_not_planar_enough() -> None:
    panels = Panels(warped(0.01), QUADS, FairSettings(), [])
    assert panels.nearly.faces.numel()
    assert panels.are_planar(warped(0.01))
    assert not panels.are_planar(warped(0.012))


def test_weights_make_faces_planar_that_are_as_near_as_they_rise() -> None:
    """A share of a sixth is a power of ten of the weight; a stage that has not come to rest may be ten times behind."""
    panels = Panels(bent(0.0), QUADS, FairSettings(planar="quads"), [])
    for share, largest in ((0.0, 5e-4), (1 / 6, 5e-3), (2 / 6, 5e-2)):
        for factor, may in ((0.9, True), (1.1, False)):
            vertices = warped(0.01)
            vertices[5, 2] *= factor * largest / float(panels.warps(vertices).max())
            assert float(panels.warps(vertices).max()) == pytest.approx(factor * largest, rel=0.01)
            assert panels.may_become_planar(vertices, share) is may
    assert Panels(bent(0.0), QUADS, FairSettings(planar="keep"), []).may_become_planar(warped(1.0), 0.0)


def test_small_faces_may_grow_as_those_of_half_the_mean_area() -> None:
    topology = Topology.from_faces([[0, 1, 2], [0, 2, 3]])
    vertices = torch.tensor([[0.0, 0, 0], [2, 0, 0], [2, 2, 0], [1.9, 2, 0]], dtype=DOUBLE)
    assert own_sizes(vertices, topology).tolist() == pytest.approx([2.0, 0.5 * (2.0 + 0.1) / 2])


def test_a_free_boundary_lets_go_of_handles() -> None:
    settings = FairSettings(boundary="free", flat="none")

    def weighed(handles: dict[int, tuple[float, float, float]]) -> float:
        problem = FairRecipe(bent(0.3), TRIANGLES, settings=settings, handles=handles).problem
        return sum(float(term.element_weights.sum()) for term in problem.free.terms(weight=1.0))

    assert weighed({0: (0.0, 0.0, 1.0), 1: (0.0, 1.0, 1.0)}) == weighed({}) - 2


def test_steps_may_fold_at_will_only_where_no_handle_pulls() -> None:
    vertices = bent(0.3)
    assert FormRecipe(vertices, TRIANGLES).problem.steepest(vertices) == math.pi
    recipe = FormRecipe(vertices, TRIANGLES, handles={5: (1.0, 1.0, 1.0)})
    assert recipe.problem.steepest(vertices) == pytest.approx(math.radians(150.0))
