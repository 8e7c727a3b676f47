"""The score of a mesh by its reflections: how far its picture is from that of a smooth surface."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from .._short_repr import short_repr
from ..cameras.camera import Camera, Size, height_and_width
from ..geometry import face_areas
from ..geometry._ops import norm
from ..topology import Topology
from ._comparison import blur, comparison_window, dissimilarity, masked_mean
from .edge_visibility import edge_visibility, visible_shares
from .setup import Pictures, ReflectionSetup
from .smooth_reference import Reference, SmoothReference, one_finite_mesh
from .variation import reflection_variation
from .variation_from_eyes import reflection_variation_from_eyes


@dataclass(frozen=True, eq=False)
class ReflectionScore:
    """How smooth a mesh looks as a mirror, beside the pictures it was judged by. Numbers are 0-dimensional tensors.

    All are unchanged by rigid motions together with views and stripes, by scaling, and by renumbering. If nothing
    is visible in any view, or no more than a few pixels are, all of them are 0 and so is ``compared``.

    Attributes:
        score: mean of ``1 - SSIM`` over views and stripe directions: 0 for the picture of the reference, larger
            for a picture less like it, at most 2; 0.1 to 0.4 for ordinary meshes of curved surfaces. The only number
            here to rank meshes by.
        reflection_variation: mean over the views of the visible total variation of the mirrored direction, divided
            by the square root of the area of the mesh; dimensionless. Needs no reference. Averaged over all views
            it is the energy of the paper, and never to be minimised alone: see :func:`reflection_variation`.
        rms: root mean square of ``|r - r'|``, r and r' being the mirrored directions of mesh and reference at a
            pixel. Dimensionless, 0 to 2; about 1.6 times the root mean square error of the normals in radians.
        wobble: what is left of ``rms`` when ``r - r'`` is blurred by one edge length (Gaussian): dents larger than a
            face. Near 0 for meshes whose vertices lie on the reference in a regular pattern.
        per_view: (views, k) the ``1 - SSIM`` of every view and stripe direction, 0 in views without a window.
        compared: (views,) part of every picture that is compared: pixels that both meshes cover with all of their
            surroundings of 11 x 11 pixels.
        images: (views, k, H, W) stripes as the flat faces mirror them.
        reference_images: (views, k, H, W) stripes as the reference mirrors them.
        coverage: (views, H, W) part of every pixel that the mesh covers.
        reference_coverage: (views, H, W) part of every pixel that the reference covers.
        window: (views, H, W) bool, the pixels that are compared.
        setup: views, stripes and reference.
    """

    score: Tensor
    reflection_variation: Tensor
    rms: Tensor
    wobble: Tensor
    per_view: Tensor
    compared: Tensor
    images: Tensor
    reference_images: Tensor
    coverage: Tensor
    reference_coverage: Tensor
    window: Tensor
    setup: ReflectionSetup

    __repr__ = short_repr

    def numbers(self) -> dict[str, Tensor | Size]:
        """What a report holds: the four numbers, those of every view, and what was looked at, without the pictures."""
        waves = self.setup.stripes.waves
        lengths = torch.linalg.vector_norm(waves, dim=-1, keepdim=True)
        return {
            "score": self.score,
            "reflection_variation": self.reflection_variation,
            "rms": self.rms,
            "wobble": self.wobble,
            "score_by_view": self.per_view.mean(-1),
            "compared": self.compared,
            "view_directions": self.setup.camera.middle_directions,
            "stripe_directions": waves / lengths,
            "stripe_frequency": lengths[0, 0] / (2 * torch.pi),
            "size": self.setup.size,
        }


def reflection_score(
    vertices: Tensor,
    topology: Topology,
    reference: Reference | ReflectionSetup | None = None,
    *,
    camera: Camera | None = None,
    stripe_directions: Tensor | None = None,
    frequency: float | None = None,
    size: Size = 256,
    supersampling: int = 3,
) -> ReflectionScore:
    """Compares the reflections of a mesh with those of a smooth surface.

    Every face mirrors striped surroundings as a plane mirror. The picture is compared with that of the reference
    by ``1 - SSIM``, averaged over the views and over at least four stripe directions, since one alone misranks:
    the errors of a good mesh often lie in one plane. Only pixels count that both cover.

    Without a reference the mesh is compared with itself, shaded by its own vertex normals. That sees facets, but not
    how far the vertices are from where they should be.

    Args:
        vertices: positions (V, 3) of one mesh, any length unit.
        topology: connectivity; any polygons, mixed. Every polygon mirrors by its one normal.
        reference: a mesh ``(vertices, topology)`` that mirrors with its vertex normals, an analytic surface
            (:class:`torchfair.shapes.Surface`) or a :class:`SmoothReference`; None for the mesh itself. Or a
            :class:`ReflectionSetup`, which brings its views and stripes along and spares rendering the reference
            again.
        camera: the views. By default six that fit the reference: within 40 degrees of its mean normal if it is
            open, all around it if it is closed.
        stripe_directions: (k, 3) directions across the stripes, by default four.
        frequency: stripe pairs per unit of ``w.r``; by default such that the reference shows about four.
        size: pixels of the pictures.
        supersampling: samples per pixel along each side.

    Raises:
        ShapeError: if a tensor has the wrong shape, for instance a batch.
        MeshError: if the topology is joined of several meshes.
        TorchfairError: if a vertex is not finite, or for a reference of another kind.
        TypeError: if ``camera`` is no :class:`~torchfair.cameras.Camera`.
    """
    topology.require_one_mesh("reflection_score")
    mesh = one_finite_mesh(vertices, topology)
    if isinstance(reference, ReflectionSetup):
        setup = reference
    else:
        setup = ReflectionSetup.for_reference(
            SmoothReference.of_mesh(mesh, topology) if reference is None else reference,
            camera=camera,
            stripe_directions=stripe_directions,
            frequency=frequency,
            size=size,
            supersampling=supersampling,
        )
        setup = setup.without_reference() if reference is None else setup
    with torch.no_grad():
        return _compare(mesh, topology, setup, *setup.compared(mesh, topology))


def _compare(
    vertices: Tensor, topology: Topology, setup: ReflectionSetup, flat: Pictures, smooth: Pictures, triangles: Tensor
) -> ReflectionScore:
    window = comparison_window(flat.coverage, smooth.coverage)
    # Single precision moves the mean by less than 1e-5, and is ten times as fast.
    per_view = dissimilarity(flat.stripes.float(), smooth.stripes.float(), window).to(vertices)
    shown = window.any(-1).any(-1)
    error = flat.mirrored - smooth.mirrored
    edges = _edge_pixels(vertices, topology, setup)
    variation = window.new_zeros((), dtype=error.dtype)
    if bool(shown.any()):
        variation = _variation(vertices, topology, setup, triangles)
    return ReflectionScore(
        score=per_view.mean(-1).sum() / shown.sum().clamp(min=1),
        reflection_variation=variation,
        rms=_root_mean_square(error, window),
        wobble=_root_mean_square(blur(error, window, edges), window),
        per_view=per_view,
        compared=window.to(error.dtype).mean((-2, -1)),
        images=flat.stripes,
        reference_images=smooth.stripes,
        coverage=flat.coverage,
        reference_coverage=smooth.coverage,
        window=window,
        setup=setup,
    )


def _root_mean_square(errors: Tensor, window: Tensor) -> Tensor:
    """Over all pixels of the windows of errors (views, 3, H, W)."""
    squares = (errors * errors).sum(-3)
    return masked_mean(squares.flatten(0, 1), window.flatten(0, 1)).sqrt()


def _edge_pixels(vertices: Tensor, topology: Topology, setup: ReflectionSetup) -> Tensor:
    """Mean edge length on the screen in every view, in pixels: (views,)."""
    points = setup.camera.project(vertices, setup.size)[..., :2]
    first, second = points[..., topology.edges, :].unbind(-2)
    lengths = norm(first - second)
    known = torch.isfinite(lengths)
    return torch.where(known, lengths, 0.0).sum(-1) / known.sum(-1).clamp(min=1)


def _variation(vertices: Tensor, topology: Topology, setup: ReflectionSetup, triangles: Tensor) -> Tensor:
    """Mean visible variation over the views divided by the square root of the area."""
    camera = setup.camera
    height, width = height_and_width(setup.size)
    samples = (height * setup.supersampling, width * setup.supersampling)
    if vertices.dtype == torch.float64 and not camera.central:  # else pictures are rounded, or cut, otherwise
        visibility = visible_shares(vertices, topology, camera, samples, nearest=triangles)
    else:
        visibility = edge_visibility(vertices, topology, camera, size=samples)
    if camera.distances is None:
        values = reflection_variation(vertices, topology, camera.middle_directions, visibility=visibility)
    else:
        from_eyes = reflection_variation_from_eyes(vertices, topology, camera.origins, visibility=visibility)
        values = camera.distances.to(vertices) * from_eyes
    area = face_areas(vertices, topology).sum()
    return values.mean() / area.sqrt().clamp(min=torch.finfo(area.dtype).tiny)
