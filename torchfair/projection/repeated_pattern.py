"""The normal matrix of a batch: that of one member, once for each."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from ..linear import LowerTriangle
from .layout import Layout
from .normal_pattern import NormalPattern


class RepeatedPattern:
    """Like :class:`NormalPattern`, for many members; nothing is searched or sorted again.

    Args:
        single: Of one member.
        layout: Of all.

    Attributes:
        lower: Places of the entries.
    """

    def __init__(self, single: NormalPattern, layout: Layout) -> None:
        self._single, self._members = single, layout.members
        unknowns, size = layout.member_unknowns().cpu().numpy(), single.lower.size
        member, local = np.empty((2, unknowns.size), np.int64)
        member[unknowns.ravel()], local[unknowns.ravel()] = np.divmod(np.arange(unknowns.size), size)
        lengths = np.diff(single.lower.offsets)[local]
        offsets = np.concatenate([[0], np.cumsum(lengths)])
        entries = np.repeat(single.lower.offsets[local] - offsets[:-1], lengths) + np.arange(offsets[-1])
        owners = np.repeat(member, lengths)
        self.lower = LowerTriangle(offsets, unknowns[owners, single.lower.rows[entries]])
        self._order: Tensor | None = None
        if (np.diff(member) < 0).any():
            self._order = torch.from_numpy(owners * single.lower.rows.size + entries).to(layout.device)

    def assemble(self, jacobians: Sequence[Tensor]) -> Tensor:
        """(nnz,) values of the lower triangle for element Jacobians ``(m, K, n)``, n elements of all members."""
        values = self._single.assemble_members(jacobians, self._members).view(-1)
        return values if self._order is None else values[self._order]
