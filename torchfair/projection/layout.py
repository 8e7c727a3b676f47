"""Variable blocks and the flat vector of unknowns behind them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import torch
from torch import Tensor

from .._shown import shown
from ..errors import ShapeError

State = Mapping[str, Tensor]


@dataclass(frozen=True)
class Layout:
    """How blocks ``name -> (n, d)`` lie in one flat vector: block after block, node after node.

    A *node* is one row of a block, for example a vertex with its three coordinates. Several *members* of a batch, which
    share no element, may lie in one layout: the rows of every block are then those of the first member, of the second,
    and so on.

    Attributes:
        sizes: ``(n, d)`` of every block, in order, all members together.
        dtype: Of all blocks, float32 or float64.
        device: Of all blocks.
        members: How many there are.
    """

    sizes: dict[str, tuple[int, int]]
    dtype: torch.dtype
    device: torch.device
    members: int = 1

    @classmethod
    def of(cls, state: State) -> Layout:
        """Layout of unbatched blocks ``(n, d)``.

        Raises:
            ShapeError: there is no block, or one that is not ``(n, d)``, float32 or float64, and like the first.
        """
        if not isinstance(state, Mapping) or not state:
            raise ShapeError("blocks", 'at least one, such as {"vertices": vertices}', shown(state))
        first = next(iter(state.values()))
        for name, block in state.items():
            if not isinstance(block, Tensor) or block.layout != torch.strided or block.ndim != 2 or not block.shape[1]:
                raise ShapeError(f"block '{name}'", "a dense tensor (n, d), (n, 1) for one number each", shown(block))
            if block.dtype not in (torch.float32, torch.float64):
                raise ShapeError(f"block '{name}'", "a tensor of float32 or float64", shown(block))
            if block.dtype != first.dtype or block.device != first.device:
                raise ShapeError(f"block '{name}'", f"{first.dtype} on {first.device} like the others", shown(block))
        sizes = {name: (block.shape[0], block.shape[1]) for name, block in state.items()}
        return cls(sizes, first.dtype, first.device)

    def __str__(self) -> str:
        return f"{self.sizes} {self.dtype} on {self.device}"

    @property
    def num_unknowns(self) -> int:
        """Length of the flat vector."""
        return sum(n * d for n, d in self.sizes.values())

    def offset(self, name: str) -> int:
        """Position of the first unknown of a block."""
        return sum(n * d for n, d in self._sizes_before(name))

    def node_offset(self, name: str) -> int:
        """Number of the first node of a block."""
        return sum(n for n, _ in self._sizes_before(name))

    def _sizes_before(self, name: str) -> list[tuple[int, int]]:
        names = list(self.sizes)
        return [self.sizes[other] for other in names[: names.index(name)]]

    def flatten(self, state: State) -> Tensor:
        """Blocks as one vector."""
        return torch.cat([state[name].reshape(-1) for name in self.sizes])

    def unflatten(self, flat: Tensor, members: int | None = None) -> dict[str, Tensor]:
        """One vector as blocks (views); a vector of another number of members, if that is given."""
        count = self.members if members is None else members
        sizes = {name: (n // self.members * count, d) for name, (n, d) in self.sizes.items()}
        parts = torch.split(flat, [n * d for n, d in sizes.values()])
        return {name: part.view(size) for (name, size), part in zip(sizes.items(), parts, strict=True)}

    def member_sums(self, flat: Tensor) -> Tensor:
        """(members,) sums of a flat vector over the unknowns of each member."""
        return torch.stack([flat.new_zeros(self.members), *(part.sum(1) for part in self._by_member(flat))]).sum(0)

    def member_largest(self, flat: Tensor) -> Tensor:
        """(members,) largest entries."""
        parts = [part.amax(1) for part in self._by_member(flat)]
        return torch.stack(parts).amax(0) if parts else flat.new_zeros(self.members)

    def member_spread(self, values: Tensor) -> Tensor:
        """(N,) the value (members,) of the member that an unknown belongs to."""
        if self.members == 1:
            return values.expand(self.num_unknowns)
        parts = [values.repeat_interleave(n * d // self.members) for n, d in self.sizes.values()]
        return torch.cat(parts)

    def member_unknowns(self) -> Tensor:
        """(members, n) numbers of the unknowns of each member."""
        return torch.cat(self._by_member(torch.arange(self.num_unknowns, device=self.device)), dim=1)

    def chosen_members(self, flat: Tensor, chosen: list[int]) -> Tensor:
        """The flat vector of some of the members alone."""
        return torch.cat([part[chosen].reshape(-1) for part in self._by_member(flat)])

    def _by_member(self, flat: Tensor) -> list[Tensor]:
        parts = torch.split(flat, [n * d for n, d in self.sizes.values()])
        return [part.view(self.members, -1) for part in parts if part.numel()]

    def free_mask(self, fixed: Mapping[str, Tensor], device: torch.device) -> Tensor:
        """True where an unknown may move; the masks ``(n,)`` or ``(n, d)`` in ``fixed`` are True where it may not."""
        if not isinstance(fixed, Mapping):
            raise ShapeError("fixed", 'masks by block name, such as {"vertices": mask}', shown(fixed))
        free = {name: torch.ones(size, dtype=torch.bool, device=device) for name, size in self.sizes.items()}
        for name, mask in fixed.items():
            if name not in self.sizes:
                raise ShapeError("fixed", f"block names among {list(self.sizes)}", f"'{name}'")
            n, d = self.sizes[name]
            is_mask = isinstance(mask, Tensor) and mask.dtype == torch.bool
            if not is_mask or tuple(mask.shape) not in ((n,), (n, d)):
                what = f"a bool mask ({n},) or ({n}, {d}), a tensor that is True where an unknown stays as it is"
                raise ShapeError(f"fixed['{name}']", what, shown(mask))
            free[name] &= ~(mask[:, None] if mask.ndim == 1 else mask).to(device)
        return self.flatten(free)
