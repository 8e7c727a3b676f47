"""Lattices of whole solutions, and whole vectors close to a target."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from torchfair.meshing.closest_vectors import _certain_first, closest_vectors, reduced_basis
from torchfair.meshing.integer_kernel import integer_kernel

ROWS = st.lists(st.lists(st.integers(-3, 3), min_size=4, max_size=4), min_size=1, max_size=3)


@settings(max_examples=60, deadline=None)
@given(ROWS)
def test_kernel_is_the_lattice_of_all_whole_solutions(rows: list[list[int]]) -> None:
    matrix = np.array(rows)
    basis = integer_kernel([{j: x for j, x in enumerate(row) if x} for row in rows], 4)
    assert not (matrix @ basis).any()
    assert basis.shape[1] == 4 - np.linalg.matrix_rank(matrix)
    for vector in itertools.product((-2, -1, 0, 1, 2), repeat=4):
        if not (matrix @ vector).any():
            whole = np.linalg.lstsq(basis.astype(float), np.array(vector, float))[0] if basis.size else np.zeros(0)
            assert np.abs(whole - np.rint(whole)).max(initial=0) < 1e-6
            assert np.allclose(basis @ np.rint(whole), vector)


def test_rows_without_units() -> None:
    basis = integer_kernel([{0: 2, 1: 4, 2: -6}, {1: 3, 3: 6}], 4)
    assert basis.shape == (4, 2)
    assert not (np.array([[2, 4, -6, 0], [0, 3, 0, 6]]) @ basis).any()


def test_nothing_is_asked() -> None:
    assert (integer_kernel([], 3) == np.eye(3)).all()
    assert integer_kernel([{0: 1}, {1: 2}], 2).shape == (2, 0)


def random_metric(size: int, seed: int) -> np.ndarray:
    root = np.random.default_rng(seed).normal(size=(size, size)) * 10.0 ** np.arange(size)
    return root.T @ root + 1e-3 * np.eye(size)


@pytest.mark.parametrize("seed", range(8))
def test_reduced_basis_is_unimodular_and_shorter(seed: int) -> None:
    metric = random_metric(4, seed)
    basis = reduced_basis(metric)
    assert abs(round(np.linalg.det(basis.astype(float)))) == 1
    lengths = np.diag(basis.T @ metric @ basis)
    assert lengths.prod() <= np.diag(metric).prod() * (1 + 1e-9)


@pytest.mark.parametrize("seed", range(12))
def test_the_closest_vector_is_that_of_a_search(seed: int) -> None:
    random = np.random.default_rng(seed)
    root = random.normal(size=(3, 3))
    metric, target = root.T @ root + 0.05 * np.eye(3), random.uniform(-3, 3, 3)
    box = np.array(list(itertools.product(range(-9, 10), repeat=3)))
    costs = np.einsum("ni,ij,nj->n", box - target, metric, box - target)
    found = closest_vectors(metric, target)
    assert found.costs[0] == pytest.approx(costs.min())
    assert (found.vectors[0] == box[costs.argmin()]).all()
    assert np.allclose(found.costs, np.einsum("ni,ij,nj->n", found.vectors - target, metric, found.vectors - target))
    assert (np.diff(found.costs) >= -1e-9).all()
    assert len(np.unique(found.vectors, axis=0)) == len(found.vectors)


def test_no_unknowns() -> None:
    assert closest_vectors(np.zeros((0, 0)), np.zeros(0)).vectors.shape == (1, 0)


KINDS = {
    "any": lambda random, rank, size: random.normal(size=(rank, size)),
    "whole": lambda random, rank, size: random.integers(-2, 3, size=(rank, size)).astype(float),
    "far apart": lambda random, rank, size: (
        random.normal(size=(rank, size)) * 10.0 ** random.uniform(-8, 0, size=(1, size))
    ),
}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(20))
def test_a_singular_norm_leaves_whole_numbers_near_the_target(kind: str, seed: int) -> None:
    """Directions that cost nothing made whole numbers overflow."""
    random = np.random.default_rng(seed)
    size = int(random.integers(2, 12))
    root = KINDS[kind](random, int(random.integers(0, size)), size) * 10.0 ** random.uniform(-6, 6)
    metric, target = root.T @ root, random.uniform(-5, 5, size)
    found = closest_vectors(metric, target)
    shifted = metric + 1e-10 * (np.trace(metric) or 1.0) * np.eye(size)
    away, nearest = found.vectors - target, np.rint(target) - target
    assert np.allclose(found.costs, np.einsum("ni,ij,nj->n", away, shifted, away), rtol=1e-5, atol=0)
    assert found.costs[0] <= nearest @ shifted @ nearest * (1 + 1e-6)


@pytest.mark.parametrize("scale", [0.0, 1e-9, 1.0, 1e9])
def test_a_norm_that_sees_one_direction_of_two(scale: float) -> None:
    """Whole numbers are those nearest to the target, whether the norm sees them or not."""
    found = closest_vectors(np.diag([scale, 0.0]), np.array([0.3, -7.2]))
    assert found.vectors[0].tolist() == [0, -7]


def test_unknowns_that_are_rounded_are_felt_by_the_rest() -> None:
    """Of 150, more than are felt in one product: the same as where each changes the whole inverse."""
    random = np.random.default_rng(0)
    root = random.normal(size=(200, 150))
    answers, values = np.linalg.inv(root.T @ root), random.uniform(-4, 4, 150)
    order, columns = _certain_first(answers, values, 1e-9)
    free = np.ones(150, bool)
    for (unknown, stiffness), column in zip(order, columns, strict=True):
        moves = np.rint(values) - values
        assert unknown == np.flatnonzero(free)[np.argmin((moves**2)[free] / np.diag(answers)[free])]
        assert stiffness == pytest.approx(answers[unknown, unknown], rel=1e-9)
        assert np.allclose(column, answers[:, unknown] / stiffness, atol=1e-10)
        values = values + moves[unknown] * column
        answers = answers - np.outer(column, answers[unknown])
        free[unknown] = False
        answers[~free] = answers[:, ~free] = 0
    assert not free.any()
