"""That no valid mesh came out of an attempt, and where it went wrong."""

from __future__ import annotations

from ..errors import MeshError
from ..fields.frames import Floats


class FailedAttemptError(MeshError):
    """No valid mesh came out of an attempt.

    Attributes:
        vertex: number of a vertex of the surface that was given where it went wrong, -1 if unknown.
        place: where that is.
        hopeless: whether so much was wrong that a spacing a little different will not do, nor one crease less.
    """

    def __init__(self, message: str, vertex: int = -1, place: Floats | None = None, *, hopeless: bool = False) -> None:
        super().__init__(message)
        self.vertex, self.place, self.hopeless = vertex, place, hopeless
