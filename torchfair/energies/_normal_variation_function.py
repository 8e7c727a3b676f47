"""The normal variation as an autograd function: value and gradient in one pass, further derivatives on request."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor
from torch.autograd import Function

from .._precision import in_single_at_least
from .._tracing import is_recorded, is_transformed
from ..geometry import dual_edge_lengths, edge_lengths
from ..geometry._unit import in_their_units
from ..topology import Topology
from ._normal_variation_blocks import faces_per_block, tables_of
from ._normal_variation_compiled import compiled_energy_and_gradient, compiled_serves
from ._normal_variation_kernel import energy_and_gradient


@in_single_at_least
def plain_terms(vertices: Tensor, topology: Topology) -> Tensor:
    """``l l*`` (*batch, I) of every interior edge, by differentiable functions of the geometry."""
    topology.check_vertices(vertices)
    vertices, unit = in_their_units(vertices, topology, "interior_edges")
    lengths = edge_lengths(vertices, topology)[..., : topology.num_interior_edges]
    return lengths * dual_edge_lengths(vertices, topology) * unit


def fast_path_serves() -> bool:
    """Whether :func:`fast_normal_variation` may be called here: not where it is recorded, nor under torch.func.

    What is recorded must not be what was written into kept memory: ``torch.func.linearize`` gave back garbage.
    Compilers fuse the plain formula by themselves. Transforms of torch.func compose with it in any order,
    but not with autograd functions: a nested ``jacfwd`` gets wrong numbers from them (PyTorch issue 197867).
    """
    return not (is_recorded() or is_transformed())


def fast_normal_variation(vertices: Tensor, edge_weights: Tensor | None, topology: Topology) -> Tensor:
    """E (*batch,) of ``vertices`` (*batch, V, 3); ``edge_weights`` (*batch, I) or fewer dimensions, same dtype.

    Of n joined meshes (*batch, n), here and in what follows.
    """
    if edge_weights is not None:
        batch = torch.broadcast_shapes(vertices.shape[:-2], edge_weights.shape[:-1])  # type: ignore[no-untyped-call]
        vertices = vertices.expand(*batch, -1, -1)
    with_gradient = vertices.requires_grad and torch.is_grad_enabled()
    energy: Tensor = _Energy.apply(vertices, edge_weights, topology, with_gradient)[0]  # type: ignore[no-untyped-call]
    return energy


class _Energy(Function):
    """``(vertices, edge_weights, topology, with_gradient) -> (energy, gradient or an empty tensor)``.

    The gradient comes with the value, where much of it has been computed already. It is there for
    :class:`_Gradient` only and never differentiated itself.
    """

    @staticmethod
    def forward(
        ctx: Any, vertices: Tensor, edge_weights: Tensor | None, topology: Topology, with_gradient: bool
    ) -> Any:
        energy, gradient = _evaluate(vertices, edge_weights, topology, with_gradient)
        ctx.mark_non_differentiable(gradient)
        ctx.set_materialize_grads(False)  # spares backward a tensor of zeros for the gradient
        ctx.save_for_backward(vertices, edge_weights, gradient)
        ctx.save_for_forward(vertices, edge_weights, gradient)
        ctx.topology = topology
        return energy, gradient

    @staticmethod
    def backward(ctx: Any, *cotangents: Tensor | None) -> tuple[Tensor | None, Tensor | None, None, None]:
        vertices, edge_weights, gradient = ctx.saved_tensors
        factor = cotangents[0]
        along_vertices = along_weights = None
        if factor is not None and ctx.needs_input_grad[0]:
            along_vertices = _scaled_gradient(factor, vertices, edge_weights, gradient, ctx.topology)
        if factor is not None and ctx.needs_input_grad[1]:
            # Autograd itself sums over dimensions along which the weights were repeated.
            along_weights = ctx.topology.spread(factor, "interior_edges") * plain_terms(vertices, ctx.topology)
        return along_vertices, along_weights, None, None

    @staticmethod
    def jvp(ctx: Any, *tangents: Any) -> tuple[Tensor, None]:
        vertices, edge_weights, gradient = ctx.saved_tensors
        topology = ctx.topology
        rate = vertices.new_zeros((*vertices.shape[:-2], *tables_of(topology).mesh_shape))
        if tangents[0] is not None:
            slope = _scaled_gradient(torch.ones_like(rate), vertices, edge_weights, gradient, topology)
            rate = rate + topology.sum_per_mesh((slope * tangents[0]).sum(-1), "vertices")
        if tangents[1] is not None:
            rate = rate + topology.sum_per_mesh(plain_terms(vertices, topology) * tangents[1], "interior_edges")
        return rate, None


class _Gradient(Function):
    """``(factor, vertices, edge_weights, gradient if known, topology) -> factor * gradient``.

    Its derivatives, second ones of E, are those of the plain formula.
    """

    @staticmethod
    def forward(
        ctx: Any, factor: Tensor, vertices: Tensor, edge_weights: Tensor | None, gradient: Tensor, topology: Topology
    ) -> Tensor:
        if gradient.shape != vertices.shape:
            gradient = _evaluate(vertices, edge_weights, topology, with_gradient=True)[1]
        ctx.save_for_backward(factor, vertices, edge_weights, gradient)
        ctx.save_for_forward(factor, vertices, edge_weights, gradient)
        ctx.topology = topology
        return topology.spread(factor, "vertices")[..., None] * gradient

    @staticmethod
    def backward(ctx: Any, *cotangents: Tensor) -> tuple[Tensor | None, ...]:
        inputs = [value for value in ctx.saved_tensors[:3] if value is not None]
        slopes = torch.func.vjp(_plain_gradient(ctx.topology), *inputs)[1](cotangents[0])
        return slopes[0], slopes[1], slopes[2] if len(slopes) > 2 else None, None, None

    @staticmethod
    def jvp(ctx: Any, *tangents: Any) -> Tensor:
        factor, vertices, edge_weights, gradient = ctx.saved_tensors
        plain = _plain_gradient(ctx.topology)
        rate = torch.zeros_like(vertices)
        if tangents[0] is not None:
            rate = rate + _scaled_gradient(tangents[0], vertices, edge_weights, gradient, ctx.topology)
        if tangents[1] is not None:
            # The second derivative is symmetric: it acts on tangents as on cotangents.
            rate = rate + torch.func.vjp(lambda v: plain(factor, v, edge_weights), vertices)[1](tangents[1])[0]
        if tangents[2] is not None:
            rate = rate + plain(factor, vertices, tangents[2])  # E is linear in the weights
        return rate


def _scaled_gradient(
    factor: Tensor, vertices: Tensor, edge_weights: Tensor | None, gradient: Tensor, topology: Topology
) -> Tensor:
    """``factor * gradient``, differentiable again."""
    if fast_path_serves():
        scaled: Tensor = _Gradient.apply(  # type: ignore[no-untyped-call]
            factor, vertices, edge_weights, gradient, topology
        )
        return scaled
    return _plain_gradient(topology)(factor, vertices, edge_weights)


def _plain_gradient(topology: Topology) -> Callable[..., Tensor]:
    """``(factor, vertices, edge_weights or None) -> factor * gradient`` by autograd of the plain formula."""

    def gradient(factor: Tensor, vertices: Tensor, edge_weights: Tensor | None = None) -> Tensor:
        def energy(vertices: Tensor) -> Tensor:
            terms = plain_terms(vertices, topology)
            return (terms if edge_weights is None else terms * edge_weights).sum()

        slope: Tensor = torch.func.grad(energy)(vertices)
        return topology.spread(factor, "vertices")[..., None] * slope

    return gradient


def _evaluate(
    vertices: Tensor, edge_weights: Tensor | None, topology: Topology, with_gradient: bool
) -> tuple[Tensor, Tensor]:
    """E (*batch,) and its gradient (*batch, V, 3), or an empty tensor in its place."""
    batch, count = vertices.shape[:-2], topology.num_vertices
    flat = vertices.reshape(batch.numel(), count, 3)
    gradient = flat.new_empty(flat.shape) if with_gradient else None
    if compiled_serves(flat, edge_weights, topology):
        energy = compiled_energy_and_gradient(flat, topology, gradient)
        return energy.view(batch), flat.new_empty(0) if gradient is None else gradient.view(vertices.shape)
    meshes = tables_of(topology).mesh_shape
    energy = flat.new_empty(flat.shape[0], *meshes)
    if edge_weights is not None:
        rows = batch if edge_weights.dim() > 1 else torch.Size()
        edge_weights = edge_weights.expand(*rows, -1).reshape(rows.numel(), topology.num_interior_edges)
    # As many meshes at once as fill one block.
    step = max(1, faces_per_block(flat.is_cpu) // max(topology.num_faces, 1))
    for start in range(0, flat.shape[0], step):
        part = slice(start, start + step)
        weights = edge_weights if edge_weights is None or edge_weights.shape[0] == 1 else edge_weights[part]
        slope = None if gradient is None else gradient[part]
        energy[part] = energy_and_gradient(flat[part], weights, tables_of(topology), slope)
    return energy.view((*batch, *meshes)), flat.new_empty(0) if gradient is None else gradient.view(vertices.shape)
