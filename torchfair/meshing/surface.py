"""The surface that is meshed: its components, as triangles with principal directions."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
import torch
from torch import Tensor

from .._graph import face_components
from .._names import PlacedError, few, first_few
from .._one_mesh import one_mesh
from ..errors import MeshError
from ..fields import Directions, FaceFrames, carried_directions, directions_of
from ..fields.frames import Bools
from ..geometry import FittedCurvature, degenerate_faces, dual_edge_lengths, edge_lengths, fitted_curvature
from ..subdivision import midpoint
from ..topology import Topology
from .bridges import cut_bridges
from .creases import sharp_edges
from .numbering import numbered_by_geometry, triangles_by_geometry
from .pose import Pose, rounded
from .sizes import SizeField

_COARSE = 1.0  # mean edge over the spacing above which triangles are cut
_LARGEST = 1e70  # extent of a surface, and one over the smallest: areas times coordinates stay in range
_MOST_FACES = 40_000  # that are made by cutting


@dataclass(frozen=True, eq=False)
class DesignSurface:
    """One connected component of triangles.

    Attributes:
        vertices: (V, 3) float64, on the CPU.
        topology: triangles.
        numbers: (V,) of the vertices in the mesh that was given, -1 for new ones.
        sharp: (I,) bool: interior edges that are creases.
        sizes: spacings of the new mesh over the mean one, None for the same everywhere.
    """

    vertices: Tensor
    topology: Topology
    numbers: Tensor
    sharp: Bools
    sizes: SizeField | None = None

    @cached_property
    def pose(self) -> Pose:
        """Where it is meshed."""
        return Pose.of(self.vertices.numpy(), self.topology.triangles.numpy())

    @cached_property
    def placed(self) -> DesignSurface:
        """The same in its pose."""
        sizes = self.sizes and SizeField(rounded(self.sizes.means), rounded(self.sizes.values))
        return replace(self, vertices=torch.from_numpy(self.pose.placed), sizes=sizes)

    @cached_property
    def frames(self) -> FaceFrames:
        """Of the triangles."""
        return FaceFrames.of(self.vertices, self.topology)

    @cached_property
    def smooth_frames(self) -> FaceFrames:
        """Of the triangles, apart from each other along creases."""
        return self.frames.cut_along(self.sharp) if self.sharp.any() else self.frames

    def directions(self, rings: int | Literal["auto"]) -> tuple[Directions, FittedCurvature]:
        """Principal directions by so many rings, and the fits that say them; ``"auto"`` chooses rings by the noise.

        Nothing reaches across creases.
        """
        smooth, number = self.smooth_frames, None if rings == "auto" else rings
        fitted = fitted_curvature(torch.from_numpy(smooth.points), smooth.topology, rings=number)
        return directions_of(smooth, fitted), fitted

    @property
    def crease_variation(self) -> float:
        """E of the sharp edges."""
        chosen = torch.from_numpy(np.flatnonzero(self.sharp))
        gauss = dual_edge_lengths(self.vertices, self.topology)[chosen]
        return float(edge_lengths(self.vertices, self.topology)[chosen] @ gauss)

    def without_creases(self) -> DesignSurface:
        """The same as one smooth surface."""
        return replace(self, sharp=np.zeros_like(self.sharp))

    def is_cut_for(self, spacing: float) -> bool:
        """Whether triangles are too coarse for edges of a length, and not too many to be cut."""
        return _mean_edge(self) > _COARSE * spacing and 4 * self.topology.num_faces <= _MOST_FACES

    def cut_finer(self, directions: Directions, spacing: float) -> tuple[DesignSurface, Directions]:
        """Triangles fine enough for edges of a length, on the same flat pieces."""
        surface = self
        while surface.is_cut_for(spacing):
            finer = midpoint(surface.topology)
            new = torch.full((finer.topology.num_vertices - surface.topology.num_vertices,), -1)
            marks = torch.zeros(surface.topology.num_edges, dtype=torch.bool)
            marks[: len(surface.sharp)] = torch.from_numpy(surface.sharp)
            sharp = finer.carry_edge_labels(marks)[: finer.topology.num_interior_edges].numpy()
            points, numbers = finer.apply(surface.vertices), torch.cat([surface.numbers, new])
            cut = DesignSurface(points, finer.topology, numbers, sharp)
            parents = finer.face_parents.numpy()
            directions = carried_directions(directions, surface.frames, cut.frames, parents)
            sizes = surface.sizes and surface.sizes.carried(surface.frames, cut.frames, parents)
            surface = replace(cut, sizes=sizes)
        return surface, directions


def _mean_edge(surface: DesignSurface) -> float:
    """Of the interior edges; of all where there is one triangle."""
    inner = surface.frames.lengths
    return float(inner.mean() if len(inner) else edge_lengths(surface.vertices, surface.topology).mean())


def components_of(vertices: Tensor, topology: Topology, crease_angle: float = 0.0) -> list[DesignSurface]:
    """The components of a mesh, triangulated, with edges that bend by more than an angle as creases (0 for none).

    Raises:
        ShapeError: if it is not one mesh.
        MeshError: if there is no face, a coordinate is not finite, a face has no area, or the surface is wider than
            1e70 or less than 1e-70.
    """
    points, topology = one_mesh(vertices, topology).cpu().double(), topology.to("cpu")
    if not topology.num_faces:
        raise MeshError("the surface has no faces. Give a mesh with at least one face.")
    if not points.isfinite().all():
        wrong = torch.nonzero(~points.isfinite().all(1)).squeeze(1).tolist()
        raise MeshError(f"vertices: not finite numbers: {first_few(wrong, len(wrong))}")
    extent = float(np.ptp(points[topology.corners].numpy(), axis=0).max())
    if not 1 / _LARGEST < extent < _LARGEST:
        raise MeshError(f"the surface is {extent:.3g} wide, beyond what can be squared. Give it in another unit.")
    flat = torch.nonzero(degenerate_faces(points, topology)).squeeze(1).tolist()
    if flat:
        words = ". torchfair.repair_mesh (--repair) drops them; or remesh them."
        raise PlacedError(f"{len(flat)} face(s) have no area: faces ", few("face", flat), words)
    triangles = triangles_by_geometry(points, topology)
    whole = Topology.from_faces(triangles, topology.num_vertices)
    labels = face_components(whole)
    parts = []
    for label in range(int(labels.max()) + 1):
        chosen = triangles[labels == label]
        numbers, corners = torch.unique(chosen, return_inverse=True)
        order, corners = numbered_by_geometry(points[numbers], corners)
        numbers = numbers[order]
        part, connectivity = points[numbers], Topology.from_faces(corners, len(numbers))
        part, connectivity, sharp = cut_bridges(part, connectivity, sharp_edges(part, connectivity, crease_angle))
        new = torch.full((len(part) - len(numbers),), -1)
        parts.append(DesignSurface(part, connectivity, torch.cat([numbers, new]), sharp))
    return parts
