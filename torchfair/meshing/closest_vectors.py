"""Whole vectors close to a given one in a quadratic norm."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

_MOST_REDUCED = 250  # unknowns; the basis of a larger lattice is taken as it is
_MOST_SWAPS = 20_000
_LOVASZ = 0.9
_AT_ONCE = 64  # unknowns whose rounding is felt by the rest of a matrix in one product
_LEAST = 1e-10  # of the trace of a norm: what every direction counts at least


class WholeVectors(NamedTuple):
    """Whole vectors (n, size), the closest first, and their squared distances (n,)."""

    vectors: Ints
    costs: Floats


def closest_vectors(metric: Floats, target: Floats, beam: int = 256) -> WholeVectors:
    """Whole vectors ``y`` with small ``(y - target)^T metric (y - target)``.

    In a reduced basis unknowns are rounded one after the other, the most certain first, each followed by the best
    answer of the others; of the branches the ``beam`` best are kept. Every direction counts 1e-10 of the trace besides,
    so that where the norm is zero whole numbers stay near the target.

    Args:
        metric: (size, size) symmetric, positive semidefinite.
        target: (size,).
        beam: number of vectors.
    """
    size = len(target)
    if not size:
        return WholeVectors(np.zeros((1, 0), np.int64), np.zeros(1))
    metric = metric + _LEAST * (float(np.trace(metric)) or 1.0) * np.eye(size)
    basis = reduced_basis(metric)
    inverse = np.rint(np.linalg.inv(basis.astype(float)))
    if (np.rint(basis @ inverse) != np.eye(size)).any():
        basis, inverse = np.eye(size, dtype=np.int64), np.eye(size)
    reduced = basis.T @ metric @ basis
    answers = np.linalg.inv((reduced + reduced.T) / 2)
    order, columns = _certain_first((answers + answers.T) / 2, inverse @ target, float(1 / np.trace(reduced)))
    branches, costs = (inverse @ target)[None], np.zeros(1)
    for (unknown, stiffness), column in zip(order, columns, strict=True):
        here = branches[:, unknown]
        nearest = np.rint(here)
        side = np.where(here >= nearest, 1, -1)
        values = nearest[:, None] + side[:, None] * np.array([0, 1, -1, 2, -2])
        moves = values - here[:, None]
        total = costs[:, None] + moves**2 / stiffness
        best = np.argsort(total.ravel(), kind="stable")[:beam]
        row, choice = np.unravel_index(best, total.shape)
        branches = branches[row] + moves[row, choice][:, None] * column
        branches[:, unknown] = values[row, choice]
        costs = total.ravel()[best]
    return WholeVectors(np.rint(branches).astype(np.int64) @ basis.T, costs)


def _certain_first(answers: Floats, target: Floats, least: float) -> tuple[list[tuple[int, float]], list[Floats]]:
    """Order of rounding, the inverse stiffness of each unknown when its turn comes, and how the others answer.

    No inverse stiffness is less than one over the largest eigenvalue; ``least`` is not more than that.
    """
    size = len(target)
    free = np.ones(size, bool)
    order, columns = [], []
    answers, values, diagonal = answers.copy(), target.copy(), np.diag(answers).copy()
    late = np.zeros((size, _AT_ONCE))  # answers less late @ late.T are those of the unknowns that are free
    for number in range(size):
        moves = np.rint(values) - values
        unknown = int(np.argmin(np.where(free, moves**2 / np.maximum(diagonal, least), np.inf)))
        stiffness = max(float(diagonal[unknown]), least)
        answer = np.where(free, answers[:, unknown] - late @ late[unknown], 0.0)
        column = answer / stiffness
        order.append((unknown, stiffness))
        columns.append(column)
        values = values + column * moves[unknown]
        values[unknown] = np.rint(values[unknown])
        free[unknown] = False
        diagonal -= answer * column
        late[:, number % _AT_ONCE] = answer / stiffness**0.5
        if (number + 1) % _AT_ONCE == 0:
            answers -= late @ late.T
            late[:] = 0
    return order, columns


def reduced_basis(metric: Floats) -> Ints:
    """Columns of short, nearly orthogonal whole vectors in a quadratic norm (Lenstra, Lenstra, Lovasz 1982)."""
    size = len(metric)
    basis: Ints = np.eye(size, dtype=np.int64)
    if size > _MOST_REDUCED:
        return basis
    values, vectors = np.linalg.eigh(metric)
    root = (vectors * np.sqrt(np.maximum(values, _LEAST * values.max()))).T
    triangle = np.linalg.qr(root, mode="r")
    squares = np.diag(triangle) ** 2
    shares = (triangle / np.diag(triangle)[:, None]).T.copy()

    def subtract(k: int, j: int) -> None:
        times = round(float(shares[k, j]))
        if times:
            basis[:, k] -= times * basis[:, j]
            shares[k, :j] -= times * shares[j, :j]
            shares[k, j] -= times

    k = 1
    for _ in range(_MOST_SWAPS):
        if k >= size:
            break
        subtract(k, k - 1)
        share = shares[k, k - 1]
        if squares[k] >= (_LOVASZ - share**2) * squares[k - 1]:
            last = k - 1
            while (far := np.flatnonzero(np.abs(shares[k, :last]) > 0.5)).size:
                last = int(far[-1])
                subtract(k, last)
            k += 1
            continue
        total = squares[k] + share**2 * squares[k - 1]
        shares[k, k - 1] = share * squares[k - 1] / total
        squares[k], squares[k - 1] = squares[k - 1] * squares[k] / total, total
        basis[:, [k - 1, k]] = basis[:, [k, k - 1]]
        shares[[k - 1, k], : k - 1] = shares[[k, k - 1], : k - 1]
        below = shares[k + 1 :, k].copy()
        shares[k + 1 :, k] = shares[k + 1 :, k - 1] - share * below
        shares[k + 1 :, k - 1] = below + shares[k, k - 1] * shares[k + 1 :, k]
        k = max(k - 1, 1)
    return basis
