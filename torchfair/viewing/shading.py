"""Light on flat faces: colours from normals, soft studio light or stripes seen in a mirror."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from ..geometry import face_area_vectors, face_normals
from ..topology import Topology
from .camera import Camera

Color = tuple[float, float, float]

FRONT: Color = (0.80, 0.83, 0.87)
BACK: Color = (0.86, 0.78, 0.66)
STRIPES_DARK: Color = (0.07, 0.10, 0.17)
STRIPES_LIGHT: Color = (0.97, 0.97, 0.95)


def face_centres(vertices: Tensor, topology: Topology) -> Tensor:
    """Means of the corners of each face, ``(F, 3)``."""
    sums = vertices.new_zeros(topology.num_faces, 3).index_add_(0, topology.corner_faces, vertices[topology.corners])
    return sums / topology.face_sizes[:, None]


def towards_viewer(vertices: Tensor, topology: Topology, camera: Camera) -> tuple[Tensor, Tensor, Tensor]:
    """Face normals turned to the side that is seen.

    Returns:
        Normals ``(F, 3)``; directions to the eye ``(F, 3)``; and ``(F,)`` whether the face shows its main side.
        That is the front, unless at least two thirds of the projected area show their backs (hidden parts
        counted): so a roof looks the same from above whichever way its faces are oriented.
    """
    area_vectors = face_area_vectors(vertices, topology)
    to_eye = camera.towards_eye(face_centres(vertices, topology))
    facing = (area_vectors * to_eye).sum(-1)
    front = facing >= 0
    normals = face_normals(vertices, topology)
    backward = facing.sum() < -facing.abs().sum() / 3
    return torch.where(front[:, None], normals, -normals), to_eye, front != backward


def shade_faces(
    vertices: Tensor,
    topology: Topology,
    camera: Camera,
    face_colors: Tensor | None = None,
) -> Tensor:
    """Flat-shaded colours ``(F, 3)`` in 0..1.

    Two soft lamps move with the camera and every face mirrors a bright strip of sky, so that neighbouring facets
    with different normals differ visibly. Both sides are lit alike.

    Args:
        vertices: ``(V, 3)``.
        topology: connectivity.
        camera: the view.
        face_colors: ``(F, 3)`` or ``(3,)`` colours in white light; by default cool grey on the main
            side and sand on the other.
    """
    normals, to_eye, main_side = towards_viewer(vertices, topology, camera)
    if face_colors is None:
        face_colors = torch.where(main_side[:, None], normals.new_tensor(FRONT), normals.new_tensor(BACK))
    axes = camera.axes.to(normals)
    key = 0.5 + 0.5 * (normals @ _direction(axes, (-0.75, 0.45, 0.35)))
    fill = 0.5 + 0.5 * (normals @ _direction(axes, (0.85, 0.15, 0.35)))
    diffuse = 0.30 + 0.62 * key**2 + 0.12 * fill
    mirrored = 2 * (normals * to_eye).sum(-1, keepdim=True) * normals - to_eye
    sky = torch.exp(-((((mirrored @ _direction(axes, (-0.2, 0.9, 0.35))) - 0.75) / 0.22) ** 2))
    return (face_colors * diffuse[:, None] + 0.20 * sky[:, None]).clamp(0, 1)


def mirror_directions(vertices: Tensor, topology: Topology, camera: Camera) -> Tensor:
    """Where each face, as a plane mirror, reflects the line of sight: ``r = d - 2 (d.n) n``, ``(F, 3)``.

    ``d`` runs from the eye to the centre of the face. The sign of the normal does not matter. A degenerate face
    (zero normal) reflects nothing: ``r = d``.
    """
    normals = face_normals(vertices, topology)
    sight = -camera.towards_eye(face_centres(vertices, topology))
    return sight - 2 * (sight * normals).sum(-1, keepdim=True) * normals


def stripe_values(components: Tensor, frequency: float) -> Tensor:
    """Brightness 0..1 of striped surroundings in directions r with components ``w.r`` along the unit vector w.

    ``s = 1/2 + 1/2 tanh(6 sin(2 pi f w.r))``: soft-edged stripes perpendicular to ``w``.

    Args:
        components: ``w.r``, any shape.
        frequency: f, number of stripe pairs per unit of ``w.r``.
    """
    return 0.5 + 0.5 * torch.tanh(6 * torch.sin(2 * math.pi * frequency * components))


def stripe_frequency(components: Tensor, topology: Topology, *, stripes: float = 7.0) -> float:
    """A frequency for :func:`stripe_values` at which the stripes can be followed across the mesh.

    About ``stripes`` pairs over the middle 90 % of the surface, but so few that nine of ten interior edges
    separate faces less than 28 % of a period apart, and at least one.

    Args:
        components: ``(F,)`` components ``w.r`` of the mirrored directions.
        topology: connectivity.
        stripes: wanted number of stripe pairs.
    """
    values = components.detach().to(torch.float64)
    if values.shape[0] == 0:
        return 1.0
    spread = values.quantile(0.95) - values.quantile(0.05)
    if not spread > 1e-9:
        return 1.0
    frequency = stripes / float(spread)
    left, right = topology.interior_edge_faces.unbind(1)
    if left.shape[0]:
        jump = float((values[left] - values[right]).abs().quantile(0.9))
        frequency = min(frequency, 0.28 / max(jump, 1e-9))
    return max(frequency, 1 / float(spread))


def stripe_colors(values: Tensor) -> Tensor:
    """Colours ``(..., 3)`` of stripe values ``(...)``."""
    dark: Tensor = values.new_tensor(STRIPES_DARK)
    light: Tensor = values.new_tensor(STRIPES_LIGHT)
    return torch.lerp(dark, light, values[..., None])


def _direction(axes: Tensor, components: Color) -> Tensor:
    """Unit vector with the given components to the right, up and towards the eye."""
    vector: Tensor = axes.new_tensor(components) @ axes
    return torch.nn.functional.normalize(vector, dim=-1)
