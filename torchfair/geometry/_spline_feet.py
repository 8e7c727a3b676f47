"""Feet of perpendiculars on cubic segments: safeguarded Newton steps in a fixed number."""

from __future__ import annotations

import torch
from torch import Tensor

from ._ops import dot, gather

_ARCS = 4  # of a segment, of which the nearest is searched
_STEPS = 7


class SegmentFeet:
    """Nearest places on cubic segments ``a0 + a1 u + a2 u^2 + a3 u^3``, 0 <= u <= 1.

    Half the derivative of the squared distance is a polynomial of fifth degree in u. Its values at the ends of four
    arcs choose one of them, on which it changes its sign; there its root is found by Newton steps, by bisection where
    they lead out of the bracket. Where the distance falls up to an end of the segment, that is the answer.

    Args:
        coefficients: (S, 4, 3).
    """

    def __init__(self, coefficients: Tensor) -> None:
        self._places, a, b, c = coefficients.unbind(1)
        self._derivatives = torch.stack([a, 2.0 * b, 3.0 * c], 1)
        products = [dot(a, a), 3.0 * dot(a, b), 4.0 * dot(a, c) + 2.0 * dot(b, b), 5.0 * dot(b, c), 3.0 * dot(c, c)]
        self._slopes = torch.stack([torch.zeros_like(products[0]), *products], 1)
        u = torch.linspace(0.0, 1.0, _ARCS + 1, dtype=coefficients.dtype, device=coefficients.device)
        powers = torch.arange(6, dtype=u.dtype, device=u.device)[:, None]
        self._ends, self._values = u, u**powers
        self._integrals = 2.0 * u ** (powers + 1.0) / (powers + 1.0)

    def nearest(self, points: Tensor, segments: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """For ``points`` (N, 3) on ``segments`` (N, k): u, squared distances, half their slopes there; all (N, k)."""
        away = gather(self._places, segments) - points[:, None]
        derivatives = gather(self._derivatives.flatten(1), segments).view(*segments.shape, 3, 3)
        beside = (derivatives @ away[..., None]).squeeze(-1)
        slopes = gather(self._slopes, segments) + torch.nn.functional.pad(beside, (0, 3))
        base = dot(away, away)
        low, high = self._bracket(slopes, base)
        u = self._root(slopes.unbind(-1), low, high)
        return u, base + 2.0 * _integral(slopes.unbind(-1), u), _horner(slopes.unbind(-1), u)

    def _bracket(self, slopes: Tensor, base: Tensor) -> tuple[Tensor, Tensor]:
        """Ends of the arc that goes down from the best of the samples; both are an end of the segment if none does."""
        at_ends = slopes @ self._values
        best = (base[..., None] + slopes @ self._integrals).argmin(-1, keepdim=True)
        falls = at_ends.gather(-1, best) < 0.0
        low = (best - (~falls).long()).clamp_min(0)
        high = (best + falls.long()).clamp_max(_ARCS)
        return self._ends[low.squeeze(-1)], self._ends[high.squeeze(-1)]

    def _root(self, slopes: tuple[Tensor, ...], low: Tensor, high: Tensor) -> Tensor:
        """Where the slope becomes zero from below between ``low`` and ``high``."""
        at_low, at_high = _horner(slopes, low), _horner(slopes, high)
        rise = at_high - at_low
        u = torch.where(rise > 0.0, low - at_low * (high - low) / rise, 0.5 * (low + high)).clamp(low, high)
        for _ in range(_STEPS):
            value, rise = _horner(slopes, u), _rise(slopes, u)
            low, high = torch.where(value < 0.0, u, low), torch.where(value < 0.0, high, u)
            step = u - value / rise
            inside = (rise > 0.0) & (step >= low) & (step <= high)
            u = torch.where(inside, step, 0.5 * (low + high))
        return u


def _horner(f: tuple[Tensor, ...], u: Tensor) -> Tensor:
    return f[0] + u * (f[1] + u * (f[2] + u * (f[3] + u * (f[4] + u * f[5]))))


def _rise(f: tuple[Tensor, ...], u: Tensor) -> Tensor:
    return f[1] + u * (2.0 * f[2] + u * (3.0 * f[3] + u * (4.0 * f[4] + u * (5.0 * f[5]))))


def _integral(f: tuple[Tensor, ...], u: Tensor) -> Tensor:
    parts = f[3] / 4.0 + u * (f[4] / 5.0 + u * f[5] / 6.0)
    return u * (f[0] + u * (f[1] / 2.0 + u * (f[2] / 3.0 + u * parts)))
