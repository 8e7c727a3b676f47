"""How large panels may become in the job that lowers E."""

from __future__ import annotations

import torch
from torch import Tensor

from ...constraints._components import area_derivatives, area_vectors, components_first, derivative_rows, lengths
from ...constraints._pooled import pooled_faces
from ...constraints.barrier import barrier, barrier_slope
from ...geometry import face_areas
from ...projection import ElementTerm
from ...topology import Topology

_SMALL = 0.5  # of the mean area: panels below it may grow as one of this size may
_SAFE = 0.05  # of the bound: from where on the barrier is silent
_TINY = 1e-30


def own_sizes(vertices: Tensor, topology: Topology) -> Tensor:
    """(F,) areas of the faces of a mesh (V, 3), against which their growth is measured; half the mean at least."""
    return sizes_of(face_areas(vertices, topology))


def sizes_of(areas: Tensor) -> Tensor:
    """(F,) areas, half of their mean at least."""
    return areas.clamp_min(_SMALL * float(areas.mean())) if areas.numel() else areas


def growth_terms(topology: Topology, most: Tensor, *, weight: float) -> list[ElementTerm]:
    """Barrier that no face crosses: ``most`` (F,) are the largest areas; the weight multiplies half its square."""
    return [
        ElementTerm(
            "panel sizes",
            group.function(_barriers),
            [("vertices", group.stencil)],
            data=(most[group.numbers], *group.data),
            weight=weight,
            jacobian=group.jacobian(_slopes),
            silent=True,
            batched=True,
        )
        for group in pooled_faces(topology)
    ]


def _barriers(x: Tensor, most: Tensor) -> Tensor:
    """(n,) of faces x (n, k, 3)."""
    margin = 1.0 - lengths(area_vectors(components_first(x))) / most
    return barrier(margin, torch.full_like(margin, _SAFE))


def _slopes(x: Tensor, most: Tensor) -> Tensor:
    """(n, 3k) their derivatives."""
    corners = components_first(x)
    vectors = area_vectors(corners)
    sizes = lengths(vectors)
    margin = 1.0 - sizes / most
    steepness = -barrier_slope(margin, torch.full_like(margin, _SAFE)) / most
    return derivative_rows(area_derivatives(corners, steepness / sizes.clamp_min(_TINY) * vectors).unbind(1))
