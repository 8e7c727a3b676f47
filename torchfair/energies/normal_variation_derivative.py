"""One-sided derivative of the normal variation along a velocity, right at flat edges too."""

from __future__ import annotations

import torch
from torch import Tensor

from .._precision import in_single_at_least
from ..errors import ShapeError
from ..geometry._ops import cross, dot, map_faces, norm
from ..geometry.areas import area_vector
from ..geometry.normals import unit_normal
from ..topology import Topology
from .base import weigh

_FLATNESS = 4.0


@in_single_at_least
def normal_variation_derivative(
    vertices: Tensor, velocity: Tensor, topology: Topology, edge_weights: Tensor | None = None
) -> Tensor:
    r"""One-sided derivative ``lim (E(vertices + t velocity) - E(vertices)) / t`` for t > 0 going to 0.

    At flat edges E has a kink, where its gradient is only a subgradient. This is the derivative that holds
    there (paper, Prop. 3): with ``d = n - n'`` the jump of the normal across an edge and dots for
    derivatives along the velocity, the term ``l l*`` changes at the rate ::

        l. l* + l <d, d.> / l*      where the edge is bent: what the gradient of E says,
        l |d.|                      where it is flat: the edge bends, whichever way, and that costs.

    An edge that is a diagonal of a planar parallelogram always costs if the velocity bends it: the
    derivative is positive (ideal case II of the paper, section 3.2).

    An edge counts as flat if ``l* <= 4 eps (s + s')``, where eps is the rounding unit of the dtype and
    ``s = r p / A`` belongs to the face: r the largest distance of a corner from the origin, p the perimeter,
    A the area. That far the normals of faces in one plane can differ because coordinates are rounded.

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        velocity: (*batch, V, 3), broadcast against ``vertices``; length unit per unit of t.
        topology: connectivity; any polygons, mixed.
        edge_weights: (I,) or (*batch, I) factors of the terms, 1 if left out.

    Returns:
        (*batch,), unit of the velocity; positively homogeneous in it. Without flat edges, the scalar
        product of gradient and velocity. Edges of length zero grow at the rate ``|v. - w.|``. Edges on the
        boundary or beside a degenerate face (see :func:`torchfair.geometry.face_normals`) contribute
        nothing: while such a face opens, E jumps and has no derivative.

    Raises:
        ShapeError: if ``vertices``, ``velocity`` or ``edge_weights`` has the wrong shape or is not floating.

    Example:
        >>> import torch
        >>> from torchfair import Topology
        >>> from torchfair.energies import normal_variation_derivative
        >>> vertices = torch.tensor([[0.0, 0, 0], [2, 0, 0], [2, 2, 1], [0, 2, 1], [0, 4, 0], [2, 4, 0]])
        >>> topology = Topology.from_faces([[0, 1, 2, 3], [3, 2, 5, 4]])  # a ridge
        >>> velocity = torch.zeros_like(vertices)
        >>> velocity[2:4, 2] = 1.0  # raise the ridge
        >>> normal_variation_derivative(vertices, velocity, topology) > 0
        tensor(True)
    """
    topology.check_vertices(vertices)
    if not isinstance(velocity, Tensor) or velocity.shape[-2:] != vertices.shape[-2:]:
        actual = tuple(velocity.shape) if isinstance(velocity, Tensor) else type(velocity).__name__
        raise ShapeError("velocity", f"a floating tensor (*batch, {topology.num_vertices}, 3)", actual)
    motion = torch.cat(torch.broadcast_tensors(vertices, velocity.to(vertices.dtype)), dim=-1)  # type: ignore[no-untyped-call]

    return topology.sum_per_mesh(weigh(_rates(motion, topology), edge_weights, topology), "interior_edges")


def _rates(motion: Tensor, topology: Topology) -> Tensor:
    """Rates (*batch, I) of the terms; ``motion`` (*batch, V, 6) holds positions and velocities."""
    v, w = topology.interior_edges.unbind(1)
    side = motion.index_select(-2, w) - motion.index_select(-2, v)
    edge, edge_rate = side[..., :3], side[..., 3:]
    length = norm(edge)
    length_rate = torch.where(length > 0, dot(edge, edge_rate) / torch.where(length > 0, length, 1.0), norm(edge_rate))

    faces = map_faces(motion, topology, _normals_and_rates)
    left, right = (faces.index_select(-2, beside) for beside in topology.interior_edge_faces.unbind(1))
    valid = (left[..., :3] != 0).any(-1) & (right[..., :3] != 0).any(-1)
    jump, jump_rate, noise = (left - right)[..., :3], (left - right)[..., 3:6], (left + right)[..., 6]
    dual = norm(jump)
    flat = dual <= noise
    dual_rate = torch.where(flat, norm(jump_rate), dot(jump, jump_rate) / torch.where(flat, 1.0, dual))
    return torch.where(valid, length_rate * dual + length * dual_rate, 0.0)


def _normals_and_rates(corners: Tensor) -> Tensor:
    """Unit normal, its rate and its rounding noise (*batch, n, 7) of polygons in motion (*batch, n, k, 6)."""
    points, velocities = corners[..., :3], corners[..., 3:]
    area, normal = area_vector(points), unit_normal(points)
    spokes = points[..., 1:, :] - points[..., :1, :]
    spoke_rates = velocities[..., 1:, :] - velocities[..., :1, :]
    area_rate = cross(spoke_rates[..., :-1, :], spokes[..., 1:, :]) + cross(
        spokes[..., :-1, :], spoke_rates[..., 1:, :]
    )
    area_rate = area_rate.sum(-2) / 2
    valid = (normal != 0).any(-1, keepdim=True)
    size = norm(torch.where(valid, area, 1.0))[..., None]
    # The part of the rate along the normal changes the area only.
    normal_rate = torch.where(valid, area_rate - normal * dot(normal, area_rate)[..., None], 0.0) / size
    perimeter = norm(points.roll(-1, -2) - points).sum(-1, keepdim=True)
    reach = norm(points).amax(-1, keepdim=True)
    noise = _FLATNESS * torch.finfo(points.dtype).eps * reach * perimeter / size
    return torch.cat([normal, normal_rate, noise], dim=-1)
