"""Members of a batch, each at the state it has chosen."""

from __future__ import annotations

import torch
from torch import Tensor

from .evaluation import Evaluation
from .portions import Arguments
from .system import Structure


def with_members(
    structure: Structure, at: Evaluation, flat: Tensor, part: Evaluation, chosen: list[int], rows: list[int]
) -> Evaluation:
    """An evaluation in which some members have another state.

    Args:
        structure: Of the batch.
        at: Of all members.
        flat: (N,) the new state of all.
        part: Of these members, or of more.
        chosen: Their numbers.
        rows: Their places in ``part``.
    """
    members, places, sources = structure.layout.members, torch.tensor(chosen), torch.tensor(rows)
    places, sources = places.to(structure.device), sources.to(structure.device)

    def mixed(old: Tensor, new: Tensor) -> Tensor:
        size = old.shape[0] // members
        result = old.clone()
        result.view(members, size, *old.shape[1:])[places] = new.view(-1, size, *old.shape[1:])[sources]
        return result

    state = structure.layout.unflatten(flat)
    arguments = [
        Arguments(old.term, state, tuple(map(mixed, old.data, new.data)))
        for old, new in zip(at.arguments, part.arguments, strict=True)
    ]
    values = [mixed(*pair) for pair in zip(at.values, part.values, strict=True)]
    affine = None
    if structure.affine is not None and at.affine is not None and part.affine is not None:
        affine = structure.affine.with_members(at.affine, part.affine, places, members)
    return Evaluation(state, mixed(at.merits, part.merits), arguments, values, affine)
