"""Several processes that train one model, as ``torchrun`` starts them; or one."""

from __future__ import annotations

import os
from collections.abc import Callable
from types import TracebackType
from typing import TypeVar

import torch
import torch.distributed as dist
from torch import Tensor, nn

T = TypeVar("T")


class Processes:
    """The processes of a training, connected by gloo, which works on CPUs.

    Attributes:
        rank: number of this one; the first one, 0, writes files.
        count: how many there are.
    """

    def __init__(self, rank: int, count: int) -> None:
        self.rank, self.count = rank, count
        self._mine = False  # whether the connection is to be closed

    @classmethod
    def of_torchrun(cls) -> Processes:
        """Those that torchrun has started, or this one alone."""
        return cls(rank(), int(os.environ.get("WORLD_SIZE", "1")))

    def __enter__(self) -> Processes:
        if self.count > 1 and not dist.is_initialized():
            dist.init_process_group("gloo")
            self._mine = True
        return self

    def __exit__(self, *error: type[BaseException] | BaseException | TracebackType | None) -> None:
        if self._mine:
            dist.destroy_process_group()

    def share(self, model: nn.Module) -> None:
        """Parameters and buffers of the first process for all."""
        if self.count > 1:
            for tensor in model.state_dict().values():
                dist.broadcast(tensor, 0)

    def average_gradients(self, model: nn.Module) -> None:
        """The mean over all processes; a parameter without gradient counts as one of zero."""
        if self.count == 1:
            return
        parameters = [parameter for parameter in model.parameters() if parameter.requires_grad]
        gradients = [torch.zeros_like(p) if p.grad is None else p.grad for p in parameters]
        flat = torch.cat([gradient.flatten() for gradient in gradients])
        dist.all_reduce(flat)
        parts = torch.split(flat / self.count, [parameter.numel() for parameter in parameters])
        for parameter, part in zip(parameters, parts, strict=True):
            parameter.grad = part.view_as(parameter)

    def gather(self, state: Tensor) -> list[Tensor]:
        """A tensor of every process, of the same shape in all."""
        if self.count == 1:
            return [state]
        states = [torch.empty_like(state) for _ in range(self.count)]
        dist.all_gather(states, state)
        return states

    def from_first(self, make: Callable[[], T]) -> T:
        """What the first process makes, in all."""
        if self.count == 1:
            return make()
        box: list[T | None] = [make() if self.rank == 0 else None]
        dist.broadcast_object_list(box, 0)
        return box[0]  # type: ignore[return-value]  # the first one has made it


def rank() -> int:
    """Number of this process among those that torchrun has started, 0 if it is alone."""
    return int(os.environ.get("RANK", "0"))
