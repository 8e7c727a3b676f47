"""Modules that hold numbers of vertices."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor, nn


class IndexedModule(nn.Module):
    """A module with index tensors that follow it to a device.

    They are no buffers, as the topology of :class:`~torchfair.energies.MeshModule` is none: they stay integers under
    ``.type()``, survive ``.to_empty()``, and are not in the ``state_dict``.

    Attributes:
        indices: The tensors.
    """

    indices: tuple[Tensor, ...]

    def __init__(self, *indices: Tensor) -> None:
        super().__init__()
        self.indices = indices

    def _apply(self, fn: Callable[[Tensor], Tensor], recurse: bool = True) -> IndexedModule:
        super()._apply(fn, recurse)  # type: ignore[no-untyped-call]
        # Only the device that fn leads to matters: fn itself might change or drop the indices.
        device = fn(torch.empty(0, dtype=torch.int64, device=self.indices[0].device)).device
        if device.type != "meta":
            self.indices = tuple(index.to(device) for index in self.indices)
        return self
