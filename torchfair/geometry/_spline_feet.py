"""Feet of perpendiculars on cubic segments: safeguarded Newton steps in a fixed number."""

from __future__ import annotations

import torch
from torch import Tensor

from ._ops import dot, gather

_ARCS = 8  # of a segment, of which the nearest is searched
_STEPS = 6
_ROUNDING = 1e-14


class SegmentFeet:
    """Nearest places on cubic segments ``a0 + a1 u + a2 u^2 + a3 u^3``, 0 <= u <= 1.

    Half the derivative of the squared distance is a polynomial of fifth degree in u. Its values at the ends of eight
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
        whole = gather(self._slopes, segments) + torch.nn.functional.pad(beside, (0, 3))
        base = dot(away, away)
        low, high = self._bracket(whole, base)
        slopes = [part.contiguous() for part in whole.unbind(-1)]
        u = self._root(slopes, low, high)
        # Not by the polynomial of squared distances: near the curve that would be all rounding.
        terms = [part / number for number, part in enumerate(derivatives.unbind(-2), 1)]
        offset = _polynomial([away, *terms], u[..., None])
        return u, dot(offset, offset), _polynomial(slopes, u)

    def _bracket(self, slopes: Tensor, base: Tensor) -> tuple[Tensor, Tensor]:
        """Ends of the arc that goes down from the best of the samples; both are an end of the segment if none does."""
        at_ends = slopes @ self._values
        best = (base[..., None] + slopes @ self._integrals).argmin(-1, keepdim=True)
        falls = at_ends.gather(-1, best) < 0.0
        low = (best - (~falls).long()).clamp_min(0)
        high = (best + falls.long()).clamp_max(_ARCS)
        return self._ends[low.squeeze(-1)], self._ends[high.squeeze(-1)]

    def _root(self, slopes: list[Tensor], low: Tensor, high: Tensor) -> Tensor:
        """Where the slope becomes zero from below between ``low`` and ``high``."""
        rises = [number * part for number, part in enumerate(slopes)][1:]
        at_low, at_high = _polynomial(slopes, low), _polynomial(slopes, high)
        secant = low - at_low * (high - low) / (at_high - at_low)
        u = torch.where(at_high > at_low, secant.clamp(low, high), torch.lerp(low, high, 0.5))
        for _ in range(_STEPS):
            value, rise = _polynomial(slopes, u), _polynomial(rises, u)
            falls = value < 0.0
            low, high = torch.where(falls, u, low), torch.where(falls, high, u)
            # Where the slope does not rise, the step leads out of the bracket, or is not finite.
            step = torch.addcdiv(u, value, rise, value=-1.0)
            u = torch.where(step == step.clamp(low, high), step, torch.lerp(low, high, 0.5))
        u = torch.where(u < _ROUNDING, 0.0, u)
        return torch.where(u > 1.0 - _ROUNDING, 1.0, u)


def _polynomial(coefficients: list[Tensor], u: Tensor) -> Tensor:
    """Horner's rule, lowest power first."""
    value = coefficients[-1]
    for coefficient in reversed(coefficients[:-1]):
        value = torch.addcmul(coefficient, value, u)
    return value
