"""The law of reflection."""

from __future__ import annotations

from torch import Tensor

from ..geometry._ops import dot


def mirror_directions(directions: Tensor, normals: Tensor) -> Tensor:
    """Mirrored directions ``r = d - 2 (d.n) n``.

    Args:
        directions: unit vectors ``d`` (..., 3) from the eye into the scene.
        normals: unit vectors ``n`` (..., 3) of the mirror, which broadcast with ``directions``. Their sign does not
            matter. The zero vector, the normal of degenerate faces, leaves the direction as it is.

    Returns:
        Unit vectors (..., 3) from the mirror into the scene.
    """
    return directions - 2 * dot(directions, normals)[..., None] * normals
