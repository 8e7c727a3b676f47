"""Commands that are well formed but fit no mesh and no mode."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .commands import CommandRefused
from .document import Document, Place

_FARTHEST = 1e6
"""Sizes of the mesh that a handle may be away."""


def check_vertices(vertices: Sequence[int], document: Document) -> tuple[int, ...]:
    """Numbers of vertices, each once.

    Raises:
        CommandRefused: one is none.
    """
    wrong = [vertex for vertex in vertices if vertex >= document.count]
    if wrong:
        raise CommandRefused(f"vertices are numbered 0 to {document.count - 1}, got {wrong[:5]}")
    return tuple(dict.fromkeys(vertices))


def check_places(places: Mapping[int, Place], document: Document) -> None:
    """Raises CommandRefused where a handle is no vertex, or is to go farther than makes sense."""
    check_vertices(list(places), document)
    size = float(np.linalg.norm(document.start.max(0) - document.start.min(0)))
    away = np.abs(np.array(list(places.values())) - document.origin).max()
    if away > _FARTHEST * size:
        raise CommandRefused(f"a handle may be at most {_FARTHEST:g} sizes of the mesh away")


def check_weights(weights: Mapping[str, float], settings: object) -> Mapping[str, float]:
    """Weights that can be turned, in their ranges.

    Args:
        weights: By name.
        settings: The message ``settings``; None before there is any.

    Raises:
        CommandRefused: one is none, or out of its range.
    """
    known = {weight["name"]: weight for weight in _listed(settings, "weights")}
    for name, value in weights.items():
        if name not in known:
            raise CommandRefused(f"weights are {', '.join(known)}, got {name[:40]!r}")
        least, most = known[name]["least"], known[name]["most"]
        if not least <= value <= most:
            raise CommandRefused(f"the weight {name} goes from {least:g} to {most:g}, got {value:g}")
    return weights


def check_choices(choices: Mapping[str, str], settings: object) -> Mapping[str, str]:
    """Choices that there are.

    Args:
        choices: By name.
        settings: The message ``settings``; None before there is any.

    Raises:
        CommandRefused: one is none.
    """
    known = {choice["name"]: [v["value"] for v in choice["values"]] for choice in _listed(settings, "choices")}
    for name, value in choices.items():
        if name not in known:
            raise CommandRefused(f"choices are {', '.join(known)}, got {name[:40]!r}")
        if value not in known[name]:
            raise CommandRefused(f"{name} is one of {', '.join(known[name])}, got {value[:40]!r}")
    return choices


def _listed(settings: object, name: str) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = settings[name] if isinstance(settings, dict) else []
    return found
