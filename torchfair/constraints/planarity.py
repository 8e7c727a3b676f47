"""Chosen faces stay or become planar."""

from __future__ import annotations

import torch
from torch import Tensor

from ..projection import ElementTerm
from ..topology import Topology
from ._components import components_first, cross, derivative_rows, dot
from .base import Constraint


def diagonal_distance(x: Tensor) -> Tensor:
    """Signed distances (n,) between the lines of the two diagonals of quads ``x`` (n, 4, 3); zero when planar.

    Infinite for parallel diagonals, which no convex quad has. One quad (4, 3) gives a scalar.
    """
    start, end, first, second = _diagonals(x)
    normal = cross(first, second)
    return dot(normal, end - start) / dot(normal, normal).sqrt()


def diagonal_distance_gradient(x: Tensor) -> Tensor:
    """Gradients (n, 12) of :func:`diagonal_distance`.

    With N = p x q of the diagonals p and q and w from one to the other, ``D = N . w / |N|`` changes by the unit normal
    times dw, and by ``(w - D N / |N|) / |N|``, which is what of w lies in their plane, times dN.
    """
    start, end, first, second = _diagonals(x)
    normal, offset = cross(first, second), end - start
    inverse = dot(normal, normal).rsqrt()
    unit = inverse * normal
    turning = inverse * (offset - dot(offset, unit) * unit)
    at_first, at_second = cross(second, turning), cross(turning, first)
    return derivative_rows([-at_first - unit, unit - at_second, at_first, at_second])


def _diagonals(x: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """(3, n) where the diagonals of quads start, and the diagonals."""
    corners = components_first(x)
    return corners[:, 0], corners[:, 1], corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]


def planarity_terms(topology: Topology, faces: Tensor, *, weight: float, block: str = "vertices") -> list[ElementTerm]:
    """Distance of the diagonals of every four consecutive corners of ``faces`` (n,), in the unit of the vertices.

    Triangles among the faces are planar anyway and are passed over. The weight multiplies half the squared distance.
    """
    chosen = torch.zeros(topology.num_faces, dtype=torch.bool, device=topology.device)
    chosen[faces] = True
    rows = []
    for size, (numbers, corners) in topology.faces_by_size.items():
        if size > 3:
            kept = corners[chosen[numbers]]
            shifts = range(1) if size == 4 else range(size)
            rows += [kept.roll(-shift, 1)[:, :4] for shift in shifts]
    stencil = torch.cat(rows) if rows else torch.zeros(0, 4, dtype=torch.int64, device=topology.device)
    if not stencil.numel():
        return []
    return [
        ElementTerm(
            "planarity",
            diagonal_distance,
            [(block, stencil)],
            weight=weight,
            jacobian=diagonal_distance_gradient,
            batched=True,
        )
    ]


class Planarity(Constraint):
    """Module form of :func:`planarity_terms`: half the sum of the squared distances of diagonals, in length squared.

    At least 0, unchanged by rigid motions; 0 exactly where the faces are planar. A quad with parallel diagonals, which
    is not convex, makes it infinite unless it is planar, with gradient zero.

    Args:
        topology: Any polygon mesh.
        faces: (n,) numbers of faces, by default all.

    Example:
        >>> from torchfair.constraints import Planarity
        >>> import torch
        >>> from torchfair import Topology
        >>> quad = torch.tensor([[0.0, 0, 0], [1, 0, 2], [1, 1, 0], [0, 1, 2]], requires_grad=True)
        >>> planarity = Planarity(Topology.from_faces([[0, 1, 2, 3]]))
        >>> planarity(quad)  # the diagonals are 2 apart
        tensor(2., grad_fn=<AddBackward0>)
        >>> [term.name for term in planarity.terms(weight=10.0)]
        ['planarity']
    """

    def __init__(self, topology: Topology, faces: Tensor | None = None) -> None:
        if faces is None:
            faces = torch.arange(topology.num_faces, device=topology.device)
        super().__init__(planarity_terms(topology, faces, weight=1.0))
