"""Reflections of an environment in a mesh, as pictures."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Literal, NamedTuple

import torch
from torch import Tensor
from torch.autograd.forward_ad import unpack_dual

from .._precision import in_single_at_least
from .._tracing import refuse_recording
from ..cameras.camera import Camera, Size, check_camera, height_and_width
from ..errors import ShapeError, TorchfairError
from ..geometry import face_normals, vertex_normals
from ..rasterisation import visible_triangles
from ..topology import Topology
from ._edge_terms import edge_terms
from ._samples import coarse_pixels, mean_colors
from ._scene import build_scene
from ._shading import ConstantShader, PlaceShader, Shader, Surroundings
from .environments import Environment

Shading = Literal["flat", "smooth"]

_MOST = 1 << 23  # samples worked on at a time
_MOST_FACES = 1 << 20  # of all pictures that are worked on at a time


class Reflection(NamedTuple):
    """What :func:`render_reflection` sees. Row 0 of a picture is its top row.

    Attributes:
        image: (*batch, views, channels, H, W), the background where nothing is seen.
        coverage: (*batch, views, H, W), the part of each pixel that the mesh covers, 0 to 1.
        face_index: (*batch, views, supersampling H, supersampling W) int64, the face seen at each sample, -1 for none.
    """

    image: Tensor
    coverage: Tensor
    face_index: Tensor


def render_reflection(
    vertices: Tensor,
    topology: Topology,
    camera: Camera,
    environment: Environment,
    *,
    size: Size = 256,
    supersampling: int = 1,
    antialias: bool = False,
    shading: Shading = "flat",
    normals: Tensor | None = None,
    background: Tensor | float = 0.0,
) -> Reflection:
    """The environment as the mesh mirrors it, one picture for every mesh of the batch in every view.

    Each place shows the environment in the mirrored line of sight ``r = d - 2 (d.n) n``, one reflection deep. Both
    sides of a face mirror. A polygon mirrors as one plane, perpendicular to its area vector (see
    :func:`torchfair.geometry.face_area_vectors`), and shows no seam where it is cut into triangles. The nearest face
    hides the others; of faces at the same depth the one with the smaller number is seen, on every device. Faces
    without area on the screen are not seen. Where nothing is seen, the image is ``background`` and the coverage 0.

    **Pixels.** Samples are taken at the centres of ``supersampling``^2 squares in each pixel and averaged.
    With ``antialias`` each of these squares shows the mean over the faces in it instead, weighted by the exact areas
    that they cover, hidden parts cut away: exact to 1e-7, but where faces penetrate each other, and for faces up to
    1e7 times as large as the picture. For a face its colour at the centre of the square counts. Pictures are the same
    at every call; on GPUs, sums over the edges in a pixel may differ in the last bits.

    **Gradients** with respect to vertices, normals and parameters of the environment are those of the image with
    ``antialias``, whether it is asked for or not: exact derivatives of areas and colours, which follow the motion of
    every edge, inside the mesh, on its outline and where one part hides another. So the gradient without
    ``antialias`` is not that of the sampled image, which jumps as edges pass samples, but of the one it samples. It is
    finite everywhere, in reverse and forward mode. Lines along which faces penetrate each other move without
    contributing. Boundary edges with equal ends count as one edge. In functions compiled by ``torch.compile``
    pictures are left to eager mode (a graph break).

    Args:
        vertices: positions (*batch, V, 3), finite.
        topology: connectivity; any polygons that are star-shaped from one of their corners, mixed.
        camera: the views. What lies nearer to a perspective eye than 1e-4 of the distance of its target, or behind
            it, is cut away.
        environment: takes unit directions (..., 3), returns values (..., channels).
        size: pixels of a picture, (height, width) or one number for a square.
        supersampling: squares along each side of a pixel, at least 1.
        antialias: whether squares show the exact mean of the faces in them.
        shading: ``"flat"``, one normal per face, or ``"smooth"``, vertex normals blended over each face (straight in
            space), as for a smooth reference surface.
        normals: unit normals to use instead of those of the mesh: (*batch, F, 3) for flat and (*batch, V, 3) for
            smooth shading. The zero vector lets the line of sight pass straight through.
        background: a number or (channels,).

    Raises:
        ShapeError: if a tensor has the wrong shape, or the size is below one pixel.
        TorchfairError: if a vertex is not finite, or for an unknown shading or a supersampling below 1; under
            ``vmap``, and where calls are recorded (export, ``make_fx``, ``jit.trace``, ``linearize``).
        TypeError: if ``camera`` is no :class:`~torchfair.cameras.Camera`.
    """
    refuse_recording("render_reflection")
    draw = render_shadings
    if torch.compiler.is_compiling():  # left to eager mode: sizes depend on what is seen
        draw = torch.compiler.disable(render_shadings)  # type: ignore[no-untyped-call]
    pictures, _ = draw(
        vertices, topology, camera, environment, size, supersampling, antialias, (shading,), normals, background
    )
    return pictures[0]


@in_single_at_least
def render_shadings(
    vertices: Tensor,
    topology: Topology,
    camera: Camera,
    environment: Environment,
    size: Size,
    supersampling: int,
    antialias: bool,
    shadings: Sequence[Shading],
    normals: Tensor | None = None,
    background: Tensor | float = 0.0,
) -> tuple[list[Reflection], Tensor]:
    """What :func:`render_reflection` gives in several shadings, for which faces are looked for once.

    Also the triangles (*batch, views, supersampling H, supersampling W) int64 that are seen, -1 for none: numbers of
    those of ``triangulate``, where nothing is cut away, as in all parallel views.
    """
    check_camera(camera)
    topology.check_vertices(vertices)
    height, width = height_and_width(size)
    if not bool(torch.isfinite(vertices).all()):
        raise TorchfairError("a vertex is not finite: pictures need positions without NaN and infinity")
    for shading in shadings:
        if shading not in ("flat", "smooth"):
            raise TorchfairError(f'shading must be "flat" or "smooth", got {shading!r}')
    if supersampling < 1:
        raise TorchfairError(f"supersampling must be at least 1, got {supersampling}")
    surfaces = [_Surface.of(vertices, topology, shading, normals) for shading in shadings]
    around = Surroundings(camera, (height * supersampling, width * supersampling), environment, background)
    *pictures, faces, triangles = _pictures(vertices, topology, surfaces, around, supersampling, antialias)
    reflections = []
    for colors in pictures:
        image = colors.view(*colors.shape[:-2], height, width, colors.shape[-1]).movedim(-1, -3)
        reflections.append(Reflection(image[..., :-1, :, :].contiguous(), image[..., -1, :, :].contiguous(), faces))
    return reflections, triangles


class _Surface(NamedTuple):
    """What mirrors: unit normals (*batch, F or V, 3), and whether they are blended over each face."""

    normals: Tensor
    smooth: bool

    @classmethod
    def of(cls, vertices: Tensor, topology: Topology, shading: Shading, normals: Tensor | None) -> _Surface:
        """With the normals that are given, or those of the mesh."""
        if normals is None:
            normals = (vertex_normals if shading == "smooth" else face_normals)(vertices, topology)
        else:
            _check_normals(normals, vertices, topology, shading)
        return cls(normals, shading == "smooth")

    def part(self, chosen: slice) -> _Surface:
        """Of some meshes of a batch (meshes, ...)."""
        return self._replace(normals=self.normals[chosen])


def _pictures(
    vertices: Tensor,
    topology: Topology,
    surfaces: Sequence[_Surface],
    around: Surroundings,
    factor: int,
    antialias: bool,
) -> list[Tensor]:
    """All pictures, some at a time: (*batch, views, H W, channels + 1) of each surface; faces, triangles of samples."""
    batch, views = vertices.shape[:-2], around.camera.num_views
    if not math.prod(batch):  # one mesh tells the shapes
        one = [surface._replace(normals=surface.normals.new_zeros(surface.normals.shape[-2:])) for surface in surfaces]
        *pictures, faces, triangles = _pictures(
            vertices.new_zeros(vertices.shape[-2:]), topology, one, around, factor, antialias
        )
        nothing = vertices.sum((-2, -1))[..., None, None, None]
        pictures = [part.expand(*batch, *part.shape) + nothing for part in pictures]
        return [*pictures, *(part.expand(*batch, *part.shape) for part in (faces, triangles))]
    meshes = vertices.reshape(math.prod(batch), *vertices.shape[-2:])
    surfaces = [
        surface._replace(normals=surface.normals.reshape(len(meshes), *surface.normals.shape[-2:]))
        for surface in surfaces
    ]
    mesh_step, view_step = _steps(topology.num_faces, views, height_and_width(around.size))
    rows = []
    for first in range(0, max(meshes.shape[0], 1), mesh_step):
        chosen = slice(first, first + mesh_step)
        row = []
        for view in range(0, views, view_step):
            some = dataclasses.replace(around, camera=around.camera.select(slice(view, view + view_step)))
            own = [surface.part(chosen) for surface in surfaces]
            row.append(_render(meshes[chosen], topology, own, some, factor, antialias))
        rows.append([torch.cat(parts, dim=1) for parts in zip(*row, strict=True)])
    columns = [torch.cat(parts) for parts in zip(*rows, strict=True)]
    return [column.view(*batch, *column.shape[1:]) for column in columns]


def _render(
    meshes: Tensor,
    topology: Topology,
    surfaces: Sequence[_Surface],
    around: Surroundings,
    factor: int,
    antialias: bool,
) -> list[Tensor]:
    """Colours and coverage (meshes, views, H W, channels + 1) of each surface; faces and triangles of the samples."""
    camera, (height, width) = around.camera, height_and_width(around.size)
    scene = build_scene(meshes, topology, camera, around.size)
    seen = visible_triangles(
        scene.points, scene.triangles, width, height, pictures=scene.pictures, num_pictures=scene.num_pictures
    )
    lead = (scene.num_meshes, scene.num_views)
    pictures = []
    for normals, smooth in surfaces:
        shade: Shader
        if smooth or camera.central:
            shade = PlaceShader(scene, normals, around, smooth=smooth)
        else:
            shade = ConstantShader(scene, normals, around)
        colors = mean_colors(shade, seen, factor)
        if antialias or _differentiated(colors, scene.points):
            pixels, terms = edge_terms(scene, shade, (height, width), smooth=smooth, antialias=antialias)
            pixels = coarse_pixels(pixels, width, factor)
            colors = colors.index_add(0, pixels, terms / factor**2)
        pictures.append(colors.view(*lead, -1, colors.shape[-1]))
    faces = torch.cat([scene.faces, scene.faces.new_tensor([-1])])[seen]  # -1 picks the last
    own = torch.where(seen < 0, -1, seen % max(1, scene.triangles.shape[0] // max(1, scene.num_pictures)))
    return [*pictures, faces.view(*lead, height, width), own.view(*lead, height, width)]


def _differentiated(*tensors: Tensor) -> bool:
    """Whether reverse or forward mode follows one of some tensors."""
    reverse = torch.is_grad_enabled() and any(tensor.requires_grad for tensor in tensors)
    forward = (unpack_dual(tensor).tangent for tensor in tensors)  # type: ignore[no-untyped-call]
    return reverse or any(tangent is not None for tangent in forward)


def _steps(faces: int, views: int, size: tuple[int, int]) -> tuple[int, int]:
    """How many meshes of so many faces, and views, to work on at a time."""
    most = max(1, min(_MOST // (size[0] * size[1]), _MOST_FACES // max(1, faces)))
    return (max(1, most // views), views) if most >= views else (1, most)


def _check_normals(normals: Tensor, vertices: Tensor, topology: Topology, shading: Shading) -> None:
    count = topology.num_vertices if shading == "smooth" else topology.num_faces
    expected = (*vertices.shape[:-2], count, 3)
    if tuple(normals.shape) != expected or not normals.is_floating_point():
        raise ShapeError(f"normals for {shading} shading", f"a floating tensor {expected}", tuple(normals.shape))
