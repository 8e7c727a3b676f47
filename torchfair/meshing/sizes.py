"""Spacings that differ from place to place and with the direction: symmetric tensors in triangles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from ..fields import FaceFrames, connection_laplacian, half_turns, hermitian_solver
from ..fields.frames import Complexes, Floats, Ints


@dataclass(frozen=True, eq=False)
class SizeField:
    """Logarithms of spacings over the mean one: a symmetric tensor in every triangle.

    Attributes:
        means: (F,) of the logarithms in two directions that are at right angles.
        values: (F,) traceless parts in the frames: by how much the largest logarithm is above the mean, at twice the
            angle of its direction.
    """

    means: Floats
    values: Complexes

    def along(self, angles: Floats) -> Floats:
        """(F, 2) logarithms along angles in the frames and across."""
        above = (self.values * np.exp(-2j * angles)).real
        return np.stack([self.means + above, self.means - above], axis=1)

    @property
    def smallest(self) -> float:
        """The smallest logarithm in any direction."""
        return float((self.means - np.abs(self.values)).min())

    @property
    def largest(self) -> float:
        """The largest logarithm in any direction."""
        return float((self.means + np.abs(self.values)).max())

    def carried(self, frames: FaceFrames, finer: FaceFrames, parents: Ints) -> SizeField:
        """On finer triangles, those of the triangles (F',) that they lie in."""
        return SizeField(self.means[parents], self.values[parents] * half_turns(frames, finer, parents))

    def smoothed(self, frames: FaceFrames, length: float) -> SizeField:
        """Averaged over a length by a screened Poisson equation.

        Tensors are averaged with weights that are positive and sum to one, so that none leaves the range of those
        before. Where logarithms differ by d at most, they change by ``d / (2 length)`` per length at most afterwards.
        """
        pull = 2 * frames.areas / length**2  # the weights of the edges sum to twice the Dirichlet energy

        def averaged(values: Complexes, turns: int) -> Complexes:
            stiffness = connection_laplacian(frames, np.exp(1j * turns * frames.turns)) + sp.diags(pull)
            return hermitian_solver(stiffness)(np.asarray(pull * values))

        return SizeField(averaged(self.means.astype(complex), 0).real, averaged(self.values, 2))

    def counted(self, areas: Floats) -> SizeField:
        """Scaled so that there are as many cells as with the mean spacing everywhere."""
        shift = np.log(areas @ np.exp(-2 * self.means) / areas.sum()) / 2
        return SizeField(self.means + shift, self.values)

    def split(self, counts: list[int]) -> list[SizeField]:
        """Those of components with so many triangles."""
        at = np.cumsum(counts)[:-1]
        return [SizeField(*parts) for parts in zip(np.split(self.means, at), np.split(self.values, at), strict=True)]
