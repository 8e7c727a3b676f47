"""The one place where a step of the solver leaves the device of its state: the search for closest points.

The search runs on the CPU, with NumPy. PyTorch sees it as one operator, ``torchfair::closest``, of which it knows the
shapes, dtypes and device of the answer and nothing else: so fake tensors pass through it. On another device it is a
synchronisation, once for each state: points are copied to the CPU and answers back.

Operators take tensors and numbers, no objects. So a searcher is named by the number of its object (``id``), which is
looked up while the searcher itself waits for the answer; searchers may be copied and pickled, and hold no number.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, Literal, Protocol
from weakref import WeakValueDictionary

import torch
from torch import Tensor

from ._closest_boxes import Floats, Ints
from ._closest_points import check_points, to_columns, to_tensor

Kind = Literal["vector", "number", "index"]


class Searcher(Protocol):
    """What finds closest points.

    Attributes:
        _answer: what it finds for each point: a vector (3,), a number, or an index.
    """

    _answer: ClassVar[tuple[Kind, ...]]

    def _search(self, points: Floats, owners: Tensor | None) -> Sequence[Floats | Ints]:
        """For points (3, N): vectors (N, 3), numbers (N,) and indices (N,), in the order of ``_answer``."""
        ...


_SEARCHERS: WeakValueDictionary[int, Searcher] = WeakValueDictionary()


def ask(searcher: Searcher, points: Tensor, owners: Tensor | None = None) -> list[Tensor]:
    """What ``searcher`` finds for ``points`` (N, 3), on their device and in their dtype, without gradients.

    Args:
        searcher: what finds it.
        points: anywhere, not checked yet.
        owners: (N,) handed on to the searcher.

    Raises:
        ShapeError: if ``points`` is not a floating tensor (N, 3).
        MeshError: if a coordinate is not finite or beyond 1e70.
    """
    check_points(points, "points")
    _SEARCHERS[id(searcher)] = searcher
    found: list[Tensor] = torch.ops.torchfair.closest.default(points.detach(), owners, id(searcher))
    return found


def _closest(points: Tensor, owners: Tensor | None, searcher: int) -> list[Tensor]:
    found = _SEARCHERS[searcher]._search(to_columns(points, "points"), owners)
    return [to_tensor(values, points) for values in found]


def _closest_shapes(points: Tensor, owners: Tensor | None, searcher: int) -> list[Tensor]:
    count, dtypes = points.shape[0], {"index": torch.int64}
    return [
        points.new_empty((count, 3) if kind == "vector" else (count,), dtype=dtypes.get(kind, points.dtype))
        for kind in _SEARCHERS[searcher]._answer
    ]


# Not by torch.library.custom_op, which is another 20 microseconds slower in every call.
torch.library.define("torchfair::closest", "(Tensor points, Tensor? owners, int searcher) -> Tensor[]")
torch.library.impl("torchfair::closest", "default", _closest)
torch.library.register_fake("torchfair::closest", _closest_shapes)
