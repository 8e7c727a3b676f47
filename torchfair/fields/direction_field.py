"""The smoothest field of directions that follows the principal ones."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from .directions import Directions
from .frames import Complexes, FaceFrames, Floats

Symmetry = Literal[2, 4]

_BOUNDARY = 1e-4  # weight of the direction of the boundary, which decides where nothing else does
_WEAKEST = 1e-9  # keeps the system regular on closed spheres


def direction_field(frames: FaceFrames, directions: Directions, smoothing: float, symmetry: Symmetry) -> Floats:
    r"""Angles (F,) of a field of directions without sign (``symmetry`` 2), or of crosses (4), in the frames.

    With ``z`` the ``symmetry``-th power of the direction as a complex number and ``z0`` that of the principal
    direction it minimises, by one sparse Hermitian solve::

        sum_e w_e |z_g - r_e z_f|^2 + sum_f A_f c_f / smoothing^2 |z_f - z0_f|^2

    where ``r_e`` turns from frame to frame and ``c`` is the confidence. Where there is no confidence at all, the
    boundary says how the field lies.

    Args:
        frames: of the triangles.
        directions: principal directions.
        smoothing: length over which directions are smoothed.
        symmetry: 2 or 4.
    """
    size = np.abs(directions.values)
    wanted = (directions.values / np.where(size > 0, size, 1.0)) ** (symmetry // 2)
    pull = frames.areas * directions.confidence / smoothing**2
    edge, at_edge = _along_boundary(frames, symmetry)
    total = pull * wanted + _BOUNDARY * at_edge * edge + _WEAKEST * frames.areas / frames.areas.mean()
    weights = pull + _BOUNDARY * at_edge + _WEAKEST * frames.areas / frames.areas.mean()
    stiffness = connection_laplacian(frames, np.exp(1j * symmetry * frames.turns)) + sp.diags(weights)
    field = hermitian_solver(stiffness)(total)
    return np.asarray(np.angle(field) / symmetry)


def connection_laplacian(frames: FaceFrames, turns: Complexes) -> sp.csr_matrix:
    """(F, F) Hermitian matrix of ``sum_e w_e |z_g - turns_e z_f|^2`` over interior edges with faces f, g."""
    f, g = frames.faces.T
    w = frames.dual_weights
    values = np.concatenate([w + 0j, w, -w * turns, -w * turns.conj()])
    places = np.concatenate([f, g, g, f]), np.concatenate([f, g, f, g])
    return sp.csr_matrix((values, places), shape=(len(frames.triangles),) * 2)


def hermitian_solver(matrix: sp.csr_matrix) -> Callable[[Complexes], Complexes]:
    """Solves a positive definite system for right sides, factorised once."""
    factor = splu(matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    return lambda right: np.asarray(factor.solve(right))


def _along_boundary(frames: FaceFrames, symmetry: int) -> tuple[Complexes, Floats]:
    """Of every face the power of the direction of its boundary edge, and 1 where it has one, else 0."""
    faces, side = frames.outer_corners // 3, frames.outer_corners % 3
    triangles = frames.triangles[faces]
    every = np.arange(len(faces))
    along = frames.points[triangles[every, (side + 1) % 3]] - frames.points[triangles[every, side]]
    x, y = ((along * axis[faces]).sum(1) for axis in (frames.first, frames.second))
    power: Complexes = np.zeros(len(frames.triangles), complex)
    power[faces] = np.exp(1j * symmetry * np.arctan2(y, x))
    present = np.zeros(len(frames.triangles))
    present[faces] = 1.0
    return power, present
