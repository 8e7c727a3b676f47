"""Classes whose pickles ``torch.load`` reads with ``weights_only=True``, its default: data that runs no code."""

from __future__ import annotations

from typing import TypeVar

import torch

Kind = TypeVar("Kind", bound=type)


def safe_to_load(kind: Kind) -> Kind:
    """Decorator of such classes."""
    torch.serialization.add_safe_globals([kind])
    return kind
