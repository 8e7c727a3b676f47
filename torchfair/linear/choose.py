"""The default choice of a linear solver."""

from __future__ import annotations

import math
from collections.abc import Callable

import torch

from .._memory import available_memory
from .._solver_names import SOLVERS
from ..errors import SettingsError
from .base import LinearSolver, Pattern
from .conjugate_gradients import ConjugateGradients
from .dense import DenseQR
from .rslab_direct import RslabDirect
from .scipy_direct import ScipyDirect

_DENSE_LIMIT = 120
_RSLAB_LIMIT = 200_000
_SCIPY_LIMIT = 30_000
# Bytes of a factor, over N log2 N. Measured on a torus: 200 to 260 with rslab in single precision, 640 with SuperLU; in
# double precision and with more entries in a row it is up to three times as much.
_RSLAB_BYTES, _SCIPY_BYTES = 800.0, 2000.0

_MAKERS: dict[str, Callable[[], LinearSolver]] = {
    "dense": DenseQR,
    "scipy": ScipyDirect,
    "rslab": RslabDirect,
    "cg": ConjugateGradients,
}


def choose_solver(name: str, pattern: Pattern) -> LinearSolver:
    """A solver by name, or the fastest that suits the size of the problem.

    Args:
        name: ``"auto"``, ``"dense"``, ``"scipy"``, ``"rslab"`` or ``"cg"``. ``auto`` takes dense for a few
            unknowns, a sparse direct solver for middle sizes (rslab if it can be used) and conjugate gradients
            above that, on GPUs, and where a factor would need more than half of the memory that is left.
        pattern: Of the matrices.

    Raises:
        SettingsError: unknown name, or rslab is asked for and cannot be used.
    """
    if name == "auto":
        name = _automatic(pattern.num_unknowns, pattern.device)
    if name not in _MAKERS:
        raise SettingsError(f"unknown linear solver '{name}': choose {', '.join(SOLVERS)}")
    if name == "rslab" and not RslabDirect.available():
        raise SettingsError(
            "linear solver 'rslab' cannot be used: it is not installed (pip install 'torchfair[direct]'), or torchfair "
            "was not imported in the main thread; choose 'scipy' or 'auto'"
        )
    return _MAKERS[name]()


def _automatic(size: int, device: torch.device) -> str:
    if size <= _DENSE_LIMIT:
        return "dense"
    if device.type == "cpu" and RslabDirect.available() and size <= _RSLAB_LIMIT and _fits(size, _RSLAB_BYTES):
        return "rslab"
    if device.type == "cpu" and size <= _SCIPY_LIMIT and _fits(size, _SCIPY_BYTES):
        return "scipy"
    return "cg"


def _fits(size: int, bytes_per_unknown: float) -> bool:
    """Whether a factorisation is expected to take no more than half of the memory that is left; yes if unknown."""
    left = available_memory()
    return left is None or bytes_per_unknown * size * math.log2(size) <= 0.5 * left
