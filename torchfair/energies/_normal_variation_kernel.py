r"""Value and gradient of the normal variation in one go, without autograd: Prop. 2 of the paper.

Everything is organised by faces, so that only the final forces on the vertices are scattered::

    corner j                   e_j = p_j - p_(j+1)       side j
       |  \                    N   = 2 * area vector of f,  n = N / |N|
       |    \                  d_j = n_g - n             jump of the normal across side j
       | f  /   g              term of the edge: |e_j| |d_j|, met from both of its faces
       |  /
    corner j+1

    dE/dn   = -sum_j |e_j|/|d_j| d_j,        dE/dN = (dE/dn - n <n, dE/dn>) / |N|
    dE/dp_j = dE/dN x (e_(j-1) + e_j)  +  1/2 (|d_j|/|e_j| e_j - |d_(j-1)|/|e_(j-1)| e_(j-1))

``dE/dn - n <n, dE/dn>`` is the sum of the projected normals over l* in formula (1) of the paper; the two
halves in the last line make its first sum, because each edge is met twice. Unlike (1), this is right for
polygons of any size.

Memory traffic limits the speed. Hence coordinates are kept apart, faces come in blocks that fit the cache,
and nearly every step writes into memory that is there already.
"""

from __future__ import annotations

import torch
from torch import Tensor

from ..geometry._unit import bring_to_unit
from ..geometry.normals import DEGENERACY
from ._normal_variation_blocks import Block, Tables
from ._normal_variation_memory import Memory


def energy_and_gradient(
    vertices: Tensor, edge_weights: Tensor | None, tables: Tables, gradient: Tensor | None
) -> Tensor:
    """Energies (B,) of ``vertices`` (B, V, 3); writes their gradients to ``gradient`` (B, V, 3) unless it is None.

    Of n joined meshes (B, n). ``edge_weights`` is None, (1, I) or (B, I).
    """
    with tables.scratch.lend(vertices, _memory_needed(vertices, tables)) as memory:
        positions = memory.take(3, *vertices.shape[:2]).copy_(vertices.movedim(-1, 0))
        unit = bring_to_unit(positions, tables.vertex_meshes, tables.num_meshes)
        side_buffer = memory.take(5, vertices.shape[0], tables.most_sides)
        face_buffer = memory.take(4, vertices.shape[0], tables.most_faces)
        normals = memory.take(3, vertices.shape[0], tables.face_count)
        inverse_norms = memory.take(vertices.shape[0], tables.face_count)
        all_sides = []
        for block in tables.blocks:
            scratch = face_buffer[..., : block.face_count]
            sides, squared = _side_vectors(positions, block, scratch, memory)
            _write_normals(sides, squared, block.take(normals), block.take(inverse_norms), scratch)
            all_sides.append((sides, squared))
        energy = vertices.new_zeros(vertices.shape[0], *tables.mesh_shape)
        forces = positions.zero_()  # the positions have been used up
        for block, (sides, squared) in zip(tables.blocks, all_sides, strict=True):
            own = block.take(normals)
            buffer = side_buffer[..., : block.side_count].view(5, *squared.shape)
            jumps, stretch, turn = buffer[:3], buffer[3], buffer[4]
            _gather(normals, block.neighbours, out=jumps).sub_(own.unsqueeze(2))
            terms = _terms(squared, jumps, _weights_of(block, edge_weights), stretch, turn)
            energy += terms.sum((1, 2)) if block.sums is None else block.sums.sum(terms.sum(1))
            if gradient is not None:
                scratch = face_buffer[..., : block.face_count]
                pull = _pull(jumps, turn, own, block.take(inverse_norms), scratch)
                _scatter(_forces(sides, pull, stretch, out=jumps), block, forces)
        if gradient is not None:
            gradient.copy_(forces.movedim(0, -1))
    return energy.div_(2).mul_(unit)


def _memory_needed(vertices: Tensor, tables: Tables) -> int:
    batch = vertices.shape[0]
    shapes = [(3, *vertices.shape[:2]), (5, batch, tables.most_sides), (4, batch, tables.most_faces)]
    shapes += [(3, batch, tables.face_count), (batch, tables.face_count)]
    for block in tables.blocks:
        shapes += [(3, batch, block.side_count), (batch, block.side_count)]
    return sum(Memory.size(*shape) for shape in shapes)


def _side_vectors(positions: Tensor, block: Block, scratch: Tensor, memory: Memory) -> tuple[Tensor, Tensor]:
    """``e_j`` (3, B, k, n) and ``|e_j|^2`` (B, k, n)."""
    shape = (positions.shape[1], block.corner_count, block.face_count)
    sides, squared = memory.take(3, *shape), memory.take(*shape)
    _gather(positions, block.corners_short, out=sides)
    first = scratch[:3].copy_(sides[:, :, 0])
    for j in range(block.corner_count - 1):
        sides[:, :, j].sub_(sides[:, :, j + 1])
    sides[:, :, -1].sub_(first)
    _dot(sides, sides, out=squared)
    return sides, squared


def _write_normals(
    sides: Tensor, squared_lengths: Tensor, normals: Tensor, inverse_norms: Tensor, scratch: Tensor
) -> None:
    """Unit normals (3, B, n) and ``1/|N|`` (B, n) of a block.

    The "normal" of a degenerate face is so long that the square of every jump to it is infinite: this
    removes its terms in :func:`_terms`.
    """
    limits = torch.finfo(sides.dtype)
    squared, valid = scratch[:2]
    _double_area(sides, out=normals)
    _dot(normals, normals, out=squared)
    torch.sum(squared_lengths, 1, out=valid)
    torch.gt(squared, valid.square_().mul_((2 * DEGENERACY * limits.eps) ** 2), out=valid)  # 1 or 0 from here on
    torch.rsqrt(squared, out=inverse_norms).clamp_(max=limits.tiny**-0.5).mul_(valid)
    normals.mul_(inverse_norms)
    normals[0].add_(valid.sub_(1), alpha=limits.max**0.75)


def _terms(squared: Tensor, jumps: Tensor, weights: Tensor | None, stretch: Tensor, turn: Tensor) -> Tensor:
    """``|e| |d|`` (B, k, n), given ``|e|^2`` (overwritten) and d.

    Writes ``|d|/|e|`` to ``stretch`` and ``|e|/|d|`` to ``turn`` (B, k, n). Both are 0 where ``|e| |d|`` is 0
    or infinite: flat edges, boundary, zero length, degenerate faces.
    """
    _dot(jumps, jumps, out=stretch)
    torch.mul(squared, stretch, out=turn).rsqrt_()  # one root serves both: 1/(|e| |d|)
    torch.nan_to_num(turn, nan=0.0, posinf=0.0, out=turn)
    if weights is not None:
        turn.mul_(weights)
    # |d| is at most 2, unless it is to be removed: then a finite number times 0.
    stretch.clamp_(max=5).mul_(turn)
    turn.mul_(squared)
    return squared.mul_(stretch)


def _pull(jumps: Tensor, turn: Tensor, normals: Tensor, inverse_norms: Tensor, scratch: Tensor) -> Tensor:
    """``-dE/dN`` (3, B, n)."""
    pull, along = scratch[:3], scratch[3]
    torch.mul(turn[:, 0], jumps[:, :, 0], out=pull)
    for j in range(1, turn.shape[1]):
        pull.addcmul_(turn[:, j], jumps[:, :, j])
    # Although <n, d> = -|d|^2 / 2 is known, only this removes the rounding of |n|, grown large by |e|/|d|.
    _dot(pull, normals, out=along)
    return pull.addcmul_(along, normals, value=-1).mul_(inverse_norms)


def _forces(sides: Tensor, pull: Tensor, stretch: Tensor, out: Tensor) -> Tensor:
    """``dE/dp_j`` (3, B, k, n): the share of one face. They add up to zero, which gives the last one."""
    if sides.shape[2] == 3:  # then e_(j-1) + e_j = -e_(j+1)
        _cross(pull.unsqueeze(2), sides[:, :, 1:], out=out[:, :, :-1])
    else:
        for j in range(sides.shape[2] - 1):
            _cross(sides[:, :, j - 1] + sides[:, :, j], pull, out=out[:, :, j])
    out[:, :, :-1].addcmul_(sides[:, :, :-1], stretch[:, :-1], value=0.5)
    out[:, :, 0].addcmul_(sides[:, :, -1], stretch[:, -1], value=-0.5)
    out[:, :, 1:-1].addcmul_(sides[:, :, :-2], stretch[:, :-2], value=-0.5)
    torch.sum(out[:, :, :-1], 2, out=out[:, :, -1]).neg_()
    return out


def _scatter(forces: Tensor, block: Block, totals: Tensor) -> None:
    """Adds forces (3, B, k, n) on corners to their vertices (3, B, V)."""
    batch = totals.shape[1]
    for force, total in zip(forces, totals, strict=True):
        if batch == 1:
            total[0].scatter_add_(0, block.corners, force.view(-1))
        else:
            total.scatter_add_(1, block.corners.expand(batch, -1), force.flatten(1))


def _gather(source: Tensor, index: Tensor, out: Tensor) -> Tensor:
    """``out[c, b] = source[c, b, index]`` for ``source`` (3, B, N) and 32-bit ``index`` (k * n,)."""
    batch = source.shape[1]
    for values, target in zip(source, out, strict=True):
        if batch == 1:
            torch.index_select(values[0], 0, index, out=target.view(-1))
        else:
            torch.gather(values, 1, index.long().expand(batch, -1), out=target.view(batch, -1))
    return out


def _weights_of(block: Block, edge_weights: Tensor | None) -> Tensor | None:
    """Weights (1 or B, k, n) of the sides of a block."""
    if edge_weights is None or edge_weights.shape[1] == 0:
        return None
    return edge_weights.index_select(1, block.edges).view(-1, block.corner_count, block.face_count)


def _double_area(sides: Tensor, out: Tensor) -> None:
    """N (3, B, n): the fan of triangles at corner 0."""
    spoke = sides[:, :, 0]
    _cross(spoke, sides[:, :, 1], out=out)
    for j in range(2, sides.shape[2] - 1):
        spoke = spoke + sides[:, :, j - 1]
        out.add_(torch.linalg.cross(spoke, sides[:, :, j], dim=0))


def _cross(x: Tensor, y: Tensor, out: Tensor) -> None:
    """``x`` cross ``y``, coordinates first."""
    xs, ys, outs = x.unbind(), y.unbind(), out.unbind()
    for a, b, c in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        torch.mul(xs[b], ys[c], out=outs[a]).addcmul_(xs[c], ys[b], value=-1)


def _dot(x: Tensor, y: Tensor, out: Tensor) -> None:
    """Scalar product, coordinates first."""
    xs, ys = x.unbind(), y.unbind()
    torch.mul(xs[0], ys[0], out=out).addcmul_(xs[1], ys[1]).addcmul_(xs[2], ys[2])
