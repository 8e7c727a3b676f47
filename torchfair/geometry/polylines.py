"""Second differences along polylines of a mesh."""

from __future__ import annotations

from torch import Tensor

from .._precision import in_single_at_least
from ..errors import ShapeError
from ._ops import gather


@in_single_at_least
def second_differences(vertices: Tensor, triples: Tensor) -> Tensor:
    """Second differences ``v_prev - 2 v + v_next`` of consecutive vertices on polylines.

    Evaluated as ``(v_prev - v) + (v_next - v)``, so that far from the origin no digits are lost.

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        triples: (N, 3) integer vertex numbers ``previous, vertex, next``; those of the mesh polylines come
            from :func:`torchfair.straight_triples`.

    Returns:
        (*batch, N, 3), same unit. Linear in the vertices; zero where ``vertex`` is halfway.

    Raises:
        ShapeError: if ``triples`` is not an integer tensor (N, 3).

    Example:
        >>> import torch
        >>> from torchfair.geometry import second_differences
        >>> line = torch.tensor([[0.0, 0, 0], [1, 0, 0], [2, 0.5, 0]])
        >>> second_differences(line, torch.tensor([[0, 1, 2]]))
        tensor([[0.0000, 0.5000, 0.0000]])
    """
    check_triples(triples)
    previous, here, following = gather(vertices, triples).unbind(-2)
    return (previous - here) + (following - here)


def check_triples(triples: Tensor) -> None:
    """Raises ShapeError unless ``triples`` is an integer tensor (N, 3)."""
    expected = "an integer tensor (N, 3) of vertex numbers previous, vertex, next"
    if not isinstance(triples, Tensor):
        raise ShapeError("triples", expected, type(triples).__name__)
    if triples.dim() != 2 or triples.shape[1] != 3 or triples.is_floating_point():
        raise ShapeError("triples", expected, f"{tuple(triples.shape)} {triples.dtype}")
