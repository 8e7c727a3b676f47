"""What meshes are compared in: views, stripes, and the pictures of a smooth reference."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import Any, NamedTuple

import torch
from torch import Tensor

from .._loading import safe_to_load
from .._tables import cached_table
from ..cameras.camera import Camera, Size, check_camera, height_and_width
from ..errors import TorchfairError
from ..topology import Topology
from .default_views import default_camera, default_stripe_directions
from .environments import Stripes
from .render import Shading, render_reflection, render_shadings
from .smooth_reference import Reference, SmoothReference, smooth_reference

STRIPES = 4.0
"""Stripe pairs over the mirrored directions of the reference, if no frequency is given."""
_FEWEST_RADIANS = 0.05
_PROBE = 96
_FEWEST_CELLS, _MOST_CELLS = 64, 160


class Pictures(NamedTuple):
    """Reflections of one mesh in all views.

    Attributes:
        stripes: (*batch, views, k, H, W) in 0..1, one channel per stripe direction.
        mirrored: (*batch, views, 3, H, W) mean mirrored direction of each pixel.
        coverage: (*batch, views, H, W) in 0..1.
    """

    stripes: Tensor
    mirrored: Tensor
    coverage: Tensor


@safe_to_load
@dataclass(frozen=True, eq=False)
class ReflectionSetup:
    """The same views and stripes for any number of meshes, and what they are compared with.

    Make one with :meth:`for_reference` and use it for all meshes of a comparison: scores are comparable in one setup
    only.

    Attributes:
        camera: the views.
        stripes: the surroundings.
        reference: the smooth surface; None to compare every mesh with itself, shaded by its vertex normals.
        size: pixels of the pictures.
        supersampling: samples per pixel along each side.

    Raises:
        TypeError: if ``camera`` is no :class:`~torchfair.cameras.Camera`.
    """

    camera: Camera
    stripes: Stripes
    reference: SmoothReference | None
    size: Size = 256
    supersampling: int = 3

    def __post_init__(self) -> None:
        check_camera(self.camera)

    @classmethod
    @torch.inference_mode(False)
    def for_reference(
        cls,
        reference: Reference,
        *,
        camera: Camera | None = None,
        stripe_directions: Tensor | None = None,
        frequency: float | None = None,
        size: Size = 256,
        supersampling: int = 3,
    ) -> ReflectionSetup:
        """A setup that suits a smooth reference.

        Args:
            reference: a mesh ``(vertices, topology)``, an analytic surface (sampled as finely as the pictures, by 64 to
                160 quads each way) or a :class:`SmoothReference`.
            camera: the views, by default those of :func:`default_camera`.
            stripe_directions: (k, 3), by default those of :func:`default_stripe_directions`.
            frequency: stripe pairs per unit of ``w.r``; by default such that the directions mirrored by the
                reference run through about four stripe pairs, whatever its curvature.
            size: pixels of the pictures.
            supersampling: samples per pixel along each side.

        Raises:
            ShapeError: if a tensor has the wrong shape.
            TorchfairError: if a vertex is not finite, or a frequency not positive.
            TypeError: if ``camera`` is no :class:`~torchfair.cameras.Camera`.
        """
        # No more cells than pixels: their triangles would be what takes most of the time.
        cells = min(_MOST_CELLS, max(_FEWEST_CELLS, *height_and_width(size)))
        surface = smooth_reference(reference, cells)
        camera = default_camera(surface) if camera is None else camera
        waves = default_stripe_directions(surface) if stripe_directions is None else stripe_directions
        if frequency is None:
            frequency = _frequency(surface, camera, waves)
        return cls(camera, Stripes(waves, frequency), surface, size, supersampling)

    def without_reference(self) -> ReflectionSetup:
        """The same views and stripes, in which every mesh is compared with itself."""
        return replace(self, reference=None)

    def flat(self, vertices: Tensor, topology: Topology, *, antialias: bool = False) -> Pictures:
        """Pictures of a mesh (*batch, V, 3) of plane mirrors, one for every face."""
        return self._render(vertices, topology, antialias=antialias)

    def smooth(self, vertices: Tensor, topology: Topology, normals: Tensor | None = None) -> Pictures:
        """Pictures of ``vertices`` (*batch, V, 3) that mirror with ``normals`` (*batch, V, 3), their own by default."""
        return self._render(vertices, topology, shading="smooth", normals=normals)

    def compared(self, vertices: Tensor, topology: Topology) -> tuple[Pictures, Pictures, Tensor]:
        """Pictures of plane mirrors, what they are compared with, and triangles that are seen, of a mesh (V, 3).

        The same as :meth:`flat` and :meth:`pictures_to_match`, where both pictures are of the same mesh in half the
        time. For the triangles see :func:`torchfair.reflection.render.render_shadings`.
        """
        shadings: tuple[Shading, ...] = ("flat",) if self.reference is not None else ("flat", "smooth")
        pictures, triangles = render_shadings(
            vertices, topology, self.camera, self._surroundings, self.size, self.supersampling, False, shadings
        )
        flat, *own = (_split(picture.image, picture.coverage) for picture in pictures)
        return flat, own[0] if own else self.pictures_to_match(vertices, topology), triangles

    def _render(self, vertices: Tensor, topology: Topology, **shading: Any) -> Pictures:
        picture = render_reflection(
            vertices,
            topology,
            self.camera,
            self._surroundings,
            size=self.size,
            supersampling=self.supersampling,
            **shading,
        )
        return _split(picture.image, picture.coverage)

    def __getstate__(self) -> dict[str, Any]:
        """What copies and pickles hold: no pictures, which are rendered again when they are asked for."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    @cached_table
    def reference_pictures(self) -> Pictures:
        """Pictures of the reference, rendered at the first call and kept.

        Raises:
            TorchfairError: if there is none.
        """
        if self.reference is None:
            raise TorchfairError("this setup has no reference: every mesh is compared with itself")
        with torch.no_grad():
            return self.smooth(self.reference.vertices, self.reference.topology, self.reference.normals)

    def pictures_to_match(self, vertices: Tensor, topology: Topology) -> Pictures:
        """What a mesh (*batch, V, 3) is compared with: the reference, or itself shaded by its vertex normals."""
        if self.reference is None:
            return self.smooth(vertices, topology)
        return Pictures(*(picture.to(vertices) for picture in self.reference_pictures))

    def _surroundings(self, directions: Tensor) -> Tensor:
        return torch.cat([self.stripes(directions), directions], dim=-1)


def _split(image: Tensor, coverage: Tensor) -> Pictures:
    return Pictures(image[..., :-3, :, :], image[..., -3:, :, :], coverage)


def _frequency(surface: SmoothReference, camera: Camera, waves: Tensor) -> float:
    """Stripe pairs per unit of ``w.r`` at which the reference shows about :data:`STRIPES` of them."""
    with torch.no_grad():
        probe = render_reflection(
            surface.vertices,
            surface.topology,
            camera,
            lambda r: r,
            size=_PROBE,
            shading="smooth",
            normals=surface.normals,
        )
    directions = probe.image.movedim(-3, -1)[probe.coverage > 0.999]
    if directions.shape[0] < 2:
        return 1.0
    unit = torch.nn.functional.normalize(torch.as_tensor(waves).to(directions), dim=-1)
    ends = torch.quantile(directions @ unit.T, directions.new_tensor([0.05, 0.95]), dim=0)
    spread = float((ends[1] - ends[0]).mean()) / 0.9
    return STRIPES / max(spread, 2 * math.sin(_FEWEST_RADIANS / 2))
