"""Which vertices lie within some rings of every vertex."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import torch
from torch import Tensor

from .._numbers import check_count
from .._side_by_side import side_by_side
from ..topology import Topology
from ._ops import gather

if TYPE_CHECKING:
    import scipy.sparse as sp

_FEW, _ENOUGH = 0.8, 1.25  # of the vertices that the rings of a triangular lattice have
_PAIRS = 1 << 15  # of a vertex and a member at once: what is made of them stays near the cache


class PatchGroup(NamedTuple):
    """Patches of nearly equal size, filled up to the largest with the centre itself.

    Attributes:
        centres: (n,) vertices.
        members: (n, m) the vertices around each, itself among them.
        present: (n, m) whether a place is taken by a member, not filled up.
    """

    centres: Tensor
    members: Tensor
    present: Tensor


class Patches:
    """The vertices within so many rings of every vertex: a patch of the surface for each.

    Two vertices are one ring apart if a face has both. Where less than four fifths of ``1 + 3 rings (rings + 1)``
    vertices are reached, as many as in a triangular lattice, rings are added until there are five quarters of it, at
    most as many again: at the boundary, where one side is missing and fits are less certain. Build patches once for
    a topology; they hold no positions.

    Args:
        topology: any polygon mesh.
        rings: 1 or more.

    Raises:
        SettingsError: if ``rings`` is no such number.

    Attributes:
        rings: as asked for.
        groups: all patches, small ones first.
        places: (V,) of each vertex in the groups one after the other.
    """

    def __init__(self, topology: Topology, rings: int) -> None:
        check_count("rings", rings, least=1)
        self.rings = int(rings)
        with torch._C._DisableFuncTorch():  # inside function transforms index tensors have no numbers to read
            self.groups, self.places = _grouped(_within(topology, self.rings), topology.device)

    def means(self, values: Tensor) -> Tensor:
        """Means of the values (*batch, V, d) of the members: (*batch, V, d)."""

        def mean(group: PatchGroup) -> Tensor:
            shares = group.present.to(values) / group.present.sum(1, keepdim=True)
            return (gather(values, group.members) * shares[..., None]).sum(-2)

        return self.in_order(side_by_side(mean, self.groups, values))

    @property
    def sizes(self) -> Tensor:
        """(V,) numbers of members."""
        return torch.cat([present.sum(1) for _, _, present in self.groups]).index_select(0, self.places)

    def in_order(self, parts: list[Tensor]) -> Tensor:
        """Values (*batch, n, d) of the groups as values (*batch, V, d) of the vertices."""
        return torch.cat(parts, dim=-2).index_select(-2, self.places)


def _grouped(around: sp.csr_array, device: torch.device) -> tuple[list[PatchGroup], Tensor]:
    counts = np.diff(around.indptr)
    order = np.argsort(counts, kind="stable")
    groups: list[PatchGroup] = []
    low = 0
    while low < len(order):
        sizes = counts[order[low:]] * np.arange(1, len(order) - low + 1)
        high = low + max(int(np.searchsorted(sizes, _PAIRS, side="right")), 1)
        centres = order[low:high]
        columns = np.arange(counts[centres].max())
        present = columns < counts[centres, None]
        places = around.indptr[centres, None] + np.where(present, columns, 0)
        members = np.where(present, around.indices[places], centres[:, None]).astype(np.int64)
        groups.append(PatchGroup(*(torch.from_numpy(array).to(device) for array in (centres, members, present))))
        low = high
    return groups, torch.from_numpy(np.argsort(order, kind="stable")).to(device)


def _within(topology: Topology, rings: int) -> sp.csr_array:
    """(V, V) SciPy matrix, with an entry where the column is a member of the patch of the row."""
    from scipy.sparse import csr_array, eye_array, vstack

    count = topology.num_vertices
    corners, faces = topology.corners.cpu().numpy(), topology.corner_faces.cpu().numpy()
    shares = csr_array((np.ones(len(corners), bool), (corners, faces)), shape=(count, topology.num_faces))
    step = (shares @ shares.T + eye_array(count, dtype=bool)).tocsr()
    reached = step
    for _ in range(rings - 1):
        reached = reached @ step
    lattice = 1 + 3 * rings * (rings + 1)
    small = np.diff(reached.indptr) < _FEW * lattice
    numbers, parts, rows = [np.flatnonzero(~small)], [reached[~small]], np.flatnonzero(small)
    reached = reached[small]
    for more in range(rings):
        reached = reached @ step
        done = (np.diff(reached.indptr) >= _ENOUGH * lattice) | (more == rings - 1)
        numbers.append(rows[done])
        parts.append(reached[done])
        reached, rows = reached[~done], rows[~done]
    whole: sp.csr_array = vstack(parts, format="csr")[np.argsort(np.concatenate(numbers))]
    return whole
