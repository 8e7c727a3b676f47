"""Light on flat faces: colours from normals, soft studio light, and colours of stripes seen in a mirror."""

from __future__ import annotations

import torch
from torch import Tensor

from ..cameras import Camera
from ..geometry import face_area_vectors, face_centres, face_normals
from ..topology import Topology
from .camera import towards_eye

Color = tuple[float, float, float]

FRONT: Color = (0.80, 0.83, 0.87)
BACK: Color = (0.86, 0.78, 0.66)
STRIPES_DARK: Color = (0.07, 0.10, 0.17)
STRIPES_LIGHT: Color = (0.97, 0.97, 0.95)


def towards_viewer(vertices: Tensor, topology: Topology, camera: Camera) -> tuple[Tensor, Tensor, Tensor]:
    """Face normals turned to the side that is seen.

    Returns:
        Normals ``(F, 3)``; directions to the eye ``(F, 3)``; and ``(F,)`` whether the face shows its main side.
        That is the front, unless at least two thirds of the projected area show their backs (hidden parts
        counted): so a roof looks the same from above whichever way its faces are oriented.
    """
    area_vectors = face_area_vectors(vertices, topology)
    to_eye = towards_eye(camera, face_centres(vertices, topology))
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
        camera: the view, one.
        face_colors: ``(F, 3)`` or ``(3,)`` colours in white light; by default cool grey on the main
            side and sand on the other.
    """
    normals, to_eye, main_side = towards_viewer(vertices, topology, camera)
    if face_colors is None:
        face_colors = torch.where(main_side[:, None], normals.new_tensor(FRONT), normals.new_tensor(BACK))
    right, up, forward = camera.axes[0].to(normals)
    axes = torch.stack([right, up, -forward])
    key = 0.5 + 0.5 * (normals @ _direction(axes, (-0.75, 0.45, 0.35)))
    fill = 0.5 + 0.5 * (normals @ _direction(axes, (0.85, 0.15, 0.35)))
    diffuse = 0.30 + 0.62 * key**2 + 0.12 * fill
    mirrored = 2 * (normals * to_eye).sum(-1, keepdim=True) * normals - to_eye
    sky = torch.exp(-((((mirrored @ _direction(axes, (-0.2, 0.9, 0.35))) - 0.75) / 0.22) ** 2))
    return (face_colors * diffuse[:, None] + 0.20 * sky[:, None]).clamp(0, 1)


def stripe_frequency(components: Tensor, topology: Topology, *, stripes: float = 7.0) -> float:
    """A frequency for :class:`~torchfair.reflection.Stripes` at which they can be followed across the mesh.

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
