"""What cameras share: several views of one scene, square pixels."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, TypeAlias

import torch
from torch import Tensor

from ..errors import ShapeError, TorchfairError

if TYPE_CHECKING:
    from typing import Self

Size: TypeAlias = int | tuple[int, int]
"""Pixels of a picture: one number for a square, or (height, width)."""


@dataclass(frozen=True, eq=False)
class Camera(ABC):
    """What both cameras share: several views, square pixels, float64 tensors on the CPU until asked for elsewhere.

    Pixel ``(row j, column i)`` is the square ``[i, i+1] x [j, j+1]``: x runs to the right, y downwards, row 0 is at
    the top. The line of sight through the target meets the middle of the picture.
    """

    @property
    def num_views(self) -> int:
        """Number of views."""
        return int(self.axes.shape[0])

    @property
    @abstractmethod
    def axes(self) -> Tensor:
        """Orthonormal rows ``(views, 3, 3)``: right, up, and forward (from the eye into the scene)."""

    @property
    @abstractmethod
    def origins(self) -> Tensor:
        """``(views, 3)`` a point on the line of sight: the eye if there is one, else the target."""

    @property
    @abstractmethod
    def near(self) -> Tensor | None:
        """``(views,)`` least distance along the line of sight at which something is seen; None if anything is."""

    @abstractmethod
    def to_screen(self, local: Tensor, size: Size, view: Tensor | None = None) -> Tensor:
        """Pixel coordinates x, y and a depth, from what :meth:`local` gives: the same shape.

        The depth grows away from the eye and is affine over the picture: distance along the line of sight for
        parallel views, ``-1 / distance`` for perspective. Points at or behind an eye become NaN.

        Args:
            local: (*batch, views, N, 3), or (N, 3) if ``view`` is given.
            size: of the picture.
            view: (N,) number of the view of each point.
        """

    @abstractmethod
    def directions_at(self, pixels: Tensor, size: Size, view: Tensor | None = None) -> Tensor:
        """Unit directions ``(views, *any, 3)`` from the eye through places ``(views, *any, 2)`` of the picture.

        With ``view`` (N,), the number of the view of each place: (N, 3) at places (N, 2).
        """

    @abstractmethod
    def view_directions(self, points: Tensor) -> Tensor:
        """Unit directions from the eye to points ``(*batch, N, 3)``: (*batch, views, N, 3).

        The zero vector at the eye itself.
        """

    def select(self, views: slice | Tensor) -> Self:
        """The same camera with some of its views."""
        return type(self)(**{field.name: getattr(self, field.name)[views] for field in fields(self)})

    def local(self, vertices: Tensor) -> Tensor:
        """Positions (*batch, views, V, 3) of vertices (*batch, V, 3) along :attr:`axes`, from :attr:`origins`."""
        axes, origins = self.axes.to(vertices), self.origins.to(vertices)
        return (vertices.unsqueeze(-3) - origins[:, None]) @ axes.mT

    def project(self, vertices: Tensor, size: Size) -> Tensor:
        """Pixel coordinates x, y and depth of vertices (*batch, V, 3): (*batch, views, V, 3). See :meth:`to_screen`."""
        return self.to_screen(self.local(vertices), size)

    def rays(self, size: Size) -> tuple[Tensor, Tensor]:
        """Origins and unit directions ``(views, height, width, 3)`` of the rays through the pixel centres.

        Rays of a parallel view start in the plane through its target: move them back along the direction to cast them.
        """
        height, width = height_and_width(size)
        y, x = torch.meshgrid(
            torch.arange(height, dtype=torch.float64) + 0.5,
            torch.arange(width, dtype=torch.float64) + 0.5,
            indexing="ij",
        )
        pixels = torch.stack([x, y], dim=-1).to(self.axes).expand(self.num_views, -1, -1, -1)
        return self._origins_at(pixels, size), self.directions_at(pixels, size)

    @abstractmethod
    def _origins_at(self, pixels: Tensor, size: Size) -> Tensor:
        """Points of the rays through places of the picture."""


def height_and_width(size: Size) -> tuple[int, int]:
    """``size`` as (height, width).

    Raises:
        ShapeError: unless both are at least 1.
    """
    height, width = (size, size) if isinstance(size, int) else size
    if height < 1 or width < 1:
        raise ShapeError("size", "at least one pixel each way", (height, width))
    return height, width


def camera_rows(name: str, given: Tensor, views: int | None = None) -> Tensor:
    """``given`` as a finite float64 tensor (views, 3)."""
    rows = torch.as_tensor(given).detach().to(torch.float64)
    rows = rows[None] if rows.ndim == 1 else rows
    wanted = "(views, 3)" if views is None else f"({views}, 3)"
    if rows.ndim != 2 or rows.shape[1] != 3 or rows.shape[0] < 1 or rows.shape[0] not in (views or rows.shape[0], 1):
        raise ShapeError(name, f"{wanted} or (3,)", tuple(rows.shape))
    if not bool(torch.isfinite(rows).all()):
        raise TorchfairError(f"{name} must be finite")
    return rows.expand(views or rows.shape[0], 3)


def unit_directions(directions: Tensor) -> Tensor:
    """``directions`` (views, 3) made unit vectors, which they must be long enough for."""
    lengths = torch.linalg.vector_norm(directions, dim=-1, keepdim=True)
    if not bool((lengths > 0).all()):
        raise TorchfairError("a view needs a direction that is not zero: the eye must not be at its target")
    units: Tensor = directions / lengths
    return units


def positive_numbers(name: str, given: Tensor | float, views: int) -> Tensor:
    """``given`` as float64 numbers (views,), all of them positive and finite."""
    numbers = torch.as_tensor(given, dtype=torch.float64).detach()
    if numbers.shape not in ((), (1,), (views,)):
        raise ShapeError(name, f"one number or ({views},)", tuple(numbers.shape))
    if not bool(((numbers > 0) & (numbers < math.inf)).all()):
        raise TorchfairError(f"{name} must be positive and finite")
    return numbers.expand(views)


def fill_attributes(camera: Camera, **values: Tensor) -> None:
    """Sets the attributes of a frozen camera."""
    for field in fields(camera):
        object.__setattr__(camera, field.name, values[field.name])
