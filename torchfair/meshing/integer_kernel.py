"""All whole solutions of homogeneous equations with whole coefficients."""

from __future__ import annotations

import heapq
from collections import defaultdict

import numpy as np
import numpy.typing as npt

Row = dict[int, int]
Ints = npt.NDArray[np.int64]


def integer_kernel(rows: list[Row], size: int) -> Ints:
    """A basis of the lattice of whole vectors with ``rows @ x = 0``, as columns ``(size, rank)``.

    Unknowns with coefficient 1 or -1 are eliminated first, from short rows; what is left, mostly nothing, by Euclid's
    algorithm on columns. Both are unimodular, so every solution is a whole combination of the basis.

    Args:
        rows: coefficients by number of the unknown.
        size: number of unknowns.
    """
    steps, hard = _eliminate(rows)
    gone = {unknown for unknown, _ in steps}
    free = [unknown for unknown in range(size) if unknown not in gone]
    used = sorted({unknown for row in hard for unknown in row})
    within = _euclid([[row.get(unknown, 0) for unknown in used] for row in hard], len(used))
    others = [unknown for unknown in free if unknown not in set(used)]
    basis = np.zeros((size, within.shape[1] + len(others)), dtype=np.int64)
    basis[np.ix_(used, range(within.shape[1]))] = within
    basis[others, within.shape[1] + np.arange(len(others))] = 1
    for unknown, row in reversed(steps):
        for other, factor in row.items():
            basis[unknown] += factor * basis[other]
    return basis


def _eliminate(rows: list[Row]) -> tuple[list[tuple[int, Row]], list[Row]]:
    """Unknowns by others, in the order of elimination, and the rows without a coefficient 1 or -1 that remain."""
    left = [{unknown: value for unknown, value in row.items() if value} for row in rows]
    users: dict[int, set[int]] = defaultdict(set)
    for number, row in enumerate(left):
        for unknown in row:
            users[unknown].add(number)
    queue = [(len(row), number) for number, row in enumerate(left)]
    heapq.heapify(queue)
    steps: list[tuple[int, Row]] = []
    done: set[int] = set()
    while queue:
        length, number = heapq.heappop(queue)
        row = left[number]
        if number in done or len(row) != length:
            continue
        units = [unknown for unknown, value in row.items() if abs(value) == 1]
        if not units:
            continue  # it comes back if another elimination changes it
        done.add(number)
        pivot = min(units, key=lambda unknown: (len(users[unknown]), unknown))
        sign = row.pop(pivot)
        solved = {unknown: -sign * value for unknown, value in row.items()}
        steps.append((pivot, solved))
        for unknown in [pivot, *row]:
            users[unknown].discard(number)
        left[number] = {}
        for other in sorted(users.pop(pivot, ())):
            _substitute(left[other], pivot, solved, users, other)
            heapq.heappush(queue, (len(left[other]), other))
    return steps, [row for row in left if row]


def _substitute(row: Row, pivot: int, solved: Row, users: dict[int, set[int]], number: int) -> None:
    factor = row.pop(pivot)
    for unknown, value in solved.items():
        total = row.get(unknown, 0) + factor * value
        if total:
            row[unknown] = total
            users[unknown].add(number)
        else:
            row.pop(unknown, None)
            users[unknown].discard(number)


def _euclid(rows: list[list[int]], size: int) -> Ints:
    """Column operations on whole numbers of any size, until the rows have one entry each and the rest is kernel."""
    columns = [[row[j] for row in rows] + [int(i == j) for i in range(size)] for j in range(size)]
    start = 0
    for place in range(len(rows)):
        while True:
            filled = [j for j in range(start, size) if columns[j][place]]
            if len(filled) <= 1:
                break
            least = min(filled, key=lambda j: abs(columns[j][place]))
            for j in filled:
                if j != least:
                    quotient = columns[j][place] // columns[least][place]
                    columns[j] = [a - quotient * b for a, b in zip(columns[j], columns[least], strict=True)]
        if filled:
            columns[start], columns[filled[0]] = columns[filled[0]], columns[start]
            start += 1
    kernel = [column[len(rows) :] for column in columns[start:]]
    return np.array(kernel, np.int64).reshape(len(kernel), size).T
