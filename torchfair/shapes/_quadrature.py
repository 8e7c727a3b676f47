"""Gauss-Legendre integrals over parameter rectangles, also of integrands with a kink."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import torch
from torch import Tensor

Integrand = Callable[[Tensor, Tensor], Tensor]
Interval = tuple[float, float]
Domain = tuple[Interval, Interval]

_ORDER = 10
_PANELS = (2, 4, 8, 16, 32)
_KINK_START, _KINK_ROUNDS, _KINK_TOLERANCE = 4, 12, 1e-8
_KINK_PANELS, _KINK_ORDER = 32, 6
_TOLERANCE = 1e-12
_SECTIONS = 64  # three times divided by this, a root is off by d = 4e-6 panels, which costs d squared


def integrate(integrand: Integrand, domain: Domain) -> float:
    """Integral over a rectangle, by panels of ten nodes, halved until two results agree to 1e-12."""
    return _refine(lambda panels: _smooth(integrand, domain, panels), _PANELS)


def integrate_with_kink(integrand: Integrand, switch: Integrand, domain: Domain) -> float:
    """Integral of a function that has a kink where ``switch`` changes its sign.

    Along every v-line of the outer rule the panels are cut at the roots of ``switch``, so the kink costs no
    accuracy. Where the curve of kinks touches a v-line the outer integrand behaves like the power 3/2 of the
    distance; outer panels are halved there until halving changes them by less than 1e-8 of the whole. The relative
    error is then about 1e-7, and about 1e-12 without such points.
    """
    edges = torch.linspace(*domain[0], _KINK_START + 1, dtype=torch.float64)
    panels = torch.stack([edges[:-1], edges[1:]], dim=1)
    values = _panel_integrals(integrand, switch, panels, domain[1])
    total = float(values.abs().sum())
    accepted = 0.0
    for _ in range(_KINK_ROUNDS):
        middle = panels.mean(1)
        halves = torch.stack([panels[:, 0], middle, middle, panels[:, 1]], dim=1).reshape(-1, 2)
        finer = _panel_integrals(integrand, switch, halves, domain[1]).reshape(-1, 2)
        steady = (finer.sum(1) - values).abs() <= _KINK_TOLERANCE * total
        accepted += float(finer[steady].sum())
        panels, values = halves.reshape(-1, 2, 2)[~steady].reshape(-1, 2), finer[~steady].flatten()
        if not len(panels):
            break
    return accepted + float(values.sum())


def _refine(rule: Callable[[int], float], levels: Sequence[int]) -> float:
    previous = rule(levels[0])
    for panels in levels[1:]:
        current = rule(panels)
        if abs(current - previous) <= _TOLERANCE * abs(current):
            return current
        previous = current
    return previous


def _unit_rule(order: int) -> tuple[Tensor, Tensor]:
    """Nodes and weights on [0, 1]."""
    nodes, weights = np.polynomial.legendre.leggauss(order)
    return torch.from_numpy(0.5 * (nodes + 1)), torch.from_numpy(0.5 * weights)


def _panel_rule(interval: Interval, panels: int) -> tuple[Tensor, Tensor]:
    nodes, weights = _unit_rule(_ORDER)
    edges = torch.linspace(*interval, panels + 1, dtype=torch.float64)
    size = edges.diff()[:, None]
    return (edges[:-1, None] + size * nodes).flatten(), (size * weights).flatten()


def _smooth(integrand: Integrand, domain: Domain, panels: int) -> float:
    u, u_weights = _panel_rule(domain[0], panels)
    v, v_weights = _panel_rule(domain[1], panels)
    values = integrand(*torch.meshgrid(u, v, indexing="ij"))
    return float(u_weights @ values @ v_weights)


def _panel_integrals(integrand: Integrand, switch: Integrand, panels: Tensor, interval: Interval) -> Tensor:
    """Integrals over ``panels`` ``(n, 2)`` in u times ``interval`` in v."""
    nodes, weights = _unit_rule(_ORDER)
    size = panels.diff(dim=1)
    lines = _line_integrals(integrand, switch, (panels[:, :1] + size * nodes).flatten(), interval)
    return (lines.reshape(-1, _ORDER) * size * weights).sum(1)


def _line_integrals(integrand: Integrand, switch: Integrand, u: Tensor, interval: Interval) -> Tensor:
    """Integrals over ``interval`` along the v-lines of ``u`` ``(n,)``, with panels cut at the roots of ``switch``."""
    edges = torch.linspace(*interval, _KINK_PANELS + 1, dtype=torch.float64)
    rows, columns = torch.meshgrid(u, edges, indexing="ij")
    middle = _split_points(switch, rows, columns)
    cuts = torch.stack([columns[:, :-1], middle], dim=-1).flatten(1)
    cuts = torch.cat([cuts, columns[:, -1:]], dim=1)
    nodes, weights = _unit_rule(_KINK_ORDER)
    size = cuts.diff(dim=1)[..., None]
    v = cuts[:, :-1, None] + size * nodes
    return (integrand(u[:, None, None].expand_as(v), v) * size * weights).sum((1, 2))


def _split_points(switch: Integrand, rows: Tensor, columns: Tensor) -> Tensor:
    """In each panel between two columns the root of ``switch`` if its sign changes there, otherwise the middle."""
    values = switch(rows, columns)
    changes = values[:, :-1] * values[:, 1:] < 0
    middle = 0.5 * (columns[:, :-1] + columns[:, 1:])
    row, left, right = rows[:, :-1][changes], columns[:, :-1][changes], columns[:, 1:][changes]
    steps = torch.linspace(0, 1, _SECTIONS + 1, dtype=torch.float64)
    for _ in range(3 if len(row) else 0):
        points = left[:, None] + (right - left)[:, None] * steps
        sign = switch(row[:, None].expand_as(points), points).sign()
        first = (sign[:, 1:] * sign[:, :1] <= 0).to(torch.int64).argmax(1, keepdim=True)
        left, right = points.gather(1, first)[:, 0], points.gather(1, first + 1)[:, 0]
    return middle.masked_scatter(changes, 0.5 * (left + right))
