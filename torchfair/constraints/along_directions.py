"""Terms on vertices that move along given directions only: one unknown instead of three."""

from __future__ import annotations

from dataclasses import replace

from torch import Tensor

from ..errors import ShapeError
from ..geometry._ops import dot
from ..projection import ElementTerm


def along_directions(term: ElementTerm, base: Tensor, directions: Tensor, *, block: str = "heights") -> ElementTerm:
    """The term with vertices ``base + height * direction``: a third of the unknowns, a ninth of the matrix.

    A surface changes its shape by moving along its normals only, so a shape can be sought in this way first
    and the vertices be spread afterwards.

    Args:
        term: On one block of positions, without refresh.
        base: (V, 3) positions at height 0.
        directions: (V, 3); not necessarily of length one.
        block: Name of the block of heights (V, 1).

    Raises:
        ShapeError: the term has several blocks or is refreshed.
    """
    if len(term.stencil) != 1 or term.refresh is not None:
        raise ShapeError(f"term '{term.name}'", "one block of positions and no refresh", "another term")
    ((_, index),) = term.stencil

    def residual(heights: Tensor, places: Tensor, ways: Tensor, *data: Tensor) -> Tensor:
        return term.residual(places + heights * ways, *data)

    closed = term.jacobian

    def jacobian(heights: Tensor, places: Tensor, ways: Tensor, *data: Tensor) -> Tensor:
        assert closed is not None
        by_vertices = closed(places + heights * ways, *data)
        by_vertices = by_vertices.reshape(*by_vertices.shape[:-1], *ways.shape[-2:])
        several = term.batched and by_vertices.ndim > ways.ndim  # components of the residual
        return dot(by_vertices, ways[:, None] if several else ways)

    return replace(
        term,
        residual=residual,
        stencil=[(block, index)],
        data=(base[index], directions[index], *term.data),
        jacobian=None if closed is None else jacobian,
    )
