"""Closest points on analytic surfaces, on level sets and on height functions: references of jobs that are no meshes."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor
from torch.func import grad, hessian, vmap

from torchfair.errors import MeshError, ShapeError, TorchfairError

from ._checks import is_integer_from
from ._forms import dot
from .surface import Surface

_STEPS = 30
_HALVINGS = 6
_POLISHES = 2
_ROWS = 2048  # points compared with all samples at once
_CLOSE = 1e-4  # moves of parameters after which two steps of Newton's method give the last digits
_NEAR = 1e-6  # relative moves at which the walk to a level set ends
_STILL = 1e-15  # and those of Newton's method
_REACHED = 1e-9  # of the size of things, up to which a point is on a level set


class ClosestOnSurface:
    """Closest points of an analytic surface, for :func:`torchfair.geometry.closest_on`, jobs and closeness.

    The nearest of a lattice of samples is where Newton's method on the parameters starts; the distance falls in every
    step, and the parameters stay in the domain, so that the surface ends at its boundary. Exact to rounding where the
    lattice is fine enough to tell branches apart: points nearer to the surface than its smallest radius of curvature.
    At the centre of a sphere, or where several points are equally near, one of them is found.

    Args:
        surface: Any surface of :mod:`torchfair.shapes`, or your own :class:`Surface`.
        samples: Along u and v each, from 2 on.

    Raises:
        TorchfairError: if ``samples`` is not an integer from 2 on.

    Example:
        >>> import torch
        >>> from torchfair.shapes import ClosestOnSurface
        >>> from torchfair.shapes import Torus
        >>> positions, normals = ClosestOnSurface(Torus(2.0, 0.5))(torch.tensor([[3.0, 0.0, 0.0]], dtype=torch.float64))
        >>> positions.round(decimals=6)
        tensor([[2.5000, 0.0000, 0.0000]], dtype=torch.float64)
    """

    def __init__(self, surface: Surface, samples: int = 48) -> None:
        if not is_integer_from(2, samples):
            raise TorchfairError(f"samples must be an integer of at least 2, got {samples!r}")
        self.surface = surface
        low, high = torch.tensor(surface.domain, dtype=torch.float64).unbind(1)
        periodic = torch.tensor(surface.periodic)
        self._low, self._high = (torch.where(periodic, sign * torch.inf, end) for sign, end in ((-1, low), (1, high)))
        # In the middle of cells: at a pole there is no way to go.
        share = (torch.arange(samples, dtype=torch.float64)[:, None] + 0.5) / samples
        u, v = (low + share * (high - low)).unbind(1)
        self._parameters = torch.cartesian_prod(u, v)
        self._samples = surface.position(*self._parameters.unbind(1))

    def __call__(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """Closest points (N, 3) of ``points`` (N, 3), and the unit normals (N, 3) of the surface there."""
        parameters = self.parameters(points).to(points)
        u, v = parameters.unbind(1)
        return self.surface.position(u, v), self.surface.normal(u, v)

    def parameters(self, points: Tensor) -> Tensor:
        """Parameters (N, 2) float64 of the closest points of ``points`` (N, 3), on their device."""
        points = _float64(points)
        low, high = self._low.to(points.device), self._high.to(points.device)
        place = self._nearest_samples(points)
        for _ in range(_STEPS):
            last, place = place, self._nearer(place, points, low, high)
            if not bool(((place - last).abs() > _CLOSE * (high - low).clamp_max(1.0)).any()):
                break
        return self._polished(place, points, low, high)

    def _nearest_samples(self, points: Tensor) -> Tensor:
        samples = self._samples.to(points.device)
        nearest = [torch.cdist(rows, samples).argmin(1) for rows in torch.split(points, _ROWS)]
        return self._parameters.to(points.device)[torch.cat(nearest)] if nearest else points.new_zeros(0, 2)

    def _nearer(self, place: Tensor, points: Tensor, low: Tensor, high: Tensor) -> Tensor:
        """One step of Newton's method within the domain, or the first half, quarter, ... of it that comes nearer.

        Where it ends at the border of the domain it may lead nowhere; there u and v are improved each on its own.
        """
        step, _, alone = self._newton(place, points, low, high)
        least = self._squares(place, points)
        waits = torch.ones_like(least, dtype=torch.bool)
        found = place
        for way in (*(0.5**halving * step for halving in range(_HALVINGS)), alone, 0.25 * alone, 0.01 * alone):
            trial = (place + way).clamp(low, high)
            better = waits & (self._squares(trial, points) < least)
            found, waits = torch.where(better[:, None], trial, found), waits & ~better
            if not bool(waits.any()):
                break
        return found

    def _squares(self, place: Tensor, points: Tensor) -> Tensor:
        away = self.surface.position(*place.unbind(1)) - points
        return dot(away, away)

    def _polished(self, place: Tensor, points: Tensor, low: Tensor, high: Tensor) -> Tensor:
        """The last digits: distances do not tell them any more, but slopes do."""
        step, slope, _ = self._newton(place, points, low, high)
        for _ in range(_POLISHES):
            trial = (place + step).clamp(low, high)
            further, other, _ = self._newton(trial, points, low, high)
            better = (other.abs().sum(1) < slope.abs().sum(1))[:, None]
            place, slope = torch.where(better, trial, place), torch.where(better, other, slope)
            step = torch.where(better, further, 0.0)
        return place

    def _newton(self, place: Tensor, points: Tensor, low: Tensor, high: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """The step (N, 2), the slope (N, 2) of half the squared distance, and the step by u and v alone.

        All are zero across an end of the domain that holds.
        """
        x = self.surface._partials(*place.unbind(1))
        away = self.surface.position(*place.unbind(1)) - points
        slope = torch.stack([dot(x.u, away), dot(x.v, away)], dim=1)
        first = (dot(x.u, x.u), dot(x.u, x.v), dot(x.v, x.v))
        whole = tuple(a + dot(away, b) for a, b in zip(first, (x.uu, x.uv, x.vv), strict=True))
        convex = (whole[0] > 0) & (whole[0] * whole[2] > whole[1].square())
        a, b, c = (torch.where(convex, w, f) for w, f in zip(whole, first, strict=True))
        held = ((place <= low) & (slope > 0)) | ((place >= high) & (slope < 0))
        slope = torch.where(held, 0.0, slope)
        return _solved(a, b, c, -slope, held), slope, -slope / torch.stack([a, c], dim=1).clamp_min(1e-300)


def _solved(a: Tensor, b: Tensor, c: Tensor, right: Tensor, held: Tensor) -> Tensor:
    """Solutions (N, 2) of ``[[a, b], [b, c]] x = right`` without held unknowns, slightly damped."""
    b = torch.where(held.any(1), 0.0, b)
    damping = 1e-13 * (a + c) + 1e-300
    a, c = a + damping, c + damping
    determinant = (a * c - b * b).clamp_min(1e-300)
    p, q = right.unbind(1)
    return torch.stack([c * p - b * q, a * q - b * p], dim=1) / determinant[:, None]


class ClosestOnLevelSet:
    """Closest points of a level set ``f = 0``, for :func:`torchfair.geometry.closest_on`, jobs and closeness.

    Newton's method on the conditions that the offset is along the gradient and f vanishes; it starts from a walk down
    the gradient. Exact to rounding for points nearer to the level set than its smallest radius of curvature.

    Args:
        function: Takes one point (3,) and returns a number, made of operations of torch that can be differentiated
            twice; it need not be a distance, but its gradient must not vanish near the level set.

    Example:
        >>> import torch
        >>> from torchfair.shapes import ClosestOnLevelSet
        >>> ball = ClosestOnLevelSet(lambda p: p.square().sum() - 4.0)
        >>> ball(torch.tensor([[0.0, 3.0, 4.0]], dtype=torch.float64))[0]
        tensor([[0.0000, 1.2000, 1.6000]], dtype=torch.float64)
    """

    def __init__(self, function: Callable[[Tensor], Tensor]) -> None:
        self.function = function

    def __call__(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """Closest points (N, 3) of ``points`` (N, 3), and unit normals (N, 3) along the gradient there.

        Raises:
            MeshError: if the level set is not reached from a point; the first few such rows are named.
        """
        start = _float64(points)
        if not start.shape[0]:
            return points, points
        values, slopes, bends = (vmap(f) for f in (self.function, grad(self.function), hessian(self.function)))
        place = start
        for _ in range(_STEPS):
            value, slope = values(place), slopes(place)
            walk = (value / dot(slope, slope))[:, None] * slope
            place = place - walk
            if not bool((walk.abs() > _NEAR * (1.0 + place.abs())).any()):
                break
        for _ in range(_STEPS):
            last, place = place, _nearer(place, start, values(place), slopes(place), bends(place))
            if not bool(((place - last).abs() > _STILL * (1.0 + place.abs())).any()):
                break
        value, slope = values(place), slopes(place)
        length = torch.linalg.vector_norm(slope, dim=1, keepdim=True)
        size = 1.0 + place.abs().amax(1)
        lost = torch.nonzero(~((value.abs() / length[:, 0]) < _REACHED * size)).squeeze(1).tolist()
        if lost:
            raise MeshError(
                f"the level set is not reached from {len(lost)} points, first {lost[:5]}: its gradient vanishes on the "
                "way, or there is no level set; start nearer to it"
            )
        return place.to(points), (slope / length).to(points)


def _nearer(place: Tensor, start: Tensor, value: Tensor, slope: Tensor, bend: Tensor) -> Tensor:
    """One step of Newton's method towards the point of the level set nearest to ``start``.

    Where that turns uphill the step is along the tangent plane of the level set.
    """
    squared = dot(slope, slope)
    multiplier = dot(start - place, slope) / squared
    eye = torch.eye(3, dtype=place.dtype, device=place.device)
    block = eye + multiplier[:, None, None] * bend
    bordered = torch.cat([torch.cat([block, slope[..., None]], 2), torch.nn.functional.pad(slope, (0, 1))[:, None]], 1)
    right = torch.cat([start - place, -value[:, None]], dim=1)
    newton = torch.linalg.solve_ex(bordered, right).result[:, :3]
    away = start - place
    plain = away - ((dot(away, slope) + value) / squared)[:, None] * slope
    convex = torch.linalg.eigvalsh(block).amin(1) > 0.1
    takes = convex & newton.isfinite().all(1)
    return place + torch.where(takes[:, None], newton, 0.5 * plain)


def closest_on_height_field(height: Callable[[Tensor, Tensor], Tensor]) -> ClosestOnLevelSet:
    """Closest points of the surface ``z = height(x, y)``; normals point down.

    Args:
        height: Takes two numbers as tensors and returns one, made of operations of torch that can be differentiated
            twice, wherever jobs may ask.

    Example:
        >>> import torch
        >>> from torchfair.shapes import closest_on_height_field
        >>> closest = closest_on_height_field(lambda x, y: 0.5 * (x * x - y * y))
        >>> closest(torch.tensor([[0.0, 0.0, 0.5]], dtype=torch.float64))[0].abs()
        tensor([[0., 0., 0.]], dtype=torch.float64)
    """
    return ClosestOnLevelSet(_Below(height))


class _Below:
    """How far a point is below a height field."""

    def __init__(self, height: Callable[[Tensor, Tensor], Tensor]) -> None:
        self.height = height

    def __call__(self, point: Tensor) -> Tensor:
        x, y, z = point.unbind()
        return self.height(x, y) - z


def _float64(points: Tensor) -> Tensor:
    if not isinstance(points, Tensor) or points.shape[1:] != (3,) or not points.is_floating_point():
        actual = tuple(points.shape) if isinstance(points, Tensor) else type(points).__name__
        raise ShapeError("points", "a floating tensor (N, 3)", actual)
    return points.detach().to(torch.float64)
