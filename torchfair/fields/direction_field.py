"""The smoothest field of directions that follows the principal ones."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from ..errors import MeshError
from .directions import Directions
from .frames import Complexes, FaceFrames, Floats, Ints

Symmetry = Literal[2, 4]

WEAK = 1e-4
"""Weight of the direction of curves, such as the boundary, which decides where nothing else does."""

_WEAKEST = 1e-9  # keeps the system regular on closed spheres


class Pull(NamedTuple):
    """Directions that a field is to follow in some faces, those beside curves.

    Attributes:
        faces: (n,) their numbers, the same ones several times where they lie beside several curves.
        angles: (n,) in their frames.
        weights: (n,) against the smoothness of the field, which has weights about 3.
    """

    faces: Ints
    angles: Floats
    weights: Floats


def direction_field(
    frames: FaceFrames, directions: Directions, smoothing: float, symmetry: Symmetry, pull: Pull | None = None
) -> Floats:
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
        pull: what else it is to follow.
    """
    size = np.abs(directions.values)
    wanted = (directions.values / np.where(size > 0, size, 1.0)) ** (symmetry // 2)
    trust = frames.areas * directions.confidence / smoothing**2
    least = _WEAKEST * frames.areas / frames.areas.mean()
    total, weights = trust * wanted + least, trust + least
    for faces, angles, strength in (_along_boundary(frames), *([pull] if pull else [])):
        np.add.at(total, faces, strength * np.exp(1j * symmetry * angles))
        np.add.at(weights, faces, strength)
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
    """Solves a positive definite system for right sides, factorised once.

    Raises:
        MeshError: if it is singular to rounding, as with triangles that hardly have an area.
    """
    try:
        factor = splu(
            matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
        )
    except RuntimeError:
        raise MeshError("triangles are too thin to have directions") from None
    return lambda right: np.asarray(factor.solve(right))


def side_angles(frames: FaceFrames, corners: Ints) -> Floats:
    """(n,) angles, in the frames of faces, of their sides that start at corners ``3 f + k``."""
    return np.asarray(np.angle(frames.sides(corners)))


def _along_boundary(frames: FaceFrames) -> Pull:
    corners = frames.outer_corners
    return Pull(corners // 3, side_angles(frames, corners), np.full(len(corners), WEAK))
