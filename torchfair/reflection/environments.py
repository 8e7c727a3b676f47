"""Surroundings that a mesh reflects: functions of a direction."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, TypeAlias

import torch
from torch import Tensor, nn

from .._loading import safe_to_load
from ..errors import ShapeError, TorchfairError

Environment: TypeAlias = Callable[[Tensor], Tensor]
"""Takes unit directions (..., 3), returns values (..., channels): any differentiable function will do."""


@safe_to_load
class Stripes(nn.Module):
    r"""Soft parallel stripes, ``1/2 + 1/2 tanh(sharpness sin(2 pi f w.r))`` for a mirror direction ``r``.

    Each of several stripe directions ``w`` gives one channel. Along ``w`` there are ``2 f`` bright and ``2 f`` dark
    stripes from one pole of the sphere to the other.

    Args:
        directions: (channels, 3) or (3,) stripe directions ``w``, across the stripes, of any length but zero.
        frequency: ``f``, one number or (channels,).
        sharpness: above 0; the larger, the harder the borders of the stripes.

    Shape:
        directions (..., 3) to values (..., channels) in 0..1.

    Raises:
        ShapeError: if an argument has another shape.
        TorchfairError: if a direction is zero, or frequency or sharpness are not positive.
    """

    waves: Tensor

    def __init__(self, directions: Tensor, frequency: Tensor | float = 2.5, sharpness: float = 6.0) -> None:
        super().__init__()
        self.register_buffer("waves", _waves(directions, frequency, sharpness))
        self.sharpness = sharpness

    if TYPE_CHECKING:  # torch says Any

        def __call__(self, directions: Tensor) -> Tensor:
            """What ``forward`` gives."""
            ...

    def forward(self, directions: Tensor) -> Tensor:
        """Values (..., channels) at unit ``directions`` (..., 3)."""
        waves = self.waves.to(directions)
        return 0.5 + 0.5 * torch.tanh(self.sharpness * torch.sin(directions @ waves.mT))


class Checker(nn.Module):
    """A soft checkerboard: the product of the waves of :class:`Stripes` in two or three directions.

    ``1/2 + 1/2 tanh(sharpness sin(2 pi f w1.r) sin(2 pi f w2.r) ...)``: one channel.

    Args:
        directions: (k, 3) directions ``w``; x, y and z by default.
        frequency: ``f``, one number or (k,).
        sharpness: above 0.

    Raises:
        ShapeError: if an argument has another shape.
        TorchfairError: if a direction is zero, or frequency or sharpness are not positive.
    """

    waves: Tensor

    def __init__(
        self, directions: Tensor | None = None, frequency: Tensor | float = 2.5, sharpness: float = 12.0
    ) -> None:
        super().__init__()
        self.register_buffer("waves", _waves(torch.eye(3) if directions is None else directions, frequency, sharpness))
        self.sharpness = sharpness

    if TYPE_CHECKING:  # torch says Any

        def __call__(self, directions: Tensor) -> Tensor:
            """What ``forward`` gives."""
            ...

    def forward(self, directions: Tensor) -> Tensor:
        """Values (..., 1) at unit ``directions`` (..., 3)."""
        product = torch.sin(directions @ self.waves.to(directions).mT).prod(-1, keepdim=True)
        return 0.5 + 0.5 * torch.tanh(self.sharpness * product)


class EquirectangularImage(nn.Module):
    """A panorama: a picture of all directions, looked up bilinearly.

    Seen from inside: row 0 is around +z, the last row around -z, the middle column is +x, and columns to the right
    turn clockwise as seen from above (+x, -y, -x). The texel in row i of H and column j of W is the direction with
    ``theta = (i + 1/2) pi / H`` from +z and azimuth ``pi - (j + 1/2) 2 pi / W`` from +x towards +y. The picture is
    continuous across its left and right border; above the first and below the last row of texel centres it
    continues on the opposite side of the pole.

    Args:
        image: (channels, H, W) of any range.
        rotation: (3, 3) rotation applied to directions before they are looked up, to turn the panorama; none by
            default.

    Raises:
        ShapeError: if ``image`` is not a floating (channels, H, W), or ``rotation`` not (3, 3).
        TorchfairError: if ``image`` is not finite.
    """

    image: Tensor
    rotation: Tensor

    def __init__(self, image: Tensor, rotation: Tensor | None = None) -> None:
        super().__init__()
        if image.ndim != 3 or not image.is_floating_point() or image.numel() == 0:
            raise ShapeError("image", "a floating tensor (channels, H, W)", f"{tuple(image.shape)} {image.dtype}")
        if not bool(torch.isfinite(image).all()):
            raise TorchfairError("image must be finite: replace NaN and infinite texels")
        rotation = torch.eye(3, dtype=torch.float64) if rotation is None else torch.as_tensor(rotation)
        if rotation.shape != (3, 3):
            raise ShapeError("rotation", "(3, 3)", tuple(rotation.shape))
        self.register_buffer("image", image)
        self.register_buffer("rotation", rotation.to(torch.float64))

    if TYPE_CHECKING:  # torch says Any

        def __call__(self, directions: Tensor) -> Tensor:
            """What ``forward`` gives."""
            ...

    def forward(self, directions: Tensor) -> Tensor:
        """Values (..., channels) at unit ``directions`` (..., 3)."""
        height, width = self.image.shape[1:]
        x, y, z = (directions @ self.rotation.to(directions).mT).unbind(-1)
        level = torch.hypot(x, y)
        polar = (x * x + y * y > 0) & torch.isfinite(level)
        azimuth = torch.atan2(torch.where(polar, y, 0), torch.where(polar, x, 1))
        theta = torch.atan2(torch.where(polar, torch.hypot(torch.where(polar, x, 1), y), 0), z)
        row = theta * (height / math.pi) - 0.5
        column = (0.5 - azimuth / (2 * math.pi)) * width - 0.5
        top, left = row.detach().floor(), column.detach().floor()
        down, right = (row - top)[..., None], (column - left)[..., None]
        i, j = top.to(torch.int64), left.to(torch.int64)
        upper = torch.lerp(self._texels(i, j, directions), self._texels(i, j + 1, directions), right)
        lower = torch.lerp(self._texels(i + 1, j, directions), self._texels(i + 1, j + 1, directions), right)
        values: Tensor = torch.lerp(upper, lower, down)
        return values

    def _texels(self, row: Tensor, column: Tensor, like: Tensor) -> Tensor:
        """Texels (..., channels); rows beyond a pole are those on the other side of it."""
        channels, height, width = self.image.shape
        beyond = (row < 0) | (row >= height)
        row = torch.where(row < 0, -1 - row, torch.where(row >= height, 2 * height - 1 - row, row))
        column = torch.remainder(column + torch.where(beyond, width // 2, 0), width)
        table = self.image.to(like).reshape(channels, -1).mT
        texels: Tensor = table.index_select(0, (row * width + column).reshape(-1))
        return texels.view(*row.shape, channels)


def _waves(directions: Tensor, frequency: Tensor | float, sharpness: float) -> Tensor:
    """``2 pi f w`` (k, 3), float64."""
    rows = torch.as_tensor(directions).detach().to(torch.float64)
    rows = rows[None] if rows.ndim == 1 else rows
    if rows.ndim != 2 or rows.shape[1] != 3 or rows.shape[0] < 1:
        raise ShapeError("directions", "(channels, 3) or (3,)", tuple(rows.shape))
    frequencies = torch.as_tensor(frequency, dtype=torch.float64).detach()
    if frequencies.shape not in ((), (rows.shape[0],)):
        raise ShapeError("frequency", f"one number or ({rows.shape[0]},)", tuple(frequencies.shape))
    lengths = torch.linalg.vector_norm(rows, dim=-1, keepdim=True)
    if not bool(((lengths > 0) & (lengths < math.inf)).all()):
        raise TorchfairError("stripe directions must be finite and not zero")
    if not bool(((frequencies > 0) & (frequencies < math.inf)).all()) or not 0 < sharpness < math.inf:
        raise TorchfairError("frequency and sharpness must be positive and finite")
    waves: Tensor = 2 * math.pi * frequencies.reshape(-1, 1) * rows / lengths
    return waves
