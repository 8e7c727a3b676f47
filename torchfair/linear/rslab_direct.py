"""Sparse direct solver of the optional package rslab: L D L^T with the symbolic analysis kept."""

from __future__ import annotations

import importlib
import importlib.util
import sys
import threading
from types import ModuleType
from typing import Any

import numpy as np

from .._threads import allowed_threads
from ..errors import SingularSystemError
from .lower_triangle import LowerTriangle
from .mixed_precision import MixedPrecision, Solve

_SMALLEST_RACE = 5_000  # unknowns


def _load() -> ModuleType | None:
    """The package; None if it is not there or must not be imported now.

    Its allocator takes the thread that imports it for the main one. When that thread ends, the next use of the package
    ends the process, so it is imported in the main thread or not at all.
    """
    known = sys.modules.get("rslab")
    if known is not None:
        return known
    in_main_thread = threading.current_thread() is threading.main_thread()
    if not in_main_thread or importlib.util.find_spec("rslab") is None:
        return None
    return importlib.import_module("rslab")


_load()  # while the thread is most likely the main one; takes two milliseconds


class RslabDirect(MixedPrecision):
    """Supernodal ``L D L^T`` (``pip install torchfair[direct]``); several times faster than SuperLU.

    The factor is computed in single precision, in half the time, and its solution refined, see ``MixedPrecision``.

    Factors whose inertia is not positive are refused, so that an indefinite matrix raises the damping. Threads are as
    many as torch has (``torch.set_num_threads``, ``OMP_NUM_THREADS``).
    """

    name = "rslab"

    @staticmethod
    def available() -> bool:
        """Whether the package is installed, and imported or importable in this thread (it must be the main one)."""
        return _load() is not None

    def order(self, lower: LowerTriangle) -> None:
        """Orders and analyses the pattern."""
        rslab = _load()
        if rslab is None:
            raise RuntimeError("rslab is not installed, or was not imported in the main thread: import torchfair there")
        ones = np.ones(lower.rows.size)
        ones[lower.diagonal] = lower.size
        # Nested dissection goes down to small parts, which saves a fifth of the work per factor. It takes part in the
        # race of orderings where it gains more in ten factors than the race costs. Columns are merged generously: a
        # tenth less time for a few zeros more.
        self._symbolic: Any = rslab.analyze(
            lower.matrix(ones),
            path="ldlt",
            race_nd_min_n=_SMALLEST_RACE,
            race_nd_min_work=1_000_000,
            nd_leaf_size=100,
            nemin=32,
            threads=("auto", allowed_threads()),
        )

    def numeric(self, values: np.ndarray, single: bool) -> Solve:
        """See ``MixedPrecision``."""
        settings = {"factor_dtype": "float32"} if single else {}
        try:
            factor = self._symbolic.factor(values, threads=("auto", allowed_threads()), **settings)
        except (RuntimeError, ValueError) as error:
            raise SingularSystemError(f"rslab: {error}") from None
        if factor.inertia[0] != self.places.size:
            raise SingularSystemError(f"the matrix is not positive definite (inertia {factor.inertia})")
        return lambda right: _substitute(factor, right)


def _substitute(factor: Any, right: np.ndarray) -> np.ndarray:
    if not right.size:
        return np.zeros_like(right)
    solve = factor.solve if right.ndim == 1 else factor.solve_many
    solution: np.ndarray = solve(np.ascontiguousarray(right))
    return solution
