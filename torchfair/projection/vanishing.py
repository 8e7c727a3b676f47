"""Whether all residuals are zero, each term for itself and whatever its weight."""

from __future__ import annotations

import torch
from torch import Tensor

from .compiled import CompiledTerm
from .layout import State
from .linear_system import LinearSystem
from .portions import portions


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
    parts = zip(structure.compiled, system.of_felt(system.residuals), system.jacobians, system.roots, strict=True)
    for number, (compiled, residuals, jacobians, root) in enumerate(parts):
        if not residuals.shape[1]:
            continue  # none of its elements is felt: their residuals are zero
        elements = system.elements(number)
        inverse = torch.where(root > 0.0, 1.0 / root, 0.0)[elements] if root.ndim == 1 else None
        if inverse is not None:
            residuals = residuals * inverse
        changes = _changes(compiled, jacobians, inverse, squares, elements)
        answer &= _are_small(residuals.reshape(-1, count, residuals.shape[1] // count), changes, tolerance)
    if structure.affine is not None and system.affine_residual is not None:
        for residuals, changes in structure.affine.by_term(system.affine_residual, squares):
            answer &= _are_small(residuals.view(1, count, -1), changes, tolerance)
    return answer


def _changes(
    compiled: CompiledTerm, jacobians: Tensor, inverse: Tensor | None, squares: Tensor, elements: slice | Tensor
) -> Tensor:
    """(m, n) squares of what changes of all unknowns make of residuals, from Jacobians (m, K, n), a portion at once."""
    parts = []
    for part in portions(jacobians.shape[-1], jacobians):
        some = jacobians[..., part] if inverse is None else jacobians[..., part] * inverse[part]
        unknowns = compiled.unknowns_of(elements[part] if isinstance(elements, Tensor) else part)
        parts.append((some.square() * squares[unknowns]).sum(1))
    return torch.cat(parts, -1)


def _are_small(residuals: Tensor, changes: Tensor, tolerance: float) -> Tensor:
    """(members,) from residuals (m, members, n) of a term and squares of their changes."""
    largest = changes.reshape(residuals.shape).sum((0, 2))
    return (residuals.square().sum((0, 2)) <= tolerance**2 * largest) & torch.isfinite(largest)
