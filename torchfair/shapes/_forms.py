"""Exact derivatives of a parametrisation and the shape operator they give."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, cast

import torch
from torch import Tensor
from torch.autograd import forward_ad
from torch.func import vjp

Map = Callable[[Tensor, Tensor], Tensor]


class ShapeOperator(NamedTuple):
    """Symmetric 2 x 2 matrix ``[[uu, uv], [uv, vv]]`` in the orthonormal frame that starts along the u-line."""

    uu: Tensor
    uv: Tensor
    vv: Tensor


def tangents(position: Map, u: Tensor, v: Tensor) -> tuple[Tensor, Tensor]:
    """Partial derivatives ``x_u, x_v`` ``(..., 3)``.

    ``position`` treats every parameter pair on its own.
    """
    _, x_u, x_v = _derivatives(position, u, v)
    return x_u, x_v


def _derivatives(function: Map, u: Tensor, v: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Values ``(..., n)`` and both partial derivatives of a function of single points.

    One reverse product for each component, over all points at once: of three components that is faster than the
    forward products, which compute with pairs throughout. Those of :mod:`torch.func` import the compiler of torch,
    which takes longer than most meshes of a surface do: they are for where only they can be.
    """
    if _transformed() or u.is_inference() or v.is_inference():
        return _transformed_derivatives(function, u, v)
    followed = torch.is_grad_enabled() and (u.requires_grad or v.requires_grad or _has_parameters(function, u, v))
    with torch.enable_grad():
        u, v = _cut_off(u), _cut_off(v)
        values = function(u, v)
        if not values.requires_grad:
            return values, torch.zeros_like(values), torch.zeros_like(values)
        rows = [
            torch.autograd.grad(x.sum(), (u, v), retain_graph=True, create_graph=followed, materialize_grads=True)
            for x in values.unbind(-1)
        ]
        by_u, by_v = (torch.stack(parts, dim=-1) for parts in zip(*rows, strict=True))
    return values if followed else values.detach(), by_u, by_v


def _transformed() -> bool:
    """Within a transform of ``torch.func``, the compiler, forward derivatives or inference."""
    if torch._C._are_functorch_transforms_active() or torch.compiler.is_compiling():
        return True
    return forward_ad._current_level >= 0 or torch.is_inference_mode_enabled()


def _transformed_derivatives(function: Map, u: Tensor, v: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """The same by products of :mod:`torch.func`."""
    values, pulled_back = cast("tuple[Tensor, Callable[[Tensor], tuple[Tensor, Tensor]]]", vjp(function, u, v))
    components = torch.eye(values.shape[-1], dtype=values.dtype, device=values.device).unbind(0)
    by_u, by_v = zip(*(pulled_back(component.expand_as(values)) for component in components), strict=True)
    return values, torch.stack(by_u, dim=-1), torch.stack(by_v, dim=-1)


def _has_parameters(function: Map, u: Tensor, v: Tensor) -> bool:
    """Whether values have derivatives with respect to something else than u and v, seen at the first point."""
    return function(u.detach().reshape(-1)[:1], v.detach().reshape(-1)[:1]).requires_grad


def _cut_off(parameter: Tensor) -> Tensor:
    """The same numbers, from where derivatives are taken: others that depend on them, or they on others, are apart."""
    return parameter.view_as(parameter) if parameter.requires_grad else parameter.detach().requires_grad_()


class Partials(NamedTuple):
    """First and second partial derivatives of a parametrisation, each ``(..., 3)``."""

    u: Tensor
    v: Tensor
    uu: Tensor
    uv: Tensor
    vv: Tensor


def partials(position: Map, u: Tensor, v: Tensor) -> Partials:
    """All partial derivatives up to order two; the mixed one is the mean of both orders."""

    def both(u: Tensor, v: Tensor) -> Tensor:
        return torch.cat(tangents(position, u, v), dim=-1)

    first, by_u, by_v = (pair.tensor_split(2, dim=-1) for pair in _derivatives(both, u, v))
    return Partials(first[0], first[1], by_u[0], 0.5 * (by_u[1] + by_v[0]), by_v[1])


def fundamental_forms(x: Partials) -> tuple[Tensor, Tensor]:
    """First and second fundamental form ``(..., 3)``, each ``(11, 12, 22)``; the second positive where convex."""
    normal = unit(torch.linalg.cross(x.u, x.v))
    first = torch.stack([dot(x.u, x.u), dot(x.u, x.v), dot(x.v, x.v)], dim=-1)
    return first, -torch.stack([dot(normal, x.uu), dot(normal, x.uv), dot(normal, x.vv)], dim=-1)


def dot(a: Tensor, b: Tensor) -> Tensor:
    """Scalar product over the last axis."""
    return (a * b).sum(-1)


def unit(vectors: Tensor) -> Tensor:
    """Vectors divided by their length, which must not be zero."""
    length: Tensor = torch.linalg.vector_norm(vectors, dim=-1, keepdim=True)
    return vectors / length


def shape_operator(first: Tensor, second: Tensor) -> ShapeOperator:
    """Shape operator in an orthonormal frame from both fundamental forms ``(..., 3)``, each ``(11, 12, 22)``.

    The frame is ``x_u / |x_u|`` and the tangent vector 90 degrees to its left (Gram-Schmidt on x_u, x_v).
    """
    e, f, g = first.unbind(-1)
    a, b, c = second.unbind(-1)
    slant = f / e
    height = g - f * slant  # squared length of x_v less its part along x_u
    return ShapeOperator(
        uu=a / e,
        uv=(b - slant * a) / (e * height).sqrt(),
        vv=(c - 2 * slant * b + slant**2 * a) / height,
    )


def area_element(first: Tensor) -> Tensor:
    """Area per unit of parameter area, from the first fundamental form."""
    e, f, g = first.unbind(-1)
    return (e * g - f**2).sqrt()


def eigenvalues(s: ShapeOperator) -> Tensor:
    """Both eigenvalues ``(..., 2)``, the larger first. The derivative at equal eigenvalues is that of their mean."""
    mean, difference = 0.5 * (s.uu + s.vv), 0.5 * (s.uu - s.vv)
    radius = torch.linalg.vector_norm(torch.stack([difference, s.uv], dim=-1), dim=-1)
    return torch.stack([mean + radius, mean - radius], dim=-1)


# The angle of a line field needs a cut somewhere. Parameter lines and diagonals are where fields are usually aligned,
# so the cut stays away from them: rounding errors do not flip directions there.
_CUT = 0.9


def eigen_angle(s: ShapeOperator) -> Tensor:
    """Angle ``(...)`` in radians from the first frame vector to the eigenvector of the larger eigenvalue.

    Zero, with zero derivative, where the eigenvalues agree up to rounding.
    """
    difference = 0.5 * (s.uu - s.vv)
    size = torch.maximum(torch.maximum(s.uu.abs(), s.vv.abs()), s.uv.abs())
    radius = torch.linalg.vector_norm(torch.stack([difference, s.uv], dim=-1), dim=-1)
    umbilic = (radius <= 64 * torch.finfo(size.dtype).eps * size).detach()
    x = torch.where(umbilic, torch.ones_like(radius), difference)
    y = torch.where(umbilic, torch.zeros_like(radius), s.uv)
    cos, sin = torch.cos(torch.full_like(x, _CUT)), torch.sin(torch.full_like(x, _CUT))
    doubled = torch.atan2(cos * y - sin * x, cos * x + sin * y) + _CUT
    return torch.where(umbilic, torch.zeros_like(radius), 0.5 * doubled)


def broadcast(u: Tensor, v: Tensor) -> tuple[Tensor, Tensor]:
    """Both parameters in one shape, contiguous."""
    shape = (u + v).shape
    return u.expand(shape).contiguous(), v.expand(shape).contiguous()
