"""Several index tensors as one, which costs processes that hand it on one file instead of many."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import torch
from torch import Tensor


def pack(tensors: Mapping[str, Tensor]) -> dict[str, Any]:
    """``tensors`` of int64 as one flat tensor, of 32 bits where they fit, with the shapes in words."""
    flat = torch.cat([tensor.reshape(-1) for tensor in tensors.values()])
    limit = torch.iinfo(torch.int32).max
    fits = flat.is_meta or flat.numel() == 0 or int(flat.max()) <= limit
    shapes = {name: list(tensor.shape) for name, tensor in tensors.items()}
    return {"packed": flat.int() if fits else flat, "shapes": shapes}


def unpack(state: Mapping[str, Any]) -> dict[str, Tensor]:
    """What :func:`pack` was given."""
    shapes: dict[str, list[int]] = state["shapes"]
    flat: Tensor = state["packed"].long()
    sizes = [torch.Size(shape).numel() for shape in shapes.values()]
    parts = torch.split(flat, sizes)
    # Each with memory of its own: whoever shares one does not share all.
    return {name: part.view(shape).clone() for (name, shape), part in zip(shapes.items(), parts, strict=True)}
