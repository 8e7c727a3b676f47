"""How well a mesh follows the principal directions of the surface that it was made from."""

from __future__ import annotations

import numpy as np
from torch import Tensor

from ..fields.directions import Directions
from ..fields.frames import Bools, FaceFrames, Floats
from ..geometry import ReferenceSurface
from ..topology import Topology

_LEAST_DIFFERENCE = 0.02  # of the principal curvatures, times the spacing
_LEAST_SHARE = 0.1  # of their difference in the sum of their sizes


def angles_to_directions(
    vertices: Tensor,
    topology: Topology,
    surface: ReferenceSurface,
    frames: FaceFrames,
    directions: Directions,
    spacing: float,
    chosen: Tensor | None = None,
) -> Floats:
    """Angles in radians, 0 to pi/4, between inner edges and the nearest principal direction at their middles.

    Only where there is a direction: where the difference of the principal curvatures is at least 0.02 over the spacing
    and a tenth of the sum of their sizes.

    Args:
        vertices: of the mesh that was made.
        topology: of that mesh.
        surface: the triangles that it was made from.
        frames: of these.
        directions: of these.
        spacing: length of its edges.
        chosen: (I,) bool: the inner edges to look at, all by default.
    """
    ends = vertices[topology.interior_edges if chosen is None else topology.interior_edges[chosen]]
    closest = surface.closest(ends.mean(1))
    faces, weights = closest.faces.cpu().numpy(), closest.weights.cpu().numpy()
    principal = np.angle((weights * directions.at_corners[faces]).sum(1))
    along = (ends[:, 1] - ends[:, 0]).cpu().numpy()
    against = 2 * np.angle(frames.seen(along, faces)) - principal
    angles = np.abs(np.arctan2(np.sin(2 * against), np.cos(2 * against))) / 4
    return np.asarray(angles[has_direction(directions, spacing)[faces]])


def has_direction(directions: Directions, spacing: float) -> Bools:
    """(F,) whether a triangle has a principal direction worth the name for edges of a length."""
    difference = 2 * np.abs(directions.values)
    sizes = np.maximum(difference, 2 * np.abs(directions.means))  # |k1| + |k2|
    return np.asarray((difference * spacing > _LEAST_DIFFERENCE) & (difference > _LEAST_SHARE * sizes))
