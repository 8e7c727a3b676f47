"""The reflection score as a loss for training loops."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import torch
from torch import Tensor

from .._loading import safe_to_load
from .._precision import in_single_at_least
from ..cameras import Camera, Size
from ..cameras.camera import height_and_width
from ..energies.base import MeshModule, Reduction
from ..errors import TorchfairError
from ..geometry import face_areas
from ..topology import Topology
from ._comparison import comparison_window, dissimilarity
from .setup import ReflectionSetup
from .smooth_reference import Reference
from .variation import reflection_variation

_FINE = 400
"""Samples along a picture, from which on the soft borders of stripes are wider than a sample."""


@safe_to_load
class ReflectionLoss(MeshModule):
    """``1 - SSIM`` of reflections, differentiable, plus a share of the reflection variation.

    ``forward(vertices)`` (*batch, V, 3) -> (*batch,). The first part is the score of
    :func:`~torchfair.reflection.reflection_score` at one antialiased sample per pixel. Its gradient holds the motion
    of edges in the picture, without which it would point nowhere (see
    :func:`~torchfair.reflection.render_reflection`). Which pixels are compared is worked out anew in every call and
    not differentiated.

    The second part is ``variation_weight`` times the mean dual reflection variation over the six axis directions,
    4/3 E, divided by the square root of the area (of the reference if there is one): dimensionless. Pictures are rough
    functions of the vertices, and this part helps them along; alone it makes slivers and creases. Neither cares for the
    shape of triangles.

    Batches are leading dimensions of the vertices. What is seen where depends on the values: ``torch.func.vmap``,
    export and other recordings are refused. Copies and pickles hold the reference, not its pictures, which are rendered
    again at their first call.

    Args:
        topology: connectivity of all meshes that the module is called with.
        reference: a mesh ``(vertices, topology)``, an analytic surface, a
            :class:`~torchfair.reflection.SmoothReference` or a :class:`~torchfair.reflection.ReflectionSetup`; a
            setup without reference compares every mesh with itself, shaded by its vertex normals.
        variation_weight: see above, at least 0.
        camera: as for :func:`~torchfair.reflection.reflection_score`; a setup brings its own.
        stripe_directions: likewise.
        frequency: likewise.
        size: pixels of the pictures, also in place of those of a setup.
        reduction: see :class:`~torchfair.energies.MeshModule`.

    Raises:
        ShapeError: if a tensor has the wrong shape.
        TorchfairError: for a negative weight, or a reference of another kind.
    """

    reference_images: Tensor | None
    reference_coverage: Tensor | None
    reference_area: Tensor | None

    def __init__(
        self,
        topology: Topology,
        reference: Reference | ReflectionSetup,
        *,
        variation_weight: float = 0.0,
        camera: Camera | None = None,
        stripe_directions: Tensor | None = None,
        frequency: float | None = None,
        size: Size = 128,
        reduction: Reduction = "none",
    ) -> None:
        super().__init__(topology, reduction=reduction)
        if not variation_weight >= 0:
            raise TorchfairError(f"variation_weight must be at least 0, got {variation_weight}")
        if isinstance(reference, ReflectionSetup):
            setup = reference if reference.size == size else replace(reference, size=size)  # which renders anew
        else:
            setup = ReflectionSetup.for_reference(
                reference,
                camera=camera,
                stripe_directions=stripe_directions,
                frequency=frequency,
                size=size,
                supersampling=_samples(size),
            )
        self.setup = setup
        self.variation_weight = variation_weight
        area = None
        if setup.reference is not None:
            with torch.no_grad():
                area = face_areas(setup.reference.vertices, setup.reference.topology).sum()
        for name, tensor in (("images", None), ("coverage", None), ("area", area)):
            self.register_buffer(f"reference_{name}", tensor, persistent=False)
        self._render_reference()

    def __getstate__(self) -> dict[str, Any]:
        buffers = {**self._buffers, "reference_images": None, "reference_coverage": None}
        return {**self.__dict__, "_buffers": buffers}

    @property
    def belongs_to_mesh(self) -> bool:
        """True, since the reference is that of one mesh."""
        return True

    @torch.inference_mode(False)
    def _render_reference(self) -> None:
        if self.setup.reference is not None and self.reference_images is None and self.reference_area is not None:
            images, _, coverage = self.setup.reference_pictures
            like = self.reference_area
            self.reference_images, self.reference_coverage = images.to(like), coverage.to(like)

    def per_mesh(self, vertices: Tensor) -> Tensor:
        """Loss (*batch,) of ``vertices`` (*batch, V, 3)."""
        loss = self.dissimilarity(vertices)
        if self.variation_weight > 0:
            loss = loss + self.variation_weight * self.variation(vertices)
        return loss

    @in_single_at_least
    def dissimilarity(self, vertices: Tensor) -> Tensor:
        """Mean ``1 - SSIM`` (*batch,) over views and stripe directions, 0 where nothing can be compared.

        Of n joined meshes (*batch, n): each is seen alone, and compared with the one reference.
        """
        if not self.topology.is_joined:
            return self._of_one_mesh(vertices, self.topology)
        parts = torch.split(vertices, self.topology.mesh_sizes, -2)
        values = [self._of_one_mesh(part, mesh) for part, mesh in zip(parts, self.topology.meshes, strict=True)]
        return torch.stack(values, -1) if values else vertices.sum(-1)  # no meshes have no vertices

    def _of_one_mesh(self, vertices: Tensor, topology: Topology) -> Tensor:
        rendering = replace(self.setup, supersampling=1)
        flat = rendering.flat(vertices, topology, antialias=True)
        self._render_reference()
        if self.reference_images is None or self.reference_coverage is None:
            images, _, coverage = rendering.smooth(vertices, topology)
        else:
            images, coverage = self.reference_images.to(vertices), self.reference_coverage.to(vertices)
        window = comparison_window(flat.coverage.detach(), coverage.detach())
        per_view = dissimilarity(flat.stripes, images, window).mean(-1)
        return per_view.sum(-1) / window.any(-1).any(-1).sum(-1).clamp(min=1)

    @in_single_at_least
    def variation(self, vertices: Tensor) -> Tensor:
        """Mean dual reflection variation (*batch,) divided by the square root of the area."""
        area = self.reference_area
        if area is None:
            area = self.topology.sum_per_mesh(face_areas(vertices, self.topology), "faces")
        area = area.to(vertices).clamp(min=torch.finfo(vertices.dtype).tiny)
        views = -2 if self.topology.is_joined else -1
        return reflection_variation(vertices, self.topology, form="dual").mean(views) / area.sqrt()

    def extra_repr(self) -> str:
        """The topology and the choices in words."""
        views, size = self.setup.camera.num_views, self.setup.size
        return f"{super().extra_repr()}, {views} views, size={size}, variation_weight={self.variation_weight:g}"


def _samples(size: Size) -> int:
    """Samples along a pixel of the reference: at most 3, and no more than make the picture fine."""
    return max(1, min(3, math.ceil(_FINE / max(height_and_width(size)))))
