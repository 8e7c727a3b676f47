"""That a surface has no valid mesh, in words."""

from __future__ import annotations

from ..errors import MeshError
from ..fields.frames import Floats
from .failed_attempt import FailedAttemptError
from .pose import Pose
from .small_loops import small_loop
from .surface import DesignSurface


class NoMeshError(MeshError):
    """A surface of which no valid principal mesh was found.

    Attributes:
        vertex: number of a vertex where the last attempt went wrong, -1 if unknown.
    """

    def __init__(self, message: str, vertex: int = -1) -> None:
        super().__init__(message)
        self.vertex = vertex


def no_mesh(failures: list[FailedAttemptError], surface: DesignSurface, spacing: float) -> NoMeshError:
    """The error that says where attempts failed and what may help.

    Args:
        failures: of the attempts, one at least, with places in the pose of the surface.
        surface: that was to be meshed.
        spacing: asked for.
    """
    placed = [failure for failure in failures if failure.vertex >= 0]
    if not placed and (loop := small_loop(surface, spacing)) is not None:
        words = f"{failures[-1]} ({_tried(len(failures))}); {loop.remedy(spacing)}"
        return NoMeshError(f"no valid mesh was found{_near(loop.vertex, loop.place)}: {words}", loop.vertex)
    told = placed[0] if placed else failures[-1]
    return NoMeshError(_refusal(told, len(failures), surface.pose), told.vertex)


def _refusal(failure: FailedAttemptError, number: int, pose: Pose) -> str:
    where = "" if failure.place is None else _near(failure.vertex, pose.back(failure.place[None])[0])
    return (
        f"no valid mesh was found{where}: {failure} ({_tried(number)}). Ask for more or fewer faces, smooth directions "
        "over a longer length (smoothing), or give a finer or smoother surface"
    )


def _near(vertex: int, place: Floats) -> str:
    x, y, z = place
    return f" near vertex {vertex} at ({x:.4g}, {y:.4g}, {z:.4g})" if vertex >= 0 else ""


def _tried(number: int) -> str:
    return f"{number} setting(s) tried" if number > 1 else "one setting tried"
