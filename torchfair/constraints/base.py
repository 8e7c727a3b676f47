"""What all constraints share: a module made of element terms, so that one residual has two uses."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import torch
from torch import Tensor, nn

from .._shown import shown
from ..errors import ShapeError
from ..projection import ElementTerm
from ..projection.layout import Layout
from ..topology import Topology
from ._part import Part

_MANY = 2**31 - 1  # rows of a block of which nothing is known


class Constraint(nn.Module):
    r"""Element terms as a module: a loss for training, and terms of the solver.

    ``Constraint(terms)`` takes any terms over one block of positions, those of this package and those a user writes.
    The value is what they add to the merit of :func:`~torchfair.projection.guided_projection`,

    .. math:: \sum_{terms} weight \sum_{elements} element\_weight \cdot loss(residual),

    where the loss of :class:`~torchfair.projection.Squares`, the usual one, is **half** the squared norm. The
    ready-made subclasses have weight 1.

    **What is differentiated.** The residual, by torch, to any order that it allows; closed forms of Jacobians are for
    the solver. Data that a term refreshes (closest points, feet on curves, normals of planes) are found for each
    member of the batch and are constant for derivatives, as they are for the solver.

    **Degenerate elements.** An element whose residual is not a number, such as a face without area, counts nothing and
    has gradient zero. One whose residual is infinite, beyond a barrier, makes the value infinite, with gradient zero
    too. (The solver takes no step to either.) Coordinates that are not finite stay visible: the value is NaN.

    Data and element weights are buffers, ``parts.0.targets`` and so on, named as the residual names them: they follow
    ``.to()``, are in the ``state_dict``, and can be replaced by ``torch.func.functional_call``. Parameters among them
    stay parameters, so data can be learned; gradients flow to data that require them. Data without a fraction, indices
    and marks, are none, as stencils are none: they follow to a device.

    Args:
        terms: Over one block, which may have any name; none at all is legal and costs nothing.

    Raises:
        ShapeError: there is something else among them, they are over several blocks, or their parts do not fit each
            other.

    Example:
        >>> import torch
        >>> from torchfair.constraints import Constraint
        >>> from torchfair.projection import ElementTerm
        >>> def stretched(x, length):  # the two ends of one edge
        ...     return torch.linalg.vector_norm(x[1] - x[0]) - length
        >>> term = ElementTerm("edge length", stretched, [("vertices", torch.tensor([[0, 1]]))], (torch.ones(1),))
        >>> Constraint([term])(torch.tensor([[0.0, 0, 0], [3, 0, 0]]))
        tensor(2.)
    """

    if TYPE_CHECKING:  # torch says Any

        def __call__(self, vertices: Tensor) -> Tensor:
            """What ``forward`` gives."""
            ...

    def __init__(self, terms: Iterable[ElementTerm] = ()) -> None:
        super().__init__()
        chosen = _checked(terms)
        self.parts = nn.ModuleList(Part(term) for term in chosen)
        self._rows = max((_rows(term) for term in chosen), default=0)

    def forward(self, vertices: Tensor) -> Tensor:
        """Value (*batch,) at ``vertices`` (*batch, V, 3), or at the rows of whatever block the terms are over.

        Raises:
            ShapeError: ``vertices`` is not a floating tensor with at least as many rows as the terms use.
        """
        vertices = self._read(vertices)
        total = vertices[..., :0, :].sum((-2, -1))  # zero, but differentiable
        for part in self._parts():
            total = total + part.evaluate(vertices)[1].sum(-1)
        return total

    def per_element(self, vertices: Tensor) -> Tensor:
        """What each element contributes, (*batch, N), in the order of the terms; sums to ``forward(vertices)``."""
        vertices = self._read(vertices)
        nothing = vertices[..., :0, 0]
        return torch.cat([nothing, *(part.evaluate(vertices)[1] for part in self._parts())], dim=-1)

    def per_mesh(self, vertices: Tensor, topology: Topology) -> Tensor:
        """What the elements of each of n joined meshes contribute, (*batch, n); sums to ``forward(vertices)``.

        An element belongs to the mesh of its first vertex. Where nothing is joined it is ``forward(vertices)``.

        Args:
            vertices: (*batch, V, 3).
            topology: of the vertices, from :meth:`Topology.join`.

        Raises:
            ShapeError: ``vertices`` is not a floating tensor (*batch, V, 3).
        """
        topology.check_vertices(vertices)
        if not topology.is_joined:
            return self.forward(vertices)
        first = [part.indices[0][:, 0] for part in self._parts()]
        nothing = topology.corners[:0]
        return topology.sum_per_mesh(self.per_element(vertices), topology.sums_over(torch.cat([nothing, *first])))

    def residuals(self, vertices: Tensor) -> list[Tensor]:
        """Residuals (*batch, n, m) of the n elements of each term, without weights; zero where they are no numbers.

        Those of inequalities are signed: what is at most zero holds.
        """
        vertices = self._read(vertices)
        return [part.evaluate(vertices)[0] for part in self._parts()]

    def terms(self, *, weight: float = 1.0) -> list[ElementTerm]:
        """The same as terms for guided projection, with the present data.

        Args:
            weight: Factor of the weights of all terms, at least 0.
        """
        return [part.term(weight) for part in self._parts()]

    def _parts(self) -> Iterable[Part]:
        return (part for part in self.parts if isinstance(part, Part))

    def _read(self, vertices: Tensor) -> Tensor:
        if not isinstance(vertices, Tensor) or not vertices.is_floating_point() or vertices.ndim < 2:
            raise ShapeError("vertices", "a floating tensor (*batch, V, 3)", shown(vertices))
        if vertices.shape[-2] < self._rows:
            raise ShapeError("vertices", f"at least {self._rows} rows, which the terms use", shown(vertices))
        return vertices.float() if vertices.dtype.itemsize < 4 else vertices  # half precision is too coarse for shapes


def _rows(term: ElementTerm) -> int:
    """How many rows of its block a term uses."""
    return max(int(index.max()) + 1 if index.numel() else 0 for _, index in term.stencil)


def _checked(terms: Iterable[ElementTerm]) -> list[ElementTerm]:
    """Those terms that have elements; raises ShapeError if they make no constraint."""
    if isinstance(terms, ElementTerm) or not isinstance(terms, Iterable):
        raise ShapeError("terms", "a list of ElementTerm", shown(terms))
    result = list(terms)
    for i, term in enumerate(result):
        if not isinstance(term, ElementTerm):
            raise ShapeError(f"terms[{i}]", "an ElementTerm (unpack lists of them with *)", shown(term))
        term.check(_layout(result[0], term))
    return [term for term in result if term.num_elements]


def _layout(first: ElementTerm, term: ElementTerm) -> Layout:
    """The one block that the first term is over, as large as may be, in the dtype and on the device of another one."""
    try:
        (block, index), *_ = first.stencil
        sizes, device = {str(block): (_MANY, 3)}, index.device
    except (TypeError, ValueError, AttributeError):  # of which the check tells more
        sizes, device = {}, torch.device("cpu")
    tensors = [tensor for tensor in (*term.data, term.element_weights) if isinstance(tensor, Tensor)]
    dtype = next((tensor.dtype for tensor in tensors if tensor.is_floating_point()), torch.float64)
    return Layout(sizes, dtype, device)
