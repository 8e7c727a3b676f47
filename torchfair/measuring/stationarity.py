"""How near a mesh on a surface is to having stationary E: pulls along the surface that do not balance."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from .._one_mesh import one_mesh
from ..energies import normal_variation_tangential_gradient
from ..geometry import closest_on, dual_edge_lengths
from ..geometry.reference import Reference
from ..topology import Topology
from .measurements import Quantity

GROUP = "on the reference surface"


@dataclass(frozen=True)
class Stationarity:
    """Tangential parts of the gradient of E at the vertices of one mesh.

    Attributes:
        judged: (V,) bool, vertices whose gradient is complete: all edges of the faces around them are interior. Others
            lack terms and are not stationary even on the best mesh.
        gradients: (V, 3) tangential parts, dimensionless; see
            :func:`torchfair.energies.normal_variation_tangential_gradient`.
        pulls: (V,) sums of the dual edge lengths ``l*`` around vertices: what edges would pull if all pulled the same
            way.
        distances: (V,) distances from the surface, in the unit of the vertices; 0 at isolated vertices.
    """

    judged: Tensor
    gradients: Tensor
    pulls: Tensor
    distances: Tensor

    @property
    def imbalance(self) -> float | None:
        """Sum of the lengths of the gradients over the sum of the pulls; None where nothing pulls.

        0 on stationary meshes. It tends to 0 on meshes along smooth curves, with order 1 and more in the edge length,
        and does not fall on irregular ones, where it is 0.5 to 0.7.
        """
        total = float(self.pulls[self.judged].sum())
        return float(self._lengths().sum()) / total if total > 0.0 else None

    def quantities(self) -> list[Quantity]:
        """The numbers that ``torchfair measure --reference`` prints; None where no vertex is judged."""
        lengths = self._lengths()
        any_vertex = bool(lengths.numel())
        return [
            Quantity("judged_vertices", lengths.numel(), "dimensionless", GROUP),
            Quantity(
                "largest_tangential_gradient", float(lengths.max()) if any_vertex else None, "dimensionless", GROUP
            ),
            Quantity("mean_tangential_gradient", float(lengths.mean()) if any_vertex else None, "dimensionless", GROUP),
            Quantity("tangential_imbalance", self.imbalance, "dimensionless", GROUP),
            Quantity("largest_reference_distance", _largest(self.distances), "length", GROUP),
        ]

    def per_vertex(self) -> dict[str, list[float | None]]:
        """Lists with one entry for each vertex; gradients of vertices that are not judged are None."""
        lengths = torch.linalg.vector_norm(self.gradients, dim=1).tolist()
        judged = self.judged.tolist()
        gradients = [value if known else None for value, known in zip(lengths, judged, strict=True)]
        return {"tangential_gradient": gradients, "reference_distance": self.distances.tolist()}

    def _lengths(self) -> Tensor:
        lengths: Tensor = torch.linalg.vector_norm(self.gradients[self.judged], dim=1)
        return lengths


def measure_stationarity(vertices: Tensor, topology: Topology, reference: Reference) -> Stationarity:
    """How far a mesh is from having stationary E among meshes with vertices on a surface (paper, section 3.2).

    Example::

        surface = ReferenceSurface(*smooth_mesh)
        measure_stationarity(vertices, topology, surface).imbalance

    Args:
        vertices: positions ``(V, 3)`` on or near the surface.
        topology: connectivity; any polygons, mixed.
        reference: the surface, a :class:`torchfair.geometry.ReferenceSurface` or a function that gives closest points
            and unit normals (:func:`torchfair.geometry.closest_on`). Interpolated normals of a mesh must be much better
            than the imbalance that is to be seen: take a finer mesh than the one that is measured.

    Raises:
        ShapeError: if ``vertices`` are not one mesh that fits the topology.
        MeshError: if a coordinate is not finite.
    """
    vertices = one_mesh(vertices, topology)
    positions, normals = closest_on(reference)(vertices)
    v, w = topology.interior_edges.unbind(1)
    duals = dual_edge_lengths(vertices, topology)
    pulls = torch.zeros_like(vertices[:, 0]).index_add(0, v, duals).index_add(0, w, duals)
    return Stationarity(
        judged=complete_stars(topology),
        gradients=normal_variation_tangential_gradient(vertices, normals, topology),
        pulls=pulls,
        distances=torch.linalg.vector_norm(vertices - positions, dim=1) * (topology.valences > 0),
    )


def complete_stars(topology: Topology) -> Tensor:
    """(V,) bool: vertices all of whose faces have interior edges only, so that their gradients of E lack nothing."""
    beside = topology.interior_edge_faces.flatten()
    interior = torch.bincount(beside, minlength=topology.num_faces)
    lacks = (interior < topology.face_sizes)[topology.corner_faces]
    incomplete = torch.zeros(topology.num_vertices, dtype=torch.int64, device=topology.device)
    incomplete = incomplete.index_add(0, topology.corners, lacks.to(torch.int64))
    return (incomplete == 0) & (topology.valences > 0)


def _largest(values: Tensor) -> float | None:
    return float(values.max()) if values.numel() else None
