"""Scratch memory for the fast evaluation of the normal variation."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import torch
from torch import Tensor

_ALIGNMENT = 64


class Scratch:
    """Memory kept from one evaluation to the next, about 140 bytes per triangle in float64.

    Asking the operating system for it anew takes longer than all that is then done with it. Only CPU memory
    is kept: other devices have allocators of their own for this. Copies and pickles start without.
    """

    def __init__(self) -> None:
        self._kept: list[Tensor] = []

    def __getstate__(self) -> dict[str, list[Tensor]]:
        return {"_kept": []}

    @contextmanager
    def lend(self, like: Tensor, count: int) -> Iterator[Memory]:
        """At least ``count`` numbers of the dtype and on the device of ``like``, not initialised."""
        try:
            kept = self._kept.pop()  # one step, so that threads do not get the same
        except IndexError:
            kept = like.new_empty(0)
        if kept.dtype != like.dtype or kept.device != like.device or kept.shape[0] < count:
            with torch.inference_mode(False):  # a tensor made in inference mode could not be written to outside
                kept = torch.empty(count, dtype=like.dtype, device=like.device)
        yield Memory(kept)
        if like.is_cpu:
            self._kept[:] = [kept]


_SHARED = Scratch()
_SHARED_CORNERS = 1_000_000


def shared_scratch(num_corners: int) -> Scratch | None:
    """The memory that all meshes of less than a million corners share, None for larger ones.

    A mesh that is evaluated once only, as when its faces change at every step, would spend most of its time on memory
    of its own. What is kept is that of the largest of them, at most some 60 MB in float64 for a single mesh.
    """
    return _SHARED if num_corners < _SHARED_CORNERS else None


class Memory:
    """A flat tensor to be handed out piece by piece."""

    def __init__(self, flat: Tensor) -> None:
        self._rest = flat

    @staticmethod
    def size(*shape: int) -> int:
        """Numbers that :meth:`take` uses up for a piece of this shape."""
        count = torch.Size(shape).numel()
        return count + -count % _ALIGNMENT

    def take(self, *shape: int) -> Tensor:
        """The next piece, of any content."""
        piece = self._rest[: torch.Size(shape).numel()].view(shape)
        self._rest = self._rest[self.size(*shape) :]
        return piece
