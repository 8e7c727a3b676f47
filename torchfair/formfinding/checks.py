"""What the formfinding jobs ask of their start and of their settings."""

from __future__ import annotations

import math
from collections.abc import Sequence

import torch
from torch import Tensor

from .._names import PlacedError, few
from .._numbers import is_number
from ..errors import SettingsError, ShapeError
from ..geometry import degenerate_faces
from ..topology import Topology


def one_start(vertices: Tensor, topology: Topology) -> Tensor:
    """The start (V, 3) as float64 on the CPU.

    Raises:
        ShapeError: vertices are not ``(V, 3)``.
    """
    topology.check_vertices(vertices)
    if vertices.ndim != 2:
        raise ShapeError("vertices", f"({topology.num_vertices}, 3), one mesh", tuple(vertices.shape))
    return vertices.detach().to("cpu", torch.float64)


def refuse_degenerate_faces(vertices: Tensor, topology: Topology) -> None:
    """Raises MeshError naming the first faces of a mesh (V, 3) that have no area."""
    bad = torch.nonzero(degenerate_faces(vertices, topology)).squeeze(1).tolist()
    if bad:
        raise PlacedError(
            f"{len(bad)} face(s) have no area: faces ",
            few("face", bad),
            ". torchfair.repair_mesh (--repair) drops them; or move their vertices apart first.",
        )


def check_choice(settings: object, name: str, allowed: Sequence[str]) -> None:
    """Raises SettingsError unless the attribute ``name`` of the settings is one of the words ``allowed``."""
    value = getattr(settings, name)
    if value not in allowed:
        raise SettingsError(f"{name} must be one of {', '.join(allowed)}, got {value!r}")


def check_weights(settings: object) -> None:
    """Raises SettingsError if a weight among the settings is no number, negative, infinite or NaN."""
    weights = {name: value for name, value in vars(settings).items() if name.endswith("_weight")}
    wrong = [
        f"{name}={value!r}" for name, value in weights.items() if not (is_number(value) and 0.0 <= value < math.inf)
    ]
    if wrong:
        raise SettingsError(f"weights must be at least 0: {', '.join(wrong)}; give finite numbers")
