"""Closed derivatives of the spheres of stars, where speed matters."""

from __future__ import annotations

import torch
from torch import Tensor

from ..geometry._ops import cross, dot, norm


def sphere_derivatives(spokes: Tensor, normals: Tensor, by_normal: Tensor) -> tuple[Tensor, Tensor]:
    """Derivatives by the spokes (n, 4, 3) to cospherical neighbours, from the formulas of ``spheres_through``.

    Returns:
        (n, k, 4, 3) that of ``g . n`` for every g of ``by_normal`` (n, k, 3), with the normal n of the sphere; and
        (n, 4, 3) that of its curvature. Zero where no sphere is determined.
    """
    a, b, c = (spokes[:, i] + spokes[:, i + 1] for i in range(3))
    squares = dot(spokes, spokes)
    p, q, r = (squares[:, i] + squares[:, i + 1] for i in range(3))
    products = torch.stack([cross(b, c), cross(c, a), cross(a, b)], dim=1)
    direction = (torch.stack([p, q, r], dim=1)[..., None] * products).sum(1)
    length = norm(direction)[:, None]
    inverse = torch.where(length > 0, 1.0 / torch.where(length > 0, length, 1.0), 0.0)
    scale = torch.where(dot(direction, normals) < 0, -1.0, 1.0).to(spokes.dtype)[:, None] * inverse
    curvature = 2.0 * scale * dot(a, products[:, 0])[:, None]
    upright = dot(by_normal, normals[:, None])[..., None]
    turned = (by_normal - upright * normals[:, None]) * scale[:, None]
    turned = torch.cat([turned, (-curvature * direction * inverse.square())[:, None]], dim=1)  # (n, k + 1, 3)
    by_squares = dot(turned[:, :, None], products[:, None])[..., None]  # (n, k + 1, 3, 1)
    by_a = _cross(q, turned, c) - _cross(r, turned, b)
    by_b = _cross(r, turned, a) - _cross(p, turned, c)
    by_c = _cross(p, turned, b) - _cross(q, turned, a)
    by_sums = torch.stack([by_a, by_b, by_c], dim=2)
    by_sums[:, -1] += 2.0 * scale[:, None] * products
    total = _of_both(by_sums) + 2.0 * _of_both(by_squares) * spokes[:, None]
    return total[:, :-1], total[:, -1]


def _cross(factor: Tensor, turned: Tensor, vector: Tensor) -> Tensor:
    return cross(turned, (factor[:, None] * vector)[:, None].expand_as(turned))


def _of_both(by_sums: Tensor) -> Tensor:
    """Derivatives (n, k, 3, d) by sums of neighbouring spokes, as derivatives (n, k, 4, d) by the spokes."""
    padded = torch.nn.functional.pad(by_sums, (0, 0, 1, 1))
    return padded[:, :, :-1] + padded[:, :, 1:]
