"""Work on parts of a large mesh that do not depend on each other, some of them at the same time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

import torch
from torch import Tensor

from ._threads import allowed_threads
from ._tracing import is_recorded, is_transformed

Item = TypeVar("Item")
Result = TypeVar("Result")

_LEAST = 20_000  # vertices of all parts together, as many as other work has threads for
_MOST = 4  # threads: short operations wait for the interpreter beyond


def side_by_side(function: Callable[[Item], Result], items: Sequence[Item], vertices: Tensor) -> list[Result]:
    """What a function says of each item, in their order, worked out by as many threads as torch is allowed.

    Operations on parts that fit into the cache are too short for the threads of torch itself, so each thread here
    works on a part of its own. One after the other they are taken where something follows the computation from outside
    (derivatives, transforms, recordings, modes of torch), and on small meshes and other devices.

    Args:
        function: may write to rows of common tensors that belong to its item alone.
        items: parts of the mesh.
        vertices: what the parts are of; derivatives through it are looked for.

    Raises:
        What ``function`` raises, for the first item of which it does; items that were not begun are left out then, and
        on an interrupt.
    """
    workers = _workers(len(items), vertices)
    if workers < 2:
        return [function(item) for item in items]
    inference, recording, before = torch.is_inference_mode_enabled(), torch.is_grad_enabled(), torch.get_num_threads()

    def of_one(item: Item) -> Result:
        with torch.inference_mode(inference), torch.set_grad_enabled(recording and not inference):
            return function(item)

    pool = ThreadPoolExecutor(workers, "torchfair", torch.set_num_threads, (1,))
    try:
        return list(pool.map(of_one, items))
    finally:
        try:
            pool.shutdown(cancel_futures=True)
        finally:  # of a second interrupt, too
            torch.set_num_threads(before)


def _workers(items: int, vertices: Tensor) -> int:
    """How many threads there are to be."""
    if torch.compiler.is_compiling() or vertices.shape[-2] < _LEAST or vertices.device.type != "cpu":
        return 1
    return 1 if _is_followed(vertices) else min(allowed_threads(), items, _MOST)


def _is_followed(vertices: Tensor) -> bool:
    """Whether derivatives, transforms, recordings or modes of torch follow what is computed in this thread."""
    return (
        (vertices.requires_grad and torch.is_grad_enabled())
        or is_transformed()
        or is_recorded()
        or torch._C._len_torch_function_stack() > 0
        or torch.is_autocast_enabled("cpu")
        or torch.autograd.forward_ad._current_level >= 0
    )
