"""Which vertices are near which, and normals averaged over what is near."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from ...geometry import face_area_vectors
from ...topology import Topology


@dataclass(frozen=True)
class Neighbourhoods:
    """The vertices within two edges of every vertex, itself among them.

    Attributes:
        centres, members: (n,) pairs, sorted by centre.
        counts: (V,) members of each centre.
    """

    centres: Tensor
    members: Tensor
    counts: Tensor

    @classmethod
    def of(cls, topology: Topology) -> Neighbourhoods:
        """Of all vertices of a mesh; empty for isolated ones."""
        count, rings = topology.num_vertices, topology.ring_vertices
        sizes = topology.ring_offsets.diff()
        every = torch.arange(count, device=topology.device)
        first = every.repeat_interleave(sizes)
        # For each pair of neighbours all the neighbours of the second one.
        second = first.repeat_interleave(sizes[rings])
        begin = topology.ring_offsets[rings].repeat_interleave(sizes[rings])
        ends = sizes[rings].cumsum(0)
        place = torch.arange(second.shape[0], device=topology.device)
        place = place - (ends - sizes[rings]).repeat_interleave(sizes[rings])
        used = every[sizes > 0]
        keys = torch.cat([used * (count + 1), first * count + rings, second * count + rings[begin + place]])
        keys = torch.unique(keys)
        centres = keys // count
        return cls(centres, keys % count, torch.bincount(centres, minlength=count))

    def sums(self, values: Tensor) -> Tensor:
        """(V, ...) sums of the values (V, ...) of the members."""
        return torch.zeros_like(values).index_add_(0, self.centres, values[self.members])


def smoothed_area_vectors(vertices: Tensor, topology: Topology, near: Neighbourhoods) -> tuple[Tensor, Tensor]:
    """Area vectors (V, 3) and areas (V,), each summed over faces within two to three edges of a vertex.

    A sum of area vectors depends on its outline alone, so that noise and folds inside cancel. Where it is much shorter
    than the sum of areas, as on plates thinner than an edge, its direction says nothing.
    """
    vectors = face_area_vectors(vertices, topology)
    areas = torch.linalg.vector_norm(vectors, dim=1, keepdim=True)
    both = torch.cat([vectors, areas], dim=1)[topology.corner_faces]
    around = both.new_zeros(topology.num_vertices, 4).index_add_(0, topology.corners, both)
    total = near.sums(around)
    return total[:, :3], total[:, 3]
