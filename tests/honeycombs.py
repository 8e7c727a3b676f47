"""Hexagons on saddles."""

from __future__ import annotations

import math

import torch
from helpers import DOUBLE
from torch import Tensor

from torchfair import Topology


def honeycomb(amplitude: float) -> tuple[Tensor, Topology]:
    """Seven regular hexagons with sides of 1 on ``z = amplitude (x^2 - y^2)``."""
    places: dict[tuple[float, float], int] = {}
    faces = []
    for q, r in ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1), (1, -1), (-1, 1)):
        centre = math.sqrt(3.0) * (q + 0.5 * r), 1.5 * r
        turns = [math.radians(60.0 * k + 30.0) for k in range(6)]
        corners = [(round(centre[0] + math.cos(t), 9), round(centre[1] + math.sin(t), 9)) for t in turns]
        faces.append([places.setdefault(corner, len(places)) for corner in corners])
    x, y = torch.tensor(list(places), dtype=DOUBLE).unbind(1)
    return torch.stack([x, y, amplitude * (x**2 - y**2)], 1), Topology.from_faces(faces)
