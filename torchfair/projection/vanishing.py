"""Whether all residuals are zero, each term for itself and whatever its weight."""

from __future__ import annotations

import torch
from torch import Tensor

from .layout import State
from .linear_system import LinearSystem


def vanishing(system: LinearSystem, state: State, tolerance: float) -> Tensor:
    """(members,) bool: no term has larger residuals than a relative change of all unknowns by ``tolerance`` makes them.

    A sum over all terms cannot tell: beside a constraint of weight 1e12 nothing else counts. So weights are divided
    out, those of terms, of elements and of reweighting. The size of an unknown is that of its block (root mean square),
    since residuals at an unknown that is zero would never be small.

    Args:
        system: Linearised at ``state``.
        state: Blocks, of all members one after the other.
        tolerance: Relative change of the unknowns.
    """
    structure = system.structure
    layout, count = structure.layout, structure.layout.members
    sizes = {name: block.reshape(count, -1).square().mean(1) for name, block in state.items()}
    unknowns = [sizes[name].repeat_interleave(n * d // count) for name, (n, d) in layout.sizes.items()]
    squares = torch.cat(unknowns).nan_to_num(nan=0.0)
    answer = torch.ones(count, dtype=torch.bool, device=structure.device)
    terms = zip(system.of_felt(system.residuals), system.jacobians, system.roots, strict=True)
    for number, (residuals, jacobians, root) in enumerate(terms):
        if not residuals.shape[1]:
            continue  # none of its elements is felt: their residuals are zero
        inverse = residuals.new_ones(1).expand(residuals.shape[1])
        if root.ndim == 1:
            inverse = torch.where(root > 0.0, 1.0 / root, 0.0)[system.elements(number)]
        residuals = residuals * inverse
        ranges = system.felt_unknowns(number)
        parts = [((jacobians[..., some] * inverse[some]).square() * squares[at]).sum(1) for some, at in ranges]
        changes = torch.cat(parts, 1)
        answer &= _are_small(residuals.reshape(-1, count, residuals.shape[1] // count), changes, tolerance)
    if structure.affine is not None and system.affine_residual is not None:
        for residuals, changes in structure.affine.by_term(system.affine_residual, squares):
            answer &= _are_small(residuals.view(1, count, -1), changes, tolerance)
    return answer


def _are_small(residuals: Tensor, changes: Tensor, tolerance: float) -> Tensor:
    """(members,) from residuals (m, members, n) of a term and squares of their changes."""
    largest = changes.reshape(residuals.shape).sum((0, 2))
    return (residuals.square().sum((0, 2)) <= tolerance**2 * largest) & torch.isfinite(largest)
