"""What all energies share: a module that holds a topology, and its variant with one term per edge."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import ClassVar

import torch
from torch import Tensor, nn

from ..errors import ShapeError
from ..topology import Topology


class MeshModule(nn.Module):
    """A module that holds a :class:`Topology` and takes it along when it is moved.

    The topology is not a buffer: its index tensors stay integers under ``.half()`` or ``.type()``, survive
    ``.to_empty()`` and stay out of the ``state_dict``. Modules copy and pickle with it.

    Attributes:
        topology: who is beside whom, on the device of the module. It keeps its data when the module goes
            to the meta device.
        needs: names of the tables of :class:`Topology` that ``forward`` reads. They are filled in when the
            module is made or moved, so that ``forward`` compiles to one graph.
    """

    topology: Topology
    needs: ClassVar[tuple[str, ...]] = ("is_triangular", "faces_by_size")

    def __init__(self, topology: Topology) -> None:
        super().__init__()
        self._set_topology(topology)

    def _set_topology(self, topology: Topology) -> None:
        for name in self.needs:
            getattr(topology, name)
        self.topology = topology

    def _apply(self, fn: Callable[[Tensor], Tensor], recurse: bool = True) -> MeshModule:
        super()._apply(fn, recurse)  # type: ignore[no-untyped-call]
        # Only the device that fn leads to matters: fn itself might change or drop the indices.
        probe = torch.empty(0, dtype=torch.int64, device=self.topology.device)
        device = fn(probe).device
        if device != self.topology.device and device.type != "meta":
            self._set_topology(self.topology.to(device))
        return self

    def extra_repr(self) -> str:
        """The topology in words."""
        return repr(self.topology)


class EdgeEnergy(MeshModule, ABC):
    """An energy that is a sum over interior edges, each term multiplied by the weight of its edge.

    Subclasses define :meth:`per_edge`.

    Args:
        topology: connectivity of all meshes that the module is called with.
        edge_weights: (I,) or (*batch, I) floating factors of the terms, 1 if left out. A buffer: moves with
            the module and is part of its ``state_dict``.

    Raises:
        ShapeError: if ``edge_weights`` does not end with one number per interior edge.
    """

    edge_weights: Tensor | None

    def __init__(self, topology: Topology, edge_weights: Tensor | None = None) -> None:
        super().__init__(topology)
        check_edge_weights(edge_weights, topology)
        self.register_buffer("edge_weights", edge_weights)

    @abstractmethod
    def per_edge(self, vertices: Tensor) -> Tensor:
        """Terms (*batch, I) of the interior edges, weights included; they sum to ``forward(vertices)``."""

    def forward(self, vertices: Tensor) -> Tensor:
        """Energy (*batch,) of ``vertices`` (*batch, V, 3)."""
        return self.per_edge(vertices).sum(-1)


def check_edge_weights(edge_weights: Tensor | None, topology: Topology) -> None:
    """Raises ShapeError unless ``edge_weights`` is None or a floating tensor (..., I)."""
    if edge_weights is None:
        return
    if not isinstance(edge_weights, Tensor):
        raise _weights_error(type(edge_weights).__name__, topology)
    if edge_weights.shape[-1:] != (topology.num_interior_edges,) or not edge_weights.is_floating_point():
        raise _weights_error(f"{tuple(edge_weights.shape)} {edge_weights.dtype}", topology)


def _weights_error(actual: str, topology: Topology) -> ShapeError:
    # Written only when it is raised: torch.compile cannot format sizes that it holds as symbols.
    expected = f"a floating tensor ({topology.num_interior_edges},), one weight per interior edge"
    return ShapeError("edge_weights", expected, actual)


def weigh(terms: Tensor, edge_weights: Tensor | None, topology: Topology) -> Tensor:
    """``terms`` (*batch, I) times ``edge_weights``, in the dtype of the terms.

    Raises:
        ShapeError: if ``edge_weights`` does not end with one number per interior edge.
    """
    check_edge_weights(edge_weights, topology)
    return terms if edge_weights is None else terms * edge_weights.to(terms.dtype)
