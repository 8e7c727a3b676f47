"""The device that stands for a GPU in tests refuses what a GPU refuses, and leaves no trace."""

from __future__ import annotations

from collections.abc import Callable

import pytest
import torch
from helpers import DOUBLE
from pretended_device import PRETENDED, PretendedDevice
from torch import Tensor

ROWS = torch.arange(12, dtype=DOUBLE).view(4, 3)

WORKING: dict[str, Callable[[Tensor], Tensor]] = {
    "indices": lambda x: x[torch.arange(2, device=x.device)],
    "numbers": lambda x: torch.where(x > 4.0, 2.0 * x, 0.0),
    "views": lambda x: x.clone().view(2, 6)[:, ::2].add_(1.0).new_zeros(3),
    "function transforms": lambda x: torch.func.vmap(torch.func.jacfwd(lambda row: row * row.sum()))(x),
    "decompositions": lambda x: torch.linalg.eigvalsh(x.T @ x),
}
WAITING: dict[str, Callable[[Tensor], object]] = {
    "item": lambda x: x[0, 0].item(),
    "bool": lambda x: bool((x > 4.0).any()),
    "list": lambda x: x.tolist(),
    "copy": lambda x: x.cpu(),
    "nonzero": lambda x: torch.nonzero(x > 4.0),
    "mask": lambda x: x[x > 4.0],
    "written mask": lambda x: x.clone().index_put_((x > 4.0,), x.new_zeros(())),
    "equal": lambda x: torch.equal(x, x),
    "list as an index": lambda x: x[[0, 2]],
    "constant": lambda x: x * torch.tensor([1.0, 2.0, 3.0], dtype=DOUBLE, device=x.device),
    "new constant": lambda x: x * x.new_tensor([1.0, 2.0, 3.0]),
}
MIXING: dict[str, Callable[[Tensor], object]] = {
    "sum": lambda x: x + ROWS,
    "index": lambda x: x[torch.arange(2)],
    "number": lambda x: x * torch.tensor(2.0),
    "indexed": lambda x: ROWS[torch.arange(2, device=x.device)],
}


@pytest.mark.parametrize("function", WORKING.values(), ids=WORKING)
def test_computes_with_the_values_of_the_cpu(function: Callable[[Tensor], Tensor]) -> None:
    with PretendedDevice() as device:
        there = ROWS.to(PRETENDED)
        with PretendedDevice(strict=True):
            found = function(there)
        assert found.device == PRETENDED
        torch.testing.assert_close(found.cpu(), function(ROWS))
    assert device.waits == ["aten._to_copy.default"] * 2  # there and back


def test_differentiates() -> None:
    with PretendedDevice():
        there = ROWS.to(PRETENDED)
        with PretendedDevice(strict=True):
            variable = there.requires_grad_()
            variable[1:].square().sum().backward()
        assert variable.grad.device == PRETENDED
        assert torch.equal(variable.grad[1:].cpu(), 2 * ROWS[1:])


@pytest.mark.parametrize("function", WAITING.values(), ids=WAITING)
def test_refuses_to_wait_where_it_is_strict_and_counts_where_not(function: Callable[[Tensor], object]) -> None:
    with PretendedDevice():
        there = ROWS.to(PRETENDED)
        with PretendedDevice() as device:
            function(there)
        assert device.waits
        with PretendedDevice(strict=True), pytest.raises(RuntimeError, match=r"waits for values|a tensor on the CPU"):
            function(there)


@pytest.mark.parametrize("function", MIXING.values(), ids=MIXING)
@pytest.mark.parametrize("strict", [False, True])
def test_refuses_tensors_of_two_devices(function: Callable[[Tensor], object], strict: bool) -> None:
    with PretendedDevice():
        there = ROWS.to(PRETENDED)
        with PretendedDevice(strict=strict), pytest.raises(RuntimeError, match=r"two devices|a tensor on the CPU"):
            function(there)


def test_leaves_no_trace() -> None:
    with PretendedDevice() as device, device, PretendedDevice(strict=True):
        pass
    assert not torch._C._only_lift_cpu_tensors()
    assert type(torch.tensor([1.0]) + 1.0) is Tensor
