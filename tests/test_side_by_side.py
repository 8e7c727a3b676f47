"""Parts of a mesh that are worked on at the same time: the same results, errors, modes and numbers of threads."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator

import pytest
import torch
from helpers import wavy_grid
from torch import Tensor

from torchfair import Topology, _side_by_side
from torchfair._side_by_side import side_by_side
from torchfair.geometry import fitted_curvature
from torchfair.stars import classify_stars, pyramid_self_intersections, pyramid_windings

MANY = torch.zeros(40_000, 3)


@pytest.fixture(autouse=True)
def three_threads() -> Iterator[None]:
    before = torch.get_num_threads()
    torch.set_num_threads(3)
    yield
    torch.set_num_threads(before)


def where(_: int) -> int:
    return threading.get_ident()


def test_results_are_in_order_and_come_from_other_threads() -> None:
    places = side_by_side(where, range(50), MANY)
    assert threading.get_ident() not in places
    assert side_by_side(lambda x: x * x, range(50), MANY) == [x * x for x in range(50)]


def test_several_work_at_once() -> None:
    together = threading.Barrier(3, timeout=20)
    assert sorted(side_by_side(lambda _: together.wait(), range(3), MANY)) == [0, 1, 2]


def test_torch_has_one_thread_in_each_and_all_of_them_behind() -> None:
    assert side_by_side(lambda _: torch.get_num_threads(), range(5), MANY) == [1] * 5
    assert torch.get_num_threads() == 3


@pytest.mark.parametrize("mode", [torch.no_grad, torch.enable_grad, torch.inference_mode])
def test_modes_of_gradients_are_those_of_the_caller(mode: Callable[[], torch.no_grad]) -> None:
    def modes(_: int) -> tuple[bool, bool]:
        return torch.is_grad_enabled(), torch.is_inference_mode_enabled()

    with mode():
        assert set(side_by_side(modes, range(5), MANY)) == {modes(0)}


def test_what_follows_a_computation_is_followed() -> None:
    """Derivatives, transforms, dual numbers and modes belong to the thread that they were begun in."""
    alone = [threading.get_ident()] * 3
    seen: list[list[int]] = []

    def note(x: Tensor) -> Tensor:
        seen.append(side_by_side(where, range(3), x))
        return x

    note(MANY.clone().requires_grad_())
    torch.vmap(note)(torch.zeros(2, 40_000, 3))
    torch.func.grad(lambda x: note(x).sum())(MANY)
    torch.autograd.functional.jvp(note, MANY, MANY)
    with torch.autograd.forward_ad.dual_level():
        note(MANY)
    with torch.device("cpu"):
        note(MANY)
    with torch.autocast("cpu", torch.bfloat16):
        note(MANY)
    assert seen
    assert all(threads == alone for threads in seen)
    with torch.no_grad():
        assert side_by_side(where, range(3), MANY.clone().requires_grad_()) != alone


@pytest.mark.parametrize(("vertices", "items"), [(MANY[:100], 3), (MANY, 1)])
def test_little_work_stays_in_its_thread(vertices: Tensor, items: int) -> None:
    assert side_by_side(where, range(items), vertices) == [threading.get_ident()] * items


def test_errors_are_those_of_the_first_and_leave_out_the_rest() -> None:
    begun: list[int] = []

    def fail(item: int) -> None:
        begun.append(item)
        if item in (1, 2):
            raise ValueError(f"item {item}")

    with pytest.raises(ValueError, match="item 1"):
        side_by_side(fail, range(10_000), MANY)
    assert len(begun) < 10_000
    assert torch.get_num_threads() == 3


def test_an_interrupt_leaves_out_the_rest() -> None:
    begun: list[int] = []
    held = threading.Event()

    def wait(item: int) -> None:
        begun.append(item)
        if item == 20:
            os.kill(os.getpid(), signal.SIGINT)
        held.wait(0.05)

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            side_by_side(wait, range(1000), MANY)
    finally:
        signal.signal(signal.SIGINT, before)
    assert len(begun) < 1000
    assert not [thread for thread in threading.enumerate() if thread.name.startswith("torchfair")]


@pytest.mark.parametrize("triangles", [True, False])
def test_stars_and_fits_are_the_same_to_the_bit(triangles: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    vertices, topology = wavy_grid(30, 25, triangles=triangles)
    monkeypatch.setattr("torchfair.stars.classification._CHUNK", 100)
    monkeypatch.setattr("torchfair.stars.pyramid._ROOM", 1000)
    monkeypatch.setattr("torchfair.stars.pyramid._POINTS", 500)
    monkeypatch.setattr("torchfair.geometry.patches._PAIRS", 4000)
    alone = _all_of(vertices, topology)
    monkeypatch.setattr(_side_by_side, "_LEAST", 0)
    for ours, theirs in zip(_all_of(vertices, topology), alone, strict=True):
        assert torch.equal(ours, theirs)


def _all_of(vertices: Tensor, topology: Topology) -> list[Tensor]:
    classes, fit = classify_stars(vertices, topology), fitted_curvature(vertices, topology, rings=2)
    return [
        *(value for value in vars(classes).values() if isinstance(value, Tensor)),
        pyramid_self_intersections(vertices, topology),
        pyramid_windings(vertices, topology),
        fit.operators,
        fit.doubts,
    ]
