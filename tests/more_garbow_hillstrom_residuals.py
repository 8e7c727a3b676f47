"""Residuals of the least-squares problems of More, Garbow and Hillstrom (1981), in their order.

Those of data fits are scalar functions of the unknowns and of the data of one row; all others are vectors.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor

ROOT5, ROOT10, ROOT90 = math.sqrt(5), math.sqrt(10), math.sqrt(90)


def count(last: int, first: int = 1) -> Tensor:
    return torch.arange(first, last + 1, dtype=torch.float64)


def rosenbrock(x: Tensor) -> Tensor:
    return torch.cat([10 * (x[1::2] - x[::2] ** 2), 1 - x[::2]])


def freudenstein_roth(x: Tensor) -> Tensor:
    a, b = x
    return torch.stack([-13 + a + ((5 - b) * b - 2) * b, -29 + a + ((b + 1) * b - 14) * b])


def powell_badly_scaled(x: Tensor) -> Tensor:
    return torch.stack([1e4 * x[0] * x[1] - 1, torch.exp(-x[0]) + torch.exp(-x[1]) - 1.0001])


def brown_badly_scaled(x: Tensor) -> Tensor:
    return torch.stack([x[0] - 1e6, x[1] - 2e-6, x[0] * x[1] - 2])


def beale(x: Tensor) -> Tensor:
    return torch.stack([y - x[0] * (1 - x[1] ** power) for power, y in ((1, 1.5), (2, 2.25), (3, 2.625))])


def jennrich_sampson(x: Tensor, i: Tensor) -> Tensor:
    return 2 + 2 * i - (torch.exp(i * x[0]) + torch.exp(i * x[1]))


def helical_valley(x: Tensor) -> Tensor:
    a, b, c = x
    angle = torch.atan(b / a) / (2 * math.pi) + torch.where(a < 0, 0.5, 0.0)
    return torch.stack([10 * (c - 10 * angle), 10 * (torch.sqrt(a**2 + b**2) - 1), c])


def bard(x: Tensor, u: Tensor, y: Tensor) -> Tensor:
    v = 16 - u
    return y - (x[0] + u / (v * x[1] + torch.minimum(u, v) * x[2]))


def gaussian(x: Tensor, t: Tensor, y: Tensor) -> Tensor:
    return x[0] * torch.exp(-x[1] * (t - x[2]) ** 2 / 2) - y


def meyer(x: Tensor, t: Tensor, y: Tensor) -> Tensor:
    return x[0] * torch.exp(x[1] / (t + x[2])) - y


def gulf(x: Tensor, t: Tensor) -> Tensor:
    y = 25 + (-50 * torch.log(t)) ** (2 / 3)
    return torch.exp(-(torch.abs(y - x[1]) ** x[2]) / x[0]) - t


def box(x: Tensor, t: Tensor) -> Tensor:
    return torch.exp(-t * x[0]) - torch.exp(-t * x[1]) - x[2] * (torch.exp(-t) - torch.exp(-10 * t))


def powell_singular(x: Tensor) -> Tensor:
    a, b, c, d = x[::4], x[1::4], x[2::4], x[3::4]
    return torch.cat([a + 10 * b, ROOT5 * (c - d), (b - 2 * c) ** 2, ROOT10 * (a - d) ** 2])


def wood(x: Tensor) -> Tensor:
    a, b, c, d = x
    last = [ROOT10 * (b + d - 2), (b - d) / ROOT10]
    return torch.stack([10 * (b - a**2), 1 - a, ROOT90 * (d - c**2), 1 - c, *last])


def kowalik_osborne(x: Tensor, u: Tensor, y: Tensor) -> Tensor:
    return y - x[0] * (u**2 + u * x[1]) / (u**2 + u * x[2] + x[3])


def brown_dennis(x: Tensor, t: Tensor) -> Tensor:
    return (x[0] + t * x[1] - torch.exp(t)) ** 2 + (x[2] + x[3] * torch.sin(t) - torch.cos(t)) ** 2


def osborne_1(x: Tensor, t: Tensor, y: Tensor) -> Tensor:
    return y - (x[0] + x[1] * torch.exp(-t * x[3]) + x[2] * torch.exp(-t * x[4]))


def biggs(x: Tensor, t: Tensor) -> Tensor:
    y = torch.exp(-t) - 5 * torch.exp(-10 * t) + 3 * torch.exp(-4 * t)
    return x[2] * torch.exp(-t * x[0]) - x[3] * torch.exp(-t * x[1]) + x[5] * torch.exp(-t * x[4]) - y


def osborne_2(x: Tensor, t: Tensor, y: Tensor) -> Tensor:
    peaks = x[1:4] * torch.exp(-((t - x[8:]) ** 2) * x[5:8])
    return y - (x[0] * torch.exp(-t * x[4]) + peaks.sum())


def watson(x: Tensor) -> Tensor:
    powers = (count(29) / 29)[:, None] ** count(len(x) - 1, 0)
    slope = (powers[:, :-1] * count(len(x) - 1)) @ x[1:]
    return torch.cat([slope - (powers @ x) ** 2 - 1, x[:1], x[1:2] - x[:1] ** 2 - 1])


def penalty_1(x: Tensor) -> Tensor:
    return torch.cat([math.sqrt(1e-5) * (x - 1), (x @ x - 0.25)[None]])


def penalty_2(x: Tensor) -> Tensor:
    y = torch.exp(count(len(x), 2) / 10) + torch.exp(count(len(x) - 1) / 10)
    pairs = torch.exp(x[1:] / 10) + torch.exp(x[:-1] / 10) - y
    singles = torch.exp(x[1:] / 10) - math.exp(-0.1)
    whole = (count(len(x)).flip(0) @ x**2 - 1)[None]
    return torch.cat([x[:1] - 0.2, math.sqrt(1e-5) * pairs, math.sqrt(1e-5) * singles, whole])


def variably_dimensioned(x: Tensor) -> Tensor:
    total = (count(len(x)) @ (x - 1))[None]
    return torch.cat([x - 1, total, total**2])


def trigonometric(x: Tensor) -> Tensor:
    return len(x) - torch.cos(x).sum() + count(len(x)) * (1 - torch.cos(x)) - torch.sin(x)


def brown_almost_linear(x: Tensor) -> Tensor:
    return torch.cat([x[:-1] + x.sum() - (len(x) + 1), (torch.prod(x) - 1)[None]])


def neighbours(x: Tensor) -> tuple[Tensor, Tensor]:
    """The unknown before and the one after, zero beyond the ends."""
    zero = torch.zeros_like(x[:1])
    return torch.cat([zero, x[:-1]]), torch.cat([x[1:], zero])


def boundary_value(x: Tensor) -> Tensor:
    before, after = neighbours(x)
    h = 1 / (len(x) + 1)
    return 2 * x - before - after + h**2 * (x + h * count(len(x)) + 1) ** 3 / 2


def integral_equation(x: Tensor) -> Tensor:
    t = count(len(x)) / (len(x) + 1)
    kernel = torch.minimum((1 - t[:, None]) * t, t[:, None] * (1 - t))
    return x + kernel @ (x + t + 1) ** 3 / (2 * (len(x) + 1))


def broyden_tridiagonal(x: Tensor) -> Tensor:
    before, after = neighbours(x)
    return (3 - 2 * x) * x - before - 2 * after + 1


def broyden_banded(x: Tensor) -> Tensor:
    distance = count(len(x))[:, None] - count(len(x))
    band = ((distance <= 5) & (distance >= -1) & (distance != 0)).double()
    return x * (2 + 5 * x**2) + 1 - band @ (x * (1 + x))


def linear_full_rank(x: Tensor) -> Tensor:
    rest = -2 / 10 * x.sum() - 1
    return torch.cat([x + rest, rest.expand(10 - len(x))])


def linear_rank_1(x: Tensor) -> Tensor:
    return count(10) * (count(len(x)) @ x) - 1


def linear_rank_1_zeros(x: Tensor) -> Tensor:
    inner = count(8) * (count(len(x) - 1, 2) @ x[1:-1]) - 1
    return torch.cat([torch.full_like(x[:1], -1.0), inner, torch.full_like(x[:1], -1.0)])


def chebyquad(x: Tensor) -> Tensor:
    argument, rows = 2 * x - 1, []
    before, now = torch.ones_like(x), argument
    for i in range(1, len(x) + 1):
        rows.append(now.mean() + (0.0 if i % 2 else 1 / (i**2 - 1)))
        before, now = now, 2 * argument * now - before
    return torch.stack(rows)
