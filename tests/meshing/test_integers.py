"""Lattices of whole solutions, and whole vectors close to a target."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from torchfair.meshing.closest_vectors import closest_vectors, reduced_basis
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
