"""The principal directions of a surface that edges are nearest to."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from ..fields import Directions, FaceFrames
from ..fields.frames import Floats, Ints
from ..fields.matchings import QUARTER
from ..geometry import ClosestPointTracker
from .components import ReadSurface
from .measures import has_direction

_FARTHEST = 0.2  # radians from the nearest direction, beyond which an edge follows none


class NearestDirections:
    """Of edges near a surface, the principal directions that they should have.

    Args:
        surface: with its directions.
        spacing: length of the edges.
    """

    def __init__(self, surface: ReadSurface, spacing: float) -> None:
        self._surface, self._closest = surface, ClosestPointTracker(surface.reference)
        self._has_direction = has_direction(surface.directions, spacing)

    def __call__(self, middles: Tensor, along: Tensor) -> Tensor:
        """(n, 3) unit vectors in the planes of triangles; zero where an edge is not within 0.2 radians of a direction.

        Args:
            middles: (n, 3) of edges, float64.
            along: (n, 3) from end to end of each.
        """
        frames, closest = self._surface.frames, self._closest.closest(middles)
        faces, vectors = closest.faces.numpy(), along.numpy()
        angles, off = nearest(frames, self._surface.directions, faces, closest.weights.numpy(), vectors)
        follows = self._has_direction[faces] & (np.abs(off) < _FARTHEST)
        found = np.cos(angles)[:, None] * frames.first[faces] + np.sin(angles)[:, None] * frames.second[faces]
        return torch.from_numpy(np.where(follows[:, None], found, 0.0))


def nearest(
    frames: FaceFrames, directions: Directions, faces: Ints, weights: Floats, along: Floats
) -> tuple[Floats, Floats]:
    """(n,) angles of the principal directions nearest to vectors, in frames of faces, and by which those are ahead.

    Args:
        frames: of the triangles.
        directions: of these.
        faces: (n,) triangles.
        weights: (n, 3) barycentric coordinates of points in these.
        along: (n, 3) vectors at the points.
    """
    principal = np.angle((weights * directions.at_corners[faces]).sum(1)) / 2
    ahead = np.angle(frames.seen(along, faces))
    angles = principal + np.rint((ahead - principal) / QUARTER) * QUARTER
    return angles, ahead - angles
