"""Where to look from when somebody says what is up, or from where."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from ..errors import TorchfairError
from ..topology import Topology
from .view_direction import ViewDirection, three_quarter_view, view_direction

_AXES = "xyz"
_ISO = (45.0, math.degrees(math.atan(math.sqrt(0.5))))
_TOP = 89.999  # degrees: the direction that is up in the picture stays what it is in others

NAMED = {"front": (0.0, 0.0), "top": (0.0, _TOP), "iso": _ISO}
"""Azimuth and elevation in degrees by name."""


def parse_view(text: str) -> tuple[float, float]:
    """Azimuth and elevation in degrees: ``front``, ``top``, ``iso``, or two numbers such as ``30,20``.

    Raises:
        ValueError: it is neither, or the elevation is beyond 90 degrees.
    """
    if text in NAMED:
        return NAMED[text]
    parts = text.split(",")
    if len(parts) != 2:
        raise ValueError(f"expected {', '.join(NAMED)} or AZ,EL in degrees, got {text!r}")
    azimuth, elevation = map(float, parts)
    if not (math.isfinite(azimuth) and -90.0 <= elevation <= 90.0):
        raise ValueError(f"expected an elevation from -90 to 90 degrees, got {text!r}")
    return azimuth, max(-_TOP, min(_TOP, elevation))


def chosen_view(
    vertices: Tensor, topology: Topology, up: str | None = None, angles: tuple[float, float] | None = None
) -> ViewDirection:
    """The view of one mesh ``(V, 3)`` with an axis up, from a direction.

    From the front one looks along y if z is up, along -z if y is up, and along x if x is up, as CAD programs do.

    Args:
        vertices: (V, 3) positions.
        topology: connectivity.
        up: ``"x"``, ``"y"`` or ``"z"``; by default that of :func:`view_direction`.
        angles: azimuth, anticlockwise from the front as seen from above, and elevation, in degrees; by default a
            three-quarter view.

    Raises:
        TorchfairError: ``up`` is no axis.
    """
    if up is not None and up not in _AXES:
        raise TorchfairError(f"up must be x, y or z, got {up!r}")
    usual = view_direction(vertices, topology)
    upward = usual.up if up is None else torch.eye(3, dtype=torch.float64)[_AXES.index(up)]
    if angles is None:
        return usual if up is None else three_quarter_view(vertices, topology, upward)
    front = _front(upward)
    right = torch.linalg.cross(upward, front)
    azimuth, elevation = map(math.radians, angles)
    level = math.cos(azimuth) * front + math.sin(azimuth) * right
    return ViewDirection(math.cos(elevation) * level + math.sin(elevation) * upward, upward)


def _front(up: Tensor) -> Tensor:
    """Unit direction to the eye from the front, level."""
    guesses = {0: (0.0, -1.0, 0.0), 1: (0.0, 0.0, 1.0), 2: (0.0, -1.0, 0.0)}
    front = torch.tensor(guesses[int(up.abs().argmax())], dtype=torch.float64)
    level: Tensor = front - (front @ up) * up
    return level / float(torch.linalg.vector_norm(level))
