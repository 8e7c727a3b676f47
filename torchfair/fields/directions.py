"""Principal directions in triangles, as complex numbers."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import torch

from ..geometry import FittedCurvature, fitted_curvature
from .frames import Complexes, FaceFrames, Floats, Ints

_FLOOR = 0.1  # of the mean curvature: a difference of curvatures below that is nothing to go by
_FLATTEST = 1e-3  # radius of curvature over the size of the surface beyond which it counts as flat, inverted
_MOST = 1.5


@dataclass(frozen=True, eq=False)
class Directions:
    """Principal directions of the triangles of a mesh.

    Attributes:
        at_corners: (F, 3) traceless shape operators in the frames at the corners of triangles: half the difference of
            the principal curvatures, at twice the angle of the direction in which the surface bends by the larger
            curvature (positive where convex). Between the corners they are linear.
        means: (F,) mean curvatures.
        confidence: (F,) from 0 at umbilics and in flat places, over 1 where curvatures differ as much as in
            the mean, to 1.5.
    """

    at_corners: Complexes
    means: Floats
    confidence: Floats

    @cached_property
    def values(self) -> Complexes:
        """(F,) traceless shape operators in the middles of triangles."""
        return np.asarray(self.at_corners.mean(1))

    @property
    def turned(self) -> Directions:
        """Those in which the surface bends by the smaller curvature."""
        return replace(self, at_corners=-self.at_corners)


def directions_of(frames: FaceFrames, fitted: FittedCurvature | None = None) -> Directions:
    """Directions by polynomials fitted over rings of vertices.

    Args:
        frames: of the triangles.
        fitted: of :func:`torchfair.geometry.fitted_curvature`, by default over two rings, for smooth surfaces.
    """
    fitted = fitted or fitted_curvature(torch.from_numpy(frames.points), frames.topology, rings=2)
    whole = fitted.traceless.numpy()[frames.triangles]
    axes = np.stack([frames.first, frames.second], axis=1)[:, None]
    plane = axes @ whole @ axes.transpose(0, 1, 3, 2)
    at_corners = (plane[..., 0, 0] - plane[..., 1, 1] + 1j * (plane[..., 0, 1] + plane[..., 1, 0])) / 2
    means = fitted.mean_curvatures.numpy()[frames.triangles].mean(1)
    return Directions(at_corners, means, _confidence(at_corners.mean(1), means, frames.areas))


def _confidence(values: Complexes, means: Floats, areas: Floats) -> Floats:
    total = areas.sum()
    differs, bends = (np.sqrt((np.abs(of) ** 2 * areas).sum() / total) for of in (values, means))
    scale = max(differs, _FLOOR * bends, _FLATTEST / np.sqrt(total))
    return np.asarray(np.minimum((np.abs(values) / scale) ** 2, _MOST))


def carried_directions(directions: Directions, frames: FaceFrames, finer: FaceFrames, parents: Ints) -> Directions:
    """Directions of finer triangles, those of the triangles that they lie in.

    Args:
        directions: of the coarse mesh.
        frames: of the coarse mesh.
        finer: frames of the fine mesh.
        parents: (F',) coarse triangle of every fine one, in the same plane.
    """
    apart = finer.points[finer.triangles] - frames.centres[parents][:, None]
    weights = 1 / 3 + (frames.seen(apart, parents)[..., None].conj() * frames.gradients[parents][:, None]).real
    inside = (weights * directions.at_corners[parents][:, None]).sum(-1)
    at_corners = inside * half_turns(frames, finer, parents)[:, None]
    return Directions(at_corners, directions.means[parents], directions.confidence[parents])


def half_turns(frames: FaceFrames, finer: FaceFrames, parents: Ints) -> Complexes:
    """(F',) by what traceless tensors of coarse triangles are multiplied in the frames of finer ones in them."""
    return np.asarray(np.exp(2j * np.angle(finer.seen(frames.first[parents], np.arange(len(parents))))))
