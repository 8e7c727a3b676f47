"""Errors that torchfair raises. Every message names the cause and the remedy."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path


class TorchfairError(ValueError):
    """Base class of all errors raised on purpose by torchfair."""


class MeshError(TorchfairError):
    """Faces that do not describe an oriented manifold polygon mesh, or vertices that do not fit them."""


class ShapeError(TorchfairError):
    """A tensor whose shape or dtype is not the one asked for.

    Attributes:
        expected: the shape in words, such as ``(*batch, 8, 3)``.
        actual: the shape that came.
    """

    def __init__(self, what: str, expected: str, actual: object) -> None:
        super().__init__(f"{what}: expected {expected}, got {actual}")
        self.expected = expected
        self.actual = actual


class MeshFileError(TorchfairError):
    """A mesh file that cannot be read or written.

    Attributes:
        path: the file.
        line: line number counted from 1, or None where the fault has no line.
    """

    def __init__(self, path: str | Path, message: str, line: int | None = None) -> None:
        where = f"{path}" if line is None else f"{path}, line {line}"
        super().__init__(f"{where}: {message}")
        self.path = Path(path)
        self.line = line


class SettingsError(TorchfairError):
    """A setting that is not among those allowed."""


class DerivativeError(TorchfairError):
    """The end of a solve has no derivative, or none that is asked for; the message names the condition that fails."""


class SingularSystemError(TorchfairError):
    """A linear solver met a matrix that is singular, indefinite or not finite.

    Attributes:
        blocks: numbers of the diagonal blocks that are to blame, None where the solver knows none.
    """

    def __init__(self, message: str, blocks: Sequence[int] | None = None) -> None:
        super().__init__(message)
        self.blocks = None if blocks is None else tuple(blocks)
