"""Symmetric matrices from elsewhere, made ready for the linear solvers."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
import torch
from torch import Tensor

from .._shown import shown
from ..errors import ShapeError, SingularSystemError
from .base import Factor, LinearSolver, System
from .choose import choose_solver
from .lower_triangle import LowerTriangle
from .sparse import csr_matrix

Matrix = Any  # a SciPy sparse matrix or array, or a torch tensor


class MatrixSystem:
    """A symmetric positive semidefinite matrix (N, N): a SciPy sparse matrix or a torch tensor, sparse or dense.

    It is its own pattern, see :class:`~torchfair.linear.base.System`. Direct solvers read the lower triangle only.

    Raises:
        ShapeError: not a square matrix of floating numbers.
    """

    root = None

    def __init__(self, matrix: Matrix) -> None:
        self.device = matrix.device if isinstance(matrix, Tensor) else torch.device("cpu")
        self._matrix = _to_scipy(matrix)
        self.num_unknowns = self._matrix.shape[0]
        self.dtype = torch.from_numpy(self._matrix.data[:0]).dtype

    @property
    def pattern(self) -> MatrixSystem:
        """Itself."""
        return self

    @cached_property
    def lower(self) -> LowerTriangle:
        """Places of the lower triangle, diagonal included where it is zero."""
        return self._lower[0]

    @property
    def lower_values(self) -> Tensor:
        """Values of the lower triangle."""
        return self._lower[1]

    @cached_property
    def _lower(self) -> tuple[LowerTriangle, Tensor]:
        # Explicit zeros on the diagonal have to stay, so places are those of the matrix plus ones.
        size = self.num_unknowns
        places = sp.tril(self._matrix, format="csc")
        places.data = np.ones_like(places.data)
        places = sp.csc_matrix(places + sp.identity(size, dtype=places.dtype, format="csc"))
        places.sort_indices()
        where = sp.csc_matrix((np.arange(1, places.nnz + 1), places.indices, places.indptr), (size, size))
        entries = sp.tril(self._matrix, format="coo")
        values: np.ndarray = np.zeros(places.nnz)
        if entries.nnz:  # SciPy answers with a sparse matrix where it is asked for no entry
            positions = np.asarray(where[entries.row, entries.col]).ravel() - 1
            values = np.bincount(positions, entries.data, places.nnz)
        triangle = LowerTriangle(places.indptr.astype(np.int64), places.indices.astype(np.int64))
        return triangle, torch.from_numpy(values).to(self.device)

    @cached_property
    def _torch(self) -> Tensor:
        stored = (self._matrix.indptr, self._matrix.indices, self._matrix.data)
        offsets, columns, values = (torch.from_numpy(part).to(self.device) for part in stored)
        return csr_matrix(offsets, columns, values, self._matrix.shape)

    def product(self, vectors: Tensor) -> Tensor:
        """The matrix times vectors (N,) or (N, k)."""
        result: Tensor = self._torch @ vectors
        return result

    def preconditioner(self, damping: Tensor) -> Tensor:
        """Inverse of the diagonal, as a sparse matrix (N, N)."""
        diagonal = torch.from_numpy(self._matrix.diagonal()).to(damping) + damping
        every = torch.arange(self.num_unknowns + 1, device=damping.device)
        return csr_matrix(every, every[:-1], 1.0 / diagonal, self._matrix.shape)


def factorise(matrix: Matrix, damping: Tensor | None = None, *, solver: str | LinearSolver = "auto") -> Factor:
    """A symmetric positive definite matrix, ready to be solved with.

    Args:
        matrix: (N, N) SciPy sparse matrix, torch tensor (CSR, COO or dense), or a
            :class:`~torchfair.linear.base.System`, such as a linearised problem of guided projection.
        damping: (N,) added to the diagonal; by default nothing is.
        solver: Name of a linear solver, see :func:`choose_solver`, or an object with that protocol; one whose
            analysis is to be kept for other matrices of the same pattern.

    Returns:
        A factor. ``factor.solve(right).values`` is the solution for ``right`` (N,) or (N, k), torch tensors.

    Raises:
        ShapeError: not a square matrix, or a damping of another length; from ``solve``, a right-hand side of another
            length, or not of floating numbers.
        SingularSystemError: the matrix is singular, indefinite or not finite. SuperLU (``"scipy"``) and conjugate
            gradients do not always notice that a matrix is indefinite or barely singular.

    Example:
        >>> import scipy.sparse as sp, torch
        >>> from torchfair.linear import factorise
        >>> chain = sp.diags([[-1.0, -1.0], [2.0, 2.0, 2.0], [-1.0, -1.0]], [-1, 0, 1])
        >>> factorise(chain).solve(torch.tensor([1.0, 0.0, 1.0], dtype=torch.float64)).values.round(decimals=9)
        tensor([1., 1., 1.], dtype=torch.float64)
    """
    system: System = matrix if hasattr(matrix, "pattern") else MatrixSystem(matrix)
    chosen = choose_solver(solver, system.pattern) if isinstance(solver, str) else solver
    chosen.prepare(system.pattern)
    if damping is None:
        damping = torch.zeros(system.pattern.num_unknowns, dtype=torch.float64, device=system.pattern.device)
    size = system.pattern.num_unknowns
    if not isinstance(damping, Tensor) or damping.shape != (size,) or not damping.is_floating_point():
        raise ShapeError("damping", f"a tensor of floating numbers ({size},), one for each unknown", shown(damping))
    return chosen.factorise(system, damping)


def _to_scipy(matrix: Matrix) -> Any:
    expected = "a square matrix of floating numbers: SciPy sparse or a torch tensor"
    if isinstance(matrix, Tensor):
        if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or not matrix.is_floating_point():
            raise ShapeError("matrix", expected, f"{tuple(matrix.shape)} {matrix.dtype}")
        entries = matrix.detach().cpu().double().to_sparse().coalesce()
        places = tuple(entries.indices().numpy())
        matrix = sp.csr_matrix((entries.values().numpy(), places), (matrix.shape[0], matrix.shape[1]))
    if not sp.issparse(matrix):
        raise ShapeError("matrix", expected, shown(matrix))
    given: Any = matrix
    if given.ndim != 2 or given.shape[0] != given.shape[1] or given.dtype.kind != "f":
        raise ShapeError("matrix", expected, f"{given.shape} {given.dtype}")
    result = sp.csr_matrix(given, dtype=np.float64)
    if not np.isfinite(result.data).all():
        raise SingularSystemError("the matrix is not finite")
    return result
