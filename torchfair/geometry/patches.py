"""Which vertices lie within some rings of every vertex."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from .._numbers import check_count
from .._side_by_side import side_by_side
from ..errors import ShapeError
from ..topology import Topology
from ._ops import gather

if TYPE_CHECKING:
    import scipy.sparse as sp

Ints = npt.NDArray[np.int64]

_FEW, _ENOUGH = 0.8, 1.25  # of the vertices that the rings of a triangular lattice have
_NOISY = 3  # rings from which on there are wide patches
_WIDE, _RIM_WIDE = 3.0, 4.0  # their vertices at the boundary over those of the lattice
_SHARE, _RIM_SHARE = 0.1, 0.2  # of the vertices of a connected part, as many as wide patches want at most
_RIM = 2  # rings
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

    From three rings on, vertices that are fewer rings from the boundary have wide patches, too: of three times as many
    vertices as the lattice at the boundary, evenly less further inside, and at most three times as many rings. Within
    two rings, at the rim, they are of four times as many. They want no more than a tenth of the vertices of a connected
    part, a fifth at the rim, as polynomials do not follow shapes of that size, and there are none where narrow patches
    are as large.

    Args:
        topology: any polygon mesh.
        rings: 1 or more.
        at: (V,) of which vertices there are patches, true or false; of all if left out.

    Raises:
        SettingsError: if ``rings`` is no such number.
        ShapeError: if ``at`` is no such tensor.

    Attributes:
        rings: as asked for.
        at: as given.
        groups: all patches, those without wide ones first, and small ones before larger ones in both.
        places: (V,) of each vertex in the groups one after the other; behind the last where it has no patch.
        wide: the groups again, with wide patches in place of narrow ones; those without are the same objects.
        num_rim_groups: how many of them, the last, are of wide patches within two rings of the boundary.
        wide_places: (V,) of each vertex in them.
        border: (V,) whether there is a wide patch of the vertex.
        parts: (V,) number of the connected part that the vertex is in; below three rings all are one.
        num_parts: how many there are.
    """

    def __init__(self, topology: Topology, rings: int, *, at: Tensor | None = None) -> None:
        check_count("rings", rings, least=1)
        self.rings, self.at = int(rings), at
        if at is not None and (at.shape != (topology.num_vertices,) or at.dtype != torch.bool):
            raise ShapeError("at", f"a boolean tensor ({topology.num_vertices},)", f"{tuple(at.shape)} {at.dtype}")
        with torch._C._DisableFuncTorch():  # inside function transforms index tensors have no numbers to read
            step = _step(topology)
            count = topology.num_vertices
            centres = np.arange(count) if at is None else np.flatnonzero(at.cpu().numpy())
            exact = _within(step, centres, self.rings)
            lattice = 1 + 3 * self.rings * (self.rings + 1)
            few = np.flatnonzero(np.diff(exact.indptr) < _FEW * lattice)
            grown = _grown(exact[few], step, np.full(len(few), _ENOUGH * lattice), self.rings)
            self.num_parts, parts = _parts(step) if self.rings >= _NOISY else (1, np.zeros(count, np.int64))
            rim, inner, wanted = _border(topology, step, parts, centres, self.rings)
            border = np.concatenate([inner, rim])
            narrow = _replaced(exact, few, grown)
            wide = _replaced(narrow, border, _grown(exact[border], step, wanted, 2 * self.rings))
            others = np.setdiff1d(np.arange(len(centres)), border)
            shared, *inside = (_grouped(narrow, centres, some, topology.device) for some in (others, inner, rim))
            near, last = (_grouped(wide, centres, some, topology.device) for some in (inner, rim))
            self.groups, self.wide = [*shared, *inside[0], *inside[1]], [*shared, *near, *last]
            self.num_rim_groups = len(last)
            self.places, self.wide_places = _places(self.groups, count), _places(self.wide, count)
            self.parts = torch.from_numpy(parts).to(topology.device)
            self.border = torch.from_numpy(np.isin(np.arange(count), centres[border])).to(topology.device)

    def means(self, values: Tensor) -> Tensor:
        """Means of the values (*batch, V, d) of the members that have patches: (*batch, V, d)."""

        def mean(group: PatchGroup) -> Tensor:
            present = group.present if self.at is None else group.present & self.at[group.members]
            shares = present.to(values) / present.sum(1, keepdim=True)
            return (gather(values, group.members) * shares[..., None]).sum(-2)

        return self.in_order(side_by_side(mean, self.groups, values))

    @property
    def sizes(self) -> Tensor:
        """(V,) numbers of members."""
        return self.in_order([present.sum(1)[:, None] for _, _, present in self.groups]).squeeze(1)

    def in_order(self, parts: list[Tensor], *, wide: bool = False, elsewhere: float = 0.0) -> Tensor:
        """Values (*batch, n, d) of the groups, or of the wide ones, as values (*batch, V, d) of the vertices.

        The value is ``elsewhere`` where there is no patch.
        """
        values = torch.cat(parts, dim=-2)
        if self.at is not None:
            values = torch.nn.functional.pad(values, (0, 0, 0, 1), value=elsewhere)
        return values.index_select(-2, self.wide_places if wide else self.places)


def _grouped(around: sp.csr_array, centres: Ints, rows: Ints, device: torch.device) -> list[PatchGroup]:
    """Groups of the patches in ``rows`` (m,) of (n, V), those of vertices ``centres`` (n,)."""
    counts = np.diff(around.indptr)[rows]
    order = np.argsort(counts, kind="stable")
    rows, counts = rows[order], counts[order]
    groups: list[PatchGroup] = []
    low = 0
    while low < len(rows):
        pairs = counts[low:] * np.arange(1, len(rows) - low + 1)
        high = low + max(int(np.searchsorted(pairs, _PAIRS, side="right")), 1)
        some = centres[rows[low:high]]
        columns = np.arange(counts[high - 1])
        present = columns < counts[low:high, None]
        places = around.indptr[rows[low:high], None] + np.where(present, columns, 0)
        members = np.where(present, around.indices[places], some[:, None]).astype(np.int64)
        groups.append(PatchGroup(*(torch.from_numpy(array).to(device) for array in (some, members, present))))
        low = high
    return groups


def _places(groups: list[PatchGroup], count: int) -> Tensor:
    """(V,) of each of ``count`` vertices in the groups one after the other, behind the last where it is in none."""
    if not groups:
        return torch.zeros(count, dtype=torch.int64)
    centres = torch.cat([group.centres for group in groups])
    return torch.full((count,), len(centres)).to(centres).index_copy(0, centres, torch.arange(len(centres)).to(centres))


def _step(topology: Topology) -> sp.csr_array:
    """(V, V) SciPy matrix, with an entry where a face has both vertices or they are the same."""
    from scipy.sparse import csr_array, eye_array

    count = topology.num_vertices
    corners, faces = topology.corners.cpu().numpy(), topology.corner_faces.cpu().numpy()
    shares = csr_array((np.ones(len(corners), bool), (corners, faces)), shape=(count, topology.num_faces))
    step: sp.csr_array = (shares @ shares.T + eye_array(count, dtype=bool)).tocsr()
    return step


def _within(step: sp.csr_array, centres: Ints, rings: int) -> sp.csr_array:
    """(n, V), with an entry where the column is within so many rings of the centre (n,) of the row."""
    reached = step if len(centres) == step.shape[0] else step[centres]
    for _ in range(rings - 1):
        reached = reached @ step
    return reached


def _grown(reached: sp.csr_array, step: sp.csr_array, wanted: npt.NDArray[np.float64], most: int) -> sp.csr_array:
    """(n, V) rows with one more ring, and more until they have as many entries as ``wanted`` (n,), at most ``most``."""
    from scipy.sparse import vstack

    numbers, parts, rows = [], [reached[:0]], np.arange(len(wanted))
    for more in range(most):
        reached = reached @ step
        done = (np.diff(reached.indptr) >= wanted[rows]) | (more == most - 1)
        numbers.append(rows[done])
        parts.append(reached[done])
        reached, rows = reached[~done], rows[~done]
        if not len(rows):
            break
    whole: sp.csr_array = vstack(parts, format="csr")[np.argsort(np.concatenate(numbers))]
    return whole


def _replaced(matrix: sp.csr_array, rows: Ints, by: sp.csr_array) -> sp.csr_array:
    """The matrix with other ``rows`` (m,), those of ``by`` (m, V)."""
    from scipy.sparse import vstack

    if not len(rows):
        return matrix
    others = np.setdiff1d(np.arange(matrix.shape[0]), rows)
    whole: sp.csr_array = vstack([matrix[others], by], format="csr")[np.argsort(np.concatenate([others, rows]))]
    return whole


def _parts(step: sp.csr_array) -> tuple[int, Ints]:
    """Number of connected parts, and (V,) which of them each vertex is in."""
    from scipy.sparse.csgraph import connected_components

    count, parts = connected_components(step, directed=False)
    return int(count), parts.astype(np.int64)


def _border(
    topology: Topology, step: sp.csr_array, parts: Ints, centres: Ints, rings: int
) -> tuple[Ints, Ints, npt.NDArray[np.float64]]:
    """Which of the centres have wide patches, at the rim and further inside, and how many these want, inner first."""
    if rings < _NOISY:
        return np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0)
    near = topology.is_boundary_vertex.cpu().numpy()
    distance = np.where(near, 0, rings)
    for ring in range(1, rings):
        wider = step @ near
        distance[wider & ~near] = ring
        near = wider
    at_rim = distance <= _RIM
    most = np.where(at_rim, _RIM_SHARE, _SHARE) * np.bincount(parts)[parts]
    lattice = 1 + 3 * rings * (rings + 1)
    wide = np.where(at_rim, _RIM_WIDE, _WIDE)
    wanted = np.minimum((wide - (wide - 1.0) * distance / rings) * lattice, most)[centres]
    is_wide, at_rim = ((distance < rings) & (most > _ENOUGH * lattice))[centres], at_rim[centres]
    rim, inner = np.flatnonzero(is_wide & at_rim), np.flatnonzero(is_wide & ~at_rim)
    return rim, inner, wanted[np.concatenate([inner, rim])]
