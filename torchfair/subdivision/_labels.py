"""Labels and origins of the elements of a fine mesh, looked up in the coarse one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch
from torch import Tensor

from ..errors import ShapeError

if TYPE_CHECKING:
    from .refinement import Refinement

_VERTEX, _EDGE, _FACE = range(3)  # the values of Origin


def look_up(table: Tensor, index: Tensor) -> Tensor:
    """``table[index]`` along the first dimension, -1 where ``index`` is -1."""
    missing = (index < 0).reshape(index.shape + (1,) * (table.ndim - 1))
    return torch.where(missing, -1, table[index.clamp(min=0)])


def compose_origins(first: Refinement, origins: Tensor) -> Tensor:
    """Origins (V'', 2) of the vertices of a second step, given in the mesh between, in the coarse mesh."""
    between = first.topology
    # Inner edges lie in the coarse face of either face beside them.
    beside = torch.empty_like(first.edge_parents)
    beside[between.corner_edges] = first.face_parents[between.corner_faces]
    inner = first.edge_parents < 0
    on_edges = torch.stack([torch.where(inner, _FACE, _EDGE), torch.where(inner, beside, first.edge_parents)], 1)
    in_faces = torch.stack([torch.full_like(first.face_parents, _FACE), first.face_parents], 1)
    starts = origins.new_tensor([0, between.num_vertices, between.num_vertices + between.num_edges])
    kinds, numbers = origins.unbind(1)
    return torch.cat([first.vertex_origins, on_edges, in_faces])[starts[kinds] + numbers]


def compose_parallels(first: Tensor, second: Tensor) -> Tensor:
    """Parallels (E'', 2) of the edges of a second step in the coarse mesh.

    Along an edge of the mesh between runs one coarse edge or two opposite sides of a coarse quad, and what runs
    between two such edges runs between the same sides: never are there more than two.
    """
    all_four = look_up(first, second.flatten()).view(-1, 4)
    ends = torch.stack([all_four.amin(1), all_four.amax(1)], dim=1)
    return torch.where(ends[:, :1] < 0, -1, ends)


def carry_vertex_labels(step: Refinement, labels: Tensor, along: Tensor | None, fill: float) -> Tensor:
    """See :meth:`Refinement.carry_vertex_labels`."""
    check_labels(labels, step.coarse.num_vertices, "V, the number of vertices")
    kinds, numbers = step.vertex_origins.unbind(1)
    carried = labels.new_full((kinds.shape[0], *labels.shape[1:]), fill)
    old = kinds == _VERTEX
    carried[old] = labels[numbers[old]]
    if along is not None:
        check_labels(along, step.coarse.num_edges, "E, the number of edges", mask=True, what="along")
        new = torch.nonzero(kinds == _EDGE).squeeze(1)
        new = new[along[numbers[new]]]
        start, end = (labels[ends] for ends in step.coarse.edges[numbers[new]].unbind(1))
        carried[new] = torch.where(start == end, start, fill).to(labels.dtype)
    return carried


def carry_edge_labels(step: Refinement, labels: Tensor, parallel: bool, fill: float) -> Tensor:
    """See :meth:`Refinement.carry_edge_labels`."""
    check_labels(labels, step.coarse.num_edges, "E, the number of edges")
    first, second = step.edge_parallels.unbind(1) if parallel else (step.edge_parents, step.edge_parents)
    carried = labels.new_full((first.shape[0], *labels.shape[1:]), fill)
    known = torch.nonzero(first >= 0).squeeze(1)
    one, other = labels[first[known]], labels[second[known]]
    carried[known] = torch.where(one == other, one, fill).to(labels.dtype)
    return carried


def check_labels(labels: Tensor, count: int, words: str, *, mask: bool = False, what: str = "labels") -> None:
    """Raises ShapeError unless ``labels`` is a tensor (count, ...), or a bool tensor (count,) if it is a mask."""
    fits = isinstance(labels, Tensor) and labels.shape[:1] == (count,)
    if fits and not (mask and (labels.dtype != torch.bool or labels.ndim != 1)):
        return
    expected = f"a bool tensor ({count},)" if mask else f"a tensor ({count}, ...)"
    actual = f"{tuple(labels.shape)} {labels.dtype}" if isinstance(labels, Tensor) else type(labels).__name__
    raise ShapeError(what, f"{expected}, the first dimension {words}", actual)
