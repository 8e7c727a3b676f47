"""Sparse direct solver of the optional library MKL: Pardiso's Cholesky factors with the symbolic analysis kept."""

from __future__ import annotations

import ctypes
import threading
import weakref
from functools import cache
from importlib.metadata import PackageNotFoundError, files
from typing import Any

import numpy as np

from .._threads import allowed_threads
from ..errors import SingularSystemError
from .lower_triangle import LowerTriangle
from .mixed_precision import MixedPrecision, Solve

_POSITIVE_DEFINITE = 2  # type of the matrices
_ANALYSE, _FACTOR, _SOLVE, _RELEASE = 11, 22, 33, -1  # phases
_ORDERING, _PRECISION, _INDICES = 1, 27, 34  # places of settings
_ERRORS = {-2: "not enough memory", -4: "the matrix is not positive definite"}


@cache
def _library() -> Any:
    """MKL of the package ``mkl``; None if that is not installed, or holds no library that can be loaded here."""
    try:
        places = [file for file in files("mkl") or () if "mkl_rt" in file.name]
    except PackageNotFoundError:
        return None
    for place in places:
        try:
            return ctypes.CDLL(str(place.locate()))
        except OSError:
            continue
    return None


class PardisoDirect(MixedPrecision):
    """Supernodal Cholesky factors of MKL (``pip install torchfair[mkl]``); two thirds of the time of ``RslabDirect``.

    MKL is free of charge but not free software (Intel Simplified Software License), hence it is never chosen by
    ``"auto"``: give ``solver=PardisoDirect()``. Factors are in single precision, see ``MixedPrecision``. One of them is
    kept at a time: an older one that is asked for a solution is computed again first.

    Raises:
        RuntimeError: when it is prepared and the library is not there.
    """

    name = "pardiso"

    @staticmethod
    def available() -> bool:
        """Whether the library is installed and can be loaded."""
        return _library() is not None

    def order(self, lower: LowerTriangle) -> None:
        """Forgets what belongs to another pattern; each precision is analysed when it is first used."""
        if not self.available():
            raise RuntimeError("MKL is not installed: pip install 'torchfair[mkl]', or take another solver")
        self._handles: dict[bool, _Handle] = {}

    def numeric(self, values: np.ndarray, single: bool) -> Solve:
        """See ``MixedPrecision``. The diagonal of what is factored is 1, so that single precision can hold it."""
        if single not in self._handles:
            self._handles[single] = _Handle(self.places, np.float32 if single else np.float64)
        handle, diagonal = self._handles[single], values[self.places.diagonal]
        if not (diagonal > 0.0).all():
            raise SingularSystemError("the matrix is not positive definite: its diagonal is not")
        scale = 1.0 / np.sqrt(diagonal)
        kept = (values * scale[self.places.rows] * np.repeat(scale, np.diff(self.places.offsets))).astype(handle.dtype)
        with handle.lock:
            handle.factor(kept)

        def solve(right: np.ndarray) -> np.ndarray:
            factors = scale if right.ndim == 1 else scale[:, None]
            scaled = right * factors
            size = np.abs(scaled).max(initial=0.0) or 1.0
            with handle.lock:
                if handle.values is not kept:
                    handle.factor(kept)
                solution: np.ndarray = handle.solve(scaled / size) * (factors * size)
            return solution

        return solve


class _Handle:
    """The analysis of a pattern in one precision, and the last factor.

    Compressed columns of a lower triangle are the compressed rows of the upper one that Pardiso wants.
    """

    def __init__(self, lower: LowerTriangle, dtype: type[np.floating[Any]]) -> None:
        self.dtype, self.lock = dtype, threading.Lock()
        self.values: np.ndarray | None = None
        self._library, self._size = _library(), lower.size
        self._offsets, self._rows = lower.offsets.astype(np.int32), lower.rows.astype(np.int32)
        self._settings = np.zeros(64, np.int32)
        self._settings[[0, _ORDERING, _PRECISION, _INDICES]] = (
            1,
            2,
            dtype is np.float32,
            1,
        )  # nested dissection, C order
        self._pointers = np.zeros(64, np.int64)
        ones: np.ndarray = np.ones(lower.rows.size, dtype)
        ones[lower.diagonal] = lower.size
        self._call(_ANALYSE, ones)
        weakref.finalize(self, _release, self._library, self._pointers, self._size, self._settings)

    def factor(self, values: np.ndarray) -> None:
        """Factors the lower triangle with values of the dtype."""
        self.values = None
        self._call(_FACTOR, values)
        self.values = values

    def solve(self, right: np.ndarray) -> np.ndarray:
        """Solution in double precision for (N,) or (N, k)."""
        if not right.size:
            return np.zeros_like(right)
        columns = np.asfortranarray(right, dtype=self.dtype)
        solution = np.empty_like(columns)
        self._call(_SOLVE, self.values, columns, solution)
        return np.ascontiguousarray(solution, dtype=np.float64)

    def _call(self, phase: int, values: Any, right: Any = None, solution: Any = None) -> None:
        before = self._library.MKL_Set_Num_Threads_Local(allowed_threads())
        try:
            number = 1 if right is None or right.ndim == 1 else right.shape[1]
            arrays = values, self._offsets, self._rows, right, solution
            error = _pardiso(self._library, self._pointers, self._size, self._settings, phase, number, arrays)
        finally:
            self._library.MKL_Set_Num_Threads_Local(before)
        if error == -4:
            raise SingularSystemError(f"pardiso: {_ERRORS[error]}")
        if error:
            raise RuntimeError(f"pardiso: {_ERRORS.get(error, f'error {error}')}")


def _pardiso(
    library: Any,
    pointers: np.ndarray,
    size: int,
    settings: np.ndarray,
    phase: int,
    number: int,
    arrays: tuple[Any, ...],
) -> int:
    """One call of MKL's routine; its error code."""
    values, offsets, rows, right, solution = (None if a is None else ctypes.c_void_p(a.ctypes.data) for a in arrays)
    one, kind, phase_, size_, number_, quiet, error = (
        ctypes.c_int32(value) for value in (1, _POSITIVE_DEFINITE, phase, size, number, 0, 0)
    )
    order, given = (ctypes.c_void_p(a.ctypes.data) for a in (np.zeros(size, np.int32), settings))
    refer, handle = ctypes.byref, ctypes.c_void_p(pointers.ctypes.data)
    library.pardiso(
        handle, refer(one), refer(one), refer(kind), refer(phase_), refer(size_), values, offsets, rows, order,
        refer(number_), given, refer(quiet), right, solution, refer(error),
    )  # fmt: skip
    return error.value


def _release(library: Any, pointers: np.ndarray, size: int, settings: np.ndarray) -> None:
    """Gives the memory of an analysis and its factor back."""
    _pardiso(library, pointers, size, settings, _RELEASE, 1, (None, None, None, None, None))
