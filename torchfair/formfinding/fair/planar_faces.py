"""Which faces the job that lowers E keeps planar, or as planar as they are."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from ...constraints.planarity import diagonal_distance
from ...errors import MeshError
from ...geometry.planarity import planarity
from ...projection import ElementTerm
from ...settings.fair_settings import FairSettings
from ...topology import Topology


def faces_to_keep_planar(vertices: Tensor, topology: Topology, settings: FairSettings) -> Tensor:
    """(n,) numbers of the faces that ``settings.planar`` chooses.

    Raises:
        MeshError: a face number is out of range.
    """
    polygons = topology.face_sizes > 3
    chosen = settings.planar
    if not isinstance(chosen, str):
        faces = torch.tensor(chosen, dtype=torch.int64)
        if faces.numel() and not bool(((faces >= 0) & (faces < topology.num_faces)).all()):
            raise MeshError(f"planar: face numbers run from 0 to {topology.num_faces - 1}, got {list(chosen)[:5]}")
        return faces
    if chosen == "keep":
        polygons = polygons & (planarity(vertices, topology) < settings.planar_tolerance)
    elif chosen == "none":
        polygons = torch.zeros_like(polygons)
    return torch.nonzero(polygons).squeeze(1)


_MARGIN = 0.98  # of what they may be, so that rounding and finite weights do not carry them beyond


class NearlyPlanar(NamedTuple):
    """Faces that do not become less planar than they were.

    Attributes:
        faces: (n,) numbers.
        most: (n,) relative planarity of each at the start.
    """

    faces: Tensor
    most: Tensor

    @classmethod
    def of(cls, vertices: Tensor, topology: Topology, settings: FairSettings, planar: Tensor) -> NearlyPlanar:
        """Those within ``settings.planar_reach`` of a mesh (V, 3) that are not among the ``planar`` (m,) faces."""
        warps = planarity(vertices, topology)
        within = (topology.face_sizes > 3) & (warps < settings.planar_reach)
        within[planar] = False
        faces = torch.nonzero(within).squeeze(1)
        return cls(faces, warps[faces])

    def none(self) -> NearlyPlanar:
        """Without any face."""
        return NearlyPlanar(self.faces[:0], self.most[:0])

    def growth(self, warps: Tensor) -> Tensor:
        """(n,) by how much faces are less planar than they were, of the planarity (F,) of all; else negative."""
        return warps[self.faces] - self.most

    def terms(self, topology: Topology, *, weight: float) -> list[ElementTerm]:
        """Distances of diagonals beyond what they may be; the weight multiplies half their squares."""
        terms = []
        most = torch.zeros(topology.num_faces, dtype=self.most.dtype).index_copy(0, self.faces, _MARGIN * self.most)
        chosen = torch.zeros(topology.num_faces, dtype=torch.bool).index_fill(0, self.faces, True)
        for numbers, corners in topology.faces_by_size.values():
            rows = numbers[chosen[numbers]]
            if rows.numel():
                stencil = [("vertices", corners[chosen[numbers]])]
                terms.append(ElementTerm("nearly planar", _excess, stencil, data=(most[rows],), weight=weight))
        return terms


def _excess(x: Tensor, most: Tensor) -> Tensor:
    """(runs,) distances of the diagonals of a polygon x (k, 3) beyond the fraction ``most`` of its mean edge."""
    runs = 1 if len(x) == 4 else len(x)
    distances = diagonal_distance(torch.stack([x.roll(-shift, 0)[:4] for shift in range(runs)]))
    mean = torch.linalg.vector_norm(x.roll(-1, 0) - x, dim=1).mean()
    return distances.sign() * torch.relu(distances.abs() - most * mean)
