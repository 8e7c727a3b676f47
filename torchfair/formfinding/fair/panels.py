"""Which faces the job that lowers E makes or keeps planar, which edges it keeps flat, and how far it is from that."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from ... import constraints as c
from ...geometry import dihedral_angles
from ...geometry.planarity import planarity
from ...projection import ElementTerm
from ...settings.fair_settings import FairSettings
from ...topology import Topology
from .flat_edges import edges_to_keep_flat
from .planar_faces import NearlyPlanar, faces_to_keep_planar

PLANAR_PROMISE = 1e-4  # relative planarity of faces that are kept planar
_PLANAR_ENOUGH = 5e-5
_BEHIND = 10.0  # times the deviation that a weight leads to: what a stage may leave that has not come to rest
_LARGEST_WARP = 1e-2  # relative planarity above which planarity is imposed in stages
_LARGEST_FOLD = math.radians(2.0)  # of edges kept flat, above which that is imposed in stages
_FLAT_ENOUGH = math.radians(0.01)


class Panels:
    """The faces and edges of one mesh, chosen once, at its start.

    Args:
        vertices: (V, 3) start, normalised.
        topology: Its connectivity.
        settings: Which faces and edges, and their weights.
        notes: Decisions taken are added, in words.

    Attributes:
        settings: Their weights; others may be set.
        planar: (n,) faces that are kept planar, or become so.
        nearly: Faces that do not become less planar.
        flat: (n,) interior edges that are kept flat.
    """

    def __init__(self, vertices: Tensor, topology: Topology, settings: FairSettings, notes: list[str]) -> None:
        self.settings, self._topology, self._notes = settings, topology, notes
        self.planar = self._planar(vertices)
        self.nearly = self._nearly(vertices)
        self.flat = self._flat(vertices)

    # ---- decisions -------------------------------------------------------------------------------------

    def _planar(self, vertices: Tensor) -> Tensor:
        settings, topology = self.settings, self._topology
        faces = faces_to_keep_planar(vertices, topology, settings)
        if faces.numel() and isinstance(settings.planar, str):
            words = "are kept planar" if settings.planar == "keep" else "are to be planar"
            self._notes.append(f"{faces.numel()} of {topology.num_faces} faces {words}")
        return faces

    def _nearly(self, vertices: Tensor) -> NearlyPlanar:
        settings = self.settings
        found = NearlyPlanar.of(vertices, self._topology, settings, self.planar)
        if not found.faces.numel() or not settings.planarity_weight:
            return found.none()
        keeps = settings.planar == "keep"
        words = "do not become less planar" if keeps else "are let go"
        self._notes.append(
            f"{found.faces.numel()} nearly planar faces (within {settings.planar_reach:g}, at most "
            f"{float(found.most.max()):.2g}) {words}"
        )
        return found if keeps else found.none()

    def _flat(self, vertices: Tensor) -> Tensor:
        edges = edges_to_keep_flat(vertices, self._topology, self.settings)
        if edges.numel() and isinstance(self.settings.flat, str):
            self._notes.append(f"{edges.numel()} edges between coplanar triangles are kept flat")
        return edges

    @property
    def makes_planar(self) -> bool:
        """Whether faces are asked to be planar that need not be so at the start."""
        settings = self.settings
        return settings.planar not in ("keep", "none") and bool(settings.planarity_weight and self.planar.numel())

    # ---- which vertices --------------------------------------------------------------------------------

    @property
    def corners(self) -> Tensor:
        """(n,) corners of all these faces, and of those beside flat edges; some more than once."""
        topology = self._topology
        beside = topology.interior_edge_faces[self.flat].reshape(-1)
        faces = torch.cat([self.planar, self.nearly.faces, beside])
        return topology.corners[torch.isin(topology.corner_faces, faces)]

    def warped_corners(self, vertices: Tensor) -> Tensor:
        """(V,) bool, corners of the faces that are to be planar, but are not in a mesh (V, 3)."""
        topology = self._topology
        warped = torch.zeros(topology.num_faces, dtype=torch.bool)
        warped[self.planar[self.warps(vertices) > self.settings.planar_tolerance]] = True
        found = torch.zeros(topology.num_vertices, dtype=torch.bool)
        return found.index_fill(0, topology.corners[warped[topology.corner_faces]], True)

    # ---- how far it is ---------------------------------------------------------------------------------

    def warps(self, vertices: Tensor) -> Tensor:
        """(n,) relative planarity of the faces kept planar, in a mesh (V, 3)."""
        return planarity(vertices, self._topology)[self.planar]

    def folds(self, vertices: Tensor) -> Tensor:
        """(n,) angles between the normals at the edges kept flat, radians, in a mesh (V, 3)."""
        if not self.flat.numel():
            return vertices.new_zeros(0)
        return dihedral_angles(vertices, self._topology)[self.flat].abs()

    def are_planar(self, vertices: Tensor) -> bool:
        """Whether a mesh (V, 3) is well within the tolerances that the job promises."""
        settings, warps = self.settings, planarity(vertices, self._topology)
        if settings.planarity_weight and bool((warps[self.planar] > _PLANAR_ENOUGH).any()):
            return False
        if bool((self.nearly.growth(warps) > _PLANAR_ENOUGH).any()):
            return False
        return not settings.flat_weight or not bool((self.folds(vertices) > _FLAT_ENOUGH).any())

    def may_become_planar(self, vertices: Tensor, share: float) -> bool:
        """Whether the faces of a mesh (V, 3) are planar enough for weights to make them planar that rise by a share.

        Where faces can become planar, their deviation falls as the weight rises, since what pulls at them stays as
        strong. Where they cannot, it does not fall.
        """
        heavier = _raised(self.settings.planarity_weight, share)
        return not self.makes_planar or bool((self.warps(vertices) <= _BEHIND * heavier * _PLANAR_ENOUGH).all())

    def come_in_stages(self, vertices: Tensor) -> bool:
        """Whether a mesh (V, 3) is too far from that for weights that are full at once."""
        warps, folds = self.warps(vertices), self.folds(vertices)
        return bool((warps > _LARGEST_WARP).any()) or bool((folds > _LARGEST_FOLD).any())

    # ---- terms -----------------------------------------------------------------------------------------

    def planar_terms(self, share: float) -> list[ElementTerm]:
        """Of faces that are to be planar; ``share`` raises weights by powers of ten, all of them at 1."""
        return c.planarity_terms(self._topology, self.planar, weight=_raised(self.settings.planarity_weight, share))

    def nearly_planar_terms(self, share: float) -> list[ElementTerm]:
        """Of faces that do not become less planar."""
        return self.nearly.terms(self._topology, weight=_raised(self.settings.planarity_weight, share))

    def flat_terms(self, share: float) -> list[ElementTerm]:
        """Of edges kept flat, by ``l* = 0`` where dual lengths are unknowns, as in the paper."""
        weight = _raised(self.settings.flat_weight, share)
        if self.settings.formulation == "lifted":
            return c.lifted_flat_edge_terms(self._topology, self.flat, weight=weight)
        return c.flat_edge_terms(self._topology, self.flat, weight=weight)


def _raised(weight: float, share: float) -> float:
    """A weight that is imposed by powers of ten, of which all of it has share 1."""
    return max(weight, 1.0) ** share if weight else 0.0
