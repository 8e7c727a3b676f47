"""Tables that are made once and kept, for training too if they were first asked for in inference mode."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any, TypeVar

import torch

Value = TypeVar("Value")


def cached_table(function: Callable[[Any], Value]) -> cached_property[Value]:
    """``functools.cached_property`` whose tensors are ordinary ones.

    Those made under ``torch.inference_mode`` cannot be used in training ever after.
    """
    return cached_property(torch.inference_mode(False)(function))
