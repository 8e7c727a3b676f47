"""Which way a star of a principal-symmetric mesh is curved: angle excess and curvatures towards w1 and w4.

Stars ``x`` (n, 7, 3) are v, w1, ..., w6; w1 and w4 are the principal neighbours. All functions are of the spokes
``w_i - v``, so derivatives are given by the spokes, (..., 6, 3).
"""

from __future__ import annotations

import math

import torch
from torch import Tensor

from ..geometry._ops import angle_of, cross, dot, norm, unit
from ..principal.sphere_derivatives import sphere_derivatives
from ..principal.spheres import spheres_through

_TINY = 1e-24


def angle_excess(x: Tensor) -> Tensor:
    """Angle sum minus 2 pi at the first of the vertices ``x`` (n, 7, 3); positive where curvature is negative."""
    spokes = x[:, 1:] - x[:, :1]
    after = spokes.roll(-1, 1)
    angles = angle_of(norm(cross(spokes, after)), dot(spokes, after))
    return angles.sum(1) - 2.0 * math.pi


def angle_excess_derivative(x: Tensor) -> Tensor:
    """Derivative (n, 6, 3) of :func:`angle_excess` by the spokes; zero where two neighbouring spokes are parallel."""
    spokes = x[:, 1:] - x[:, :1]
    normals = unit(cross(spokes, spokes.roll(-1, 1)))
    return cross(spokes, normals - normals.roll(1, 1)) / dot(spokes, spokes).clamp_min(_TINY)[..., None]


def side_curvatures(x: Tensor) -> tuple[Tensor, Tensor]:
    """``2 n.d / |d|^2`` for the spokes d to w1 and w4 and three unit normals n, (n, 6), and curvatures of spheres (n,).

    The normals are those of the sphere of the star, and of the faces v w2 w3 and v w5 w6. The quotient is the curvature
    of a circle that touches the plane orthogonal to n in v and passes through the neighbour.
    """
    spokes = x[:, 1:] - x[:, :1]
    principal = spokes[:, ::3]
    sphere = spheres_through(x[:, 0], _cospherical(x[:, 1:]).flatten(1, 2))
    faces = unit(cross(spokes[:, 1::3], spokes[:, 2::3]))
    normals = torch.cat([sphere.normals[:, None], faces], dim=1)
    heights = dot(normals[:, :, None], principal[:, None])
    return (2.0 * heights / dot(principal, principal).clamp_min(_TINY)[:, None]).flatten(1), sphere.curvatures


def side_curvatures_derivative(x: Tensor) -> tuple[Tensor, Tensor]:
    """Derivatives (n, 6, 6, 3) and (n, 6, 3) of both results of :func:`side_curvatures` by the spokes."""
    spokes = x[:, 1:] - x[:, :1]
    principal = spokes[:, ::3]
    sphere = spheres_through(x[:, 0], _cospherical(x[:, 1:]).flatten(1, 2))
    a, b = spokes[:, 1::3], spokes[:, 2::3]
    products = cross(a, b)
    faces = unit(products)
    squares = dot(principal, principal).clamp_min(_TINY)[..., None]
    by_normal = 2.0 * principal / squares  # (n, 2, 3), for w1 and w4
    normals = torch.cat([sphere.normals[:, None], faces], dim=1)
    sides = dot(normals[:, :, None], by_normal[:, None])  # (n, 3, 2)
    result = x.new_zeros(x.shape[0], 3, 2, 6, 3)
    for number, spoke in enumerate((0, 3)):
        result[:, :, number, spoke] = (
            2.0 * normals / squares[:, number, None] - sides[..., number, None] * by_normal[:, number, None]
        )
    by_sphere, by_curvature = sphere_derivatives(_cospherical(spokes).flatten(1, 2), sphere.normals, by_normal)
    _cospherical(result[:, 0]).copy_(by_sphere.view(x.shape[0], 2, 2, 2, 3))
    lengths = norm(products)[..., None]
    inverse = torch.where(lengths > 0, 1.0 / torch.where(lengths > 0, lengths, 1.0), 0.0)
    for face, (first, second) in enumerate(((1, 2), (4, 5))):
        normal = faces[:, face, None]
        turned = (by_normal - dot(by_normal, normal)[..., None] * normal) * inverse[:, face, None]
        result[:, 1 + face, :, first] += cross(b[:, face, None], turned)
        result[:, 1 + face, :, second] += cross(turned, a[:, face, None])
    curvature = x.new_zeros(x.shape[0], 6, 3)
    _cospherical(curvature).copy_(by_curvature.view(x.shape[0], 2, 2, 3))
    return result.flatten(1, 2), curvature


def _cospherical(around: Tensor) -> Tensor:
    """w2, w3 and w5, w6 (..., 2, 2, 3) of w1, ..., w6 (..., 6, 3): a view.

    A list for an index would be made a tensor and copied to the device at every call.
    """
    return around.view(*around.shape[:-2], 2, 3, 3)[..., 1:, :]
