"""What cameras share: several views of one scene, square pixels, straight lines that stay straight."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, TypeAlias, final

import torch
from torch import Tensor

from ..errors import ShapeError

if TYPE_CHECKING:
    from typing import Self

Size: TypeAlias = int | tuple[int, int]
"""Pixels of a picture: one number for a square, or (height, width)."""

_NEAR = 1e-4  # part of the distance of what an eye looks at
_FINAL = {"local", "to_screen", "project", "directions_at", "view_directions", "rays", "weights_in_space"}


@dataclass(frozen=True, eq=False)
class Camera(ABC):
    """Any number of views in which straight lines are straight: all that pictures and reflections ask of a camera.

    The lines of sight of a view are parallel, as in :class:`OrthographicCamera`, or meet in an eye, as in
    :class:`PerspectiveCamera`. Another kind is a frozen dataclass whose fields are tensors ``(views, ...)`` and which
    gives :attr:`axes`, :attr:`origins`, :attr:`distances` and :meth:`scales`; everything else follows from these four.
    What bends lines, such as a fisheye, is no camera here, because the edges of its pictures are no longer straight:
    a subclass that overrides a final method is refused.

    Pixel ``(row j, column i)`` is the square ``[i, i+1] x [j, j+1]``: x runs to the right, y downwards, row 0 is at
    the top. The line of sight along the third local coordinate meets the middle of the picture.

    Example: an oblique view, in which depth runs aslant::

        @dataclass(frozen=True, eq=False)
        class Cavalier(Camera):
            slopes: Tensor  # (views, 2): how far depth goes to the right and up

            @property
            def axes(self) -> Tensor:
                rows = torch.eye(3, dtype=torch.float64).repeat(self.slopes.shape[0], 1, 1)
                rows[:, :2, 2] = self.slopes
                return rows

            @property
            def origins(self) -> Tensor:
                return torch.zeros(self.slopes.shape[0], 3, dtype=torch.float64)

            @property
            def distances(self) -> None:
                return None  # parallel

            def scales(self, width: int) -> Tensor:
                return torch.full((self.slopes.shape[0],), width / 2, dtype=torch.float64)
    """

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        changed = sorted(_FINAL & vars(cls).keys())
        if changed:
            raise TypeError(
                f"{cls.__name__} overrides {', '.join(changed)}: a camera keeps straight lines straight. Give axes, "
                "origins, distances and scales only, or draw your own pictures from your own rays"
            )

    @property
    @abstractmethod
    def axes(self) -> Tensor:
        """Rows ``(views, 3, 3)`` that local coordinates are measured along: right, up, and forward into the scene.

        Unit vectors and perpendicular in the cameras of this package; other rows make oblique views.
        """

    @property
    @abstractmethod
    def origins(self) -> Tensor:
        """``(views, 3)`` origin of local coordinates: the eye, or any point on the middle line of parallel sight."""

    @property
    @abstractmethod
    def distances(self) -> Tensor | None:
        """``(views,)`` from the eyes to what they look at, along the middle; None where lines of sight are parallel."""

    @abstractmethod
    def scales(self, width: int) -> Tensor:
        """``(views,)`` pixels of a picture ``width`` pixels wide per unit of length, for an eye at distance 1."""

    @property
    def num_views(self) -> int:
        """Number of views."""
        return int(self.origins.shape[0])

    @property
    def central(self) -> bool:
        """Whether the lines of sight of a view meet in an eye, :attr:`origins`; else they are parallel."""
        return self.distances is not None

    @property
    def near(self) -> Tensor | None:
        """``(views,)`` least depth at which something is seen: 1e-4 of :attr:`distances`; None if anything is."""
        return None if self.distances is None else _NEAR * self.distances

    @property
    def middle_directions(self) -> Tensor:
        """``(views, 3)`` unit direction of the line of sight in the middle; all others are parallel, or meet it."""
        return torch.nn.functional.normalize(self._local_to_world[:, 2], dim=-1)

    def select(self, views: slice | Tensor) -> Self:
        """The same camera with some of its views."""
        return type(self)(**{field.name: getattr(self, field.name)[views] for field in fields(self)})

    @final
    def local(self, vertices: Tensor) -> Tensor:
        """Positions (*batch, views, V, 3) of vertices (*batch, V, 3) along :attr:`axes`, from :attr:`origins`."""
        axes, origins = self.axes.to(vertices), self.origins.to(vertices)
        return (vertices.unsqueeze(-3) - origins[:, None]) @ axes.mT

    @final
    def to_screen(self, local: Tensor, size: Size, view: Tensor | None = None) -> Tensor:
        """Pixel coordinates x, y and a depth, from what :meth:`local` gives: the same shape.

        The depth grows away from the eye and is affine over the picture: distance along :attr:`axes` for parallel
        views, ``-1 / distance`` for eyes. Points at or behind an eye become NaN.

        Args:
            local: (*batch, views, N, 3), or (N, 3) if ``view`` is given.
            size: of the picture.
            view: (N,) number of the view of each point.
        """
        height, width = height_and_width(size)
        right, up, depth = local.unbind(-1)
        scale = self.scales(width).to(local)
        scale = scale[:, None] if view is None else scale[view]
        if self.central:
            inverse = 1 / torch.where(depth > 0, depth, torch.nan)
            scale, depth = scale * inverse, -inverse
        return torch.stack([width / 2 + scale * right, height / 2 - scale * up, depth], dim=-1)

    @final
    def project(self, vertices: Tensor, size: Size) -> Tensor:
        """Pixel coordinates x, y and depth of vertices (*batch, V, 3): (*batch, views, V, 3). See :meth:`to_screen`."""
        return self.to_screen(self.local(vertices), size)

    @final
    def directions_at(self, pixels: Tensor, size: Size, view: Tensor | None = None) -> Tensor:
        """Unit directions ``(views, *any, 3)`` from the eye through ``pixels`` ``(views, *any, 2)`` of the picture.

        With ``view`` (N,), the number of the view of each place: (N, 3) at places (N, 2).
        """
        if not self.central:
            return _of_places(self.middle_directions.to(pixels), pixels, view).expand(*pixels.shape[:-1], 3)
        right, up = self._across(pixels, size, view)
        x, y, z = (_of_places(row.to(pixels), pixels, view) for row in self._local_to_world.unbind(1))
        return torch.nn.functional.normalize(right * x + up * y + z, dim=-1)

    @final
    def view_directions(self, points: Tensor) -> Tensor:
        """Unit directions from the eye to points ``(*batch, N, 3)``: (*batch, views, N, 3), zero at the eye itself."""
        if self.central:
            return torch.nn.functional.normalize(points.unsqueeze(-3) - self.origins.to(points)[:, None], dim=-1)
        shape = (*points.shape[:-2], self.num_views, points.shape[-2], 3)
        return self.middle_directions.to(points)[:, None].expand(shape)

    @final
    def rays(self, size: Size) -> tuple[Tensor, Tensor]:
        """Origins and unit directions ``(views, height, width, 3)`` of the rays through the pixel centres.

        Rays of a parallel view start beside its origin: move them back along the direction to cast them.
        """
        height, width = height_and_width(size)
        y, x = torch.meshgrid(
            torch.arange(height, dtype=torch.float64) + 0.5,
            torch.arange(width, dtype=torch.float64) + 0.5,
            indexing="ij",
        )
        pixels = torch.stack([x, y], dim=-1).to(self.axes).expand(self.num_views, -1, -1, -1)
        origins = _of_places(self.origins, pixels).expand(*pixels.shape[:-1], 3)
        if not self.central:
            right, up = self._across(pixels, size)
            x, y, _ = (_of_places(row, pixels) for row in self._local_to_world.unbind(1))
            origins = origins + right * x + up * y
        return origins, self.directions_at(pixels, size)

    @final
    def weights_in_space(self, weights: Tensor, depths: Tensor) -> Tensor:
        """Weights of corners in space, up to a common factor.

        They follow from ``weights`` (..., 3) in the picture and ``depths`` (..., 3) of the corners.
        """
        return weights * -depths if self.central else weights  # depth is -1 / distance

    @property
    def _local_to_world(self) -> Tensor:
        """(views, 3, 3): a step along each local coordinate alone, as rows."""
        inverse: Tensor = torch.linalg.inv(self.axes)
        return inverse.mT

    def _across(self, pixels: Tensor, size: Size, view: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """How far places lie to the right and up of the middle, at distance 1 of an eye, each (..., 1)."""
        height, width = height_and_width(size)
        scale = _of_places(self.scales(width).to(pixels)[:, None], pixels, view)
        across = (pixels - pixels.new_tensor([width / 2, height / 2])) * pixels.new_tensor([1.0, -1.0]) / scale
        return across[..., :1], across[..., 1:]


def check_camera(camera: object) -> None:
    """Raises TypeError for what is no camera."""
    if not isinstance(camera, Camera):
        raise TypeError(
            "camera must be an OrthographicCamera, a PerspectiveCamera or another subclass of "
            f"torchfair.cameras.Camera, in whose pictures straight lines are straight; got {type(camera).__name__}"
        )


def height_and_width(size: Size) -> tuple[int, int]:
    """``size`` as (height, width).

    Raises:
        ShapeError: unless both are at least 1.
    """
    height, width = (size, size) if isinstance(size, int) else size
    if height < 1 or width < 1:
        raise ShapeError("size", "at least one pixel each way", (height, width))
    return height, width


def _of_places(rows: Tensor, pixels: Tensor, view: Tensor | None = None) -> Tensor:
    """``rows`` (views, d) beside places (views, *any, 2), or those of the view of each of places (N, 2)."""
    return rows.view(-1, *[1] * (pixels.ndim - 2), rows.shape[-1]) if view is None else rows[view]
