"""Drawing on the unit sphere: points, great-circle arcs, and the sphere itself, seen from far away."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import torch
from torch import Tensor

from .camera import eye_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SEGMENT = math.radians(4)  # longest straight piece of an arc
_PIECES = 48
_INK = "#0b3d66"
_BEHIND = "#b9c3cf"
_DOT = "#c8501e"
_NET = "#c3ccd6"


@dataclass(frozen=True, eq=False)
class SphereView:
    """A window on the sphere in parallel projection.

    Attributes:
        axes: ``(3, 3)`` rows right, up, towards the eye.
        centre: middle of the window, in radii to the right and up of the middle of the sphere.
        reach: half the side of the square window, in radii.
    """

    axes: Tensor
    centre: tuple[float, float]
    reach: float

    @property
    def net_step(self) -> int:
        """Degrees between the circles of the net: a round number with several circles in the window."""
        across = math.degrees(2 * math.asin(min(self.reach, 1)))
        return max((step for step in (30, 10, 5, 2) if 3 * step <= across), default=1)


def fit_sphere_view(*points: Tensor, towards_eye: Tensor, up: Tensor) -> SphereView:
    """The square window that shows all points ``(N, 3)``; the whole sphere if they spread over most of it.

    Points that are not unit vectors (zero normals of degenerate faces) are ignored.
    """
    axes = eye_axes(towards_eye, up)
    seen = torch.cat([on_sphere(p.detach().to("cpu", torch.float64)) for p in points]) @ axes.T
    if seen.shape[0] == 0 or bool((seen[:, 2] < 0).any()):
        return SphereView(axes, (0.0, 0.0), 1.04)
    low, high = seen[:, :2].amin(0), seen[:, :2].amax(0)
    reach = max(1.12 * float((high - low).max()) / 2, 0.06)
    if reach > 0.7:
        return SphereView(axes, (0.0, 0.0), 1.04)
    x, y = ((low + high) / 2).tolist()
    return SphereView(axes, (x, y), reach)


def on_sphere(points: Tensor) -> Tensor:
    """Those of ``points`` ``(N, 3)`` that are unit vectors."""
    return points[(torch.linalg.vector_norm(points, dim=-1) - 1).abs() < 1e-3]


def draw_sphere(axes: Axes, view: SphereView) -> None:
    """Prepares matplotlib ``axes``: the window, the outline of the sphere and a net of circles about z."""
    from matplotlib.collections import LineCollection
    from matplotlib.patches import Circle

    (x, y), reach = view.centre, view.reach
    axes.set(xlim=(x - reach, x + reach), ylim=(y - reach, y + reach), aspect="equal")
    axes.set_axis_off()
    axes.add_patch(Circle((0, 0), 1, facecolor="#f5f7f9", edgecolor="#8a94a3", linewidth=0.8, zorder=1))
    net = _net(view.net_step) @ view.axes.T
    behind = net[..., 2].mean(1) < 0
    axes.add_collection(LineCollection(list(net[~behind][..., :2].numpy()), colors=_NET, linewidths=0.5, zorder=3))


def draw_arcs(
    axes: Axes, view: SphereView, points: Tensor, arcs: Tensor, width: float, opacity: float = 1.0, color: str = _INK
) -> None:
    """Great-circle arcs between points ``(N, 3)``: strong on the near half of the sphere, faint behind it.

    Arcs at points that are not unit vectors, and between opposite points, are left out.

    Args:
        axes: prepared by :func:`draw_sphere`.
        view: the same view.
        points: unit vectors.
        arcs: ``(M, 2)`` point numbers.
        width: line width in typographic points.
        opacity: of the near lines.
        color: of the near lines.
    """
    from matplotlib.collections import LineCollection

    pieces = [piece @ view.axes.T for piece in arc_pieces(points, arcs)]
    for front, tint, order, alpha in ((False, _BEHIND, 2, 0.6), (True, color, 4, opacity)):
        lines = [line for piece in pieces for line in piece[(piece[..., 2].mean(1) >= 0) == front][..., :2].numpy()]
        drawn = LineCollection(lines, colors=tint, linewidths=width, alpha=alpha, zorder=order, capstyle="round")
        axes.add_collection(drawn)


def draw_points(axes: Axes, view: SphereView, points: Tensor, size: float, color: str = _DOT) -> None:
    """Dots of the given diameter (typographic points) at unit vectors ``(N, 3)``; faint on the far half."""
    seen = on_sphere(points.detach().to("cpu", torch.float64)) @ view.axes.T
    for front, tint, order in ((False, _BEHIND, 2), (True, color, 5)):
        chosen = seen[(seen[:, 2] >= 0) == front].numpy()
        axes.scatter(chosen[:, 0], chosen[:, 1], s=size**2, c=tint, linewidths=0, zorder=order)


def draw_rings(axes: Axes, view: SphereView, points: Tensor, size: float, color: str) -> None:
    """Rings of the given diameter (typographic points) around unit vectors ``(N, 3)``, on both halves."""
    seen = (points.detach().to("cpu", torch.float64) @ view.axes.T).numpy()
    axes.scatter(seen[:, 0], seen[:, 1], s=size**2, facecolors="none", edgecolors=color, linewidths=size / 8, zorder=6)


def arc_pieces(points: Tensor, arcs: Tensor) -> list[Tensor]:
    """Great-circle arcs as polylines ``(n, k, 3)`` on the sphere, one tensor for short arcs and one for long ones."""
    points = points.detach().to("cpu", torch.float64)
    start, stop = points[arcs.cpu()].unbind(1)
    valid = (torch.linalg.vector_norm(start, dim=-1) > 0.5) & (torch.linalg.vector_norm(stop, dim=-1) > 0.5)
    angle = 2 * torch.atan2(
        torch.linalg.vector_norm(start - stop, dim=-1), torch.linalg.vector_norm(start + stop, dim=-1)
    )
    valid &= angle < math.pi - 1e-6
    short = angle <= _SEGMENT
    pieces = []
    for chosen, count in ((valid & short, 1), (valid & ~short, _PIECES)):
        position = torch.linspace(0, 1, count + 1, dtype=torch.float64)[:, None]
        blend = _slerp(start[chosen, None], stop[chosen, None], angle[chosen, None, None], position)
        pieces.append(blend)
    return pieces


def _slerp(start: Tensor, stop: Tensor, angle: Tensor, position: Tensor) -> Tensor:
    sine = torch.sin(angle)
    safe = torch.where(sine > 1e-9, sine, 1)
    first = torch.where(sine > 1e-9, torch.sin((1 - position) * angle) / safe, 1 - position)
    second = torch.where(sine > 1e-9, torch.sin(position * angle) / safe, position)
    return first * start + second * stop


def _net(step: int) -> Tensor:
    """Meridians and parallels about z every ``step`` degrees in short pieces ``(n, 2, 3)``."""
    fine = torch.arange(0, 361, 3, dtype=torch.float64).deg2rad()
    parallels = torch.arange(-90 + step, 90, step, dtype=torch.float64).deg2rad()[:, None]
    meridians = torch.arange(0, 180, step, dtype=torch.float64).deg2rad()[:, None]
    flat = [parallels.cos() * fine.cos(), parallels.cos() * fine.sin(), parallels.sin() + 0 * fine]
    tall = [meridians.cos() * fine.cos(), meridians.sin() * fine.cos(), fine.sin() + 0 * meridians]
    circles = torch.cat([torch.stack(flat, dim=-1), torch.stack(tall, dim=-1)])
    return torch.stack([circles[:, :-1], circles[:, 1:]], dim=2).reshape(-1, 2, 3)
