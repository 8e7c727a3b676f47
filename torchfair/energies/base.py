"""What all energies share: a module that holds a topology, and its variant with one term per edge."""

from __future__ import annotations

import inspect
from abc import ABCMeta, abstractmethod
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, ClassVar, Literal, get_args

import torch
from torch import Tensor, nn

from ..errors import ShapeError, TorchfairError
from ..topology import Topology

_MESH = "torchfair_mesh"  # key of the checksum in the metadata of a state

Reduction = Literal["none", "mean", "sum"]


class _MadeForTraining(ABCMeta):
    """Tensors that modules make for themselves are ordinary ones, even if they are made under ``inference_mode``."""

    if not TYPE_CHECKING:  # checkers look at __init__; pyright would take a module for Any

        def __call__(cls, *args: Any, **kwargs: Any) -> Any:
            with torch.inference_mode(False):
                return super().__call__(*args, **kwargs)

    @property
    def __signature__(cls) -> inspect.Signature:
        """What is told of the arguments: those of ``__init__``."""
        try:
            told = inspect.signature(cls.__init__, eval_str=True)  # type: ignore[misc]
        except NameError:  # a subclass with types that are there for type checkers only
            told = inspect.signature(cls.__init__)  # type: ignore[misc]
        return told.replace(parameters=list(told.parameters.values())[1:], return_annotation=told.empty)


class MeshModule(nn.Module, metaclass=_MadeForTraining):
    """A module that holds a :class:`Topology` and takes it along when it is moved.

    Subclasses define :meth:`per_mesh`.

    The topology is not a buffer: its index tensors stay integers under ``.half()`` or ``.type()``, survive
    ``.to_empty()`` and stay out of the ``state_dict``. Modules copy and pickle with it, and ``torch.load`` reads those
    of torchfair with ``weights_only=True``.

    Args:
        topology: connectivity of all meshes that the module is called with. If it is joined of n meshes
            (:meth:`Topology.join`), there is a value of each: ``(*batch, n)`` wherever ``(*batch,)`` is said.
        reduction: what ``forward`` makes of the values of the meshes: ``"none"`` leaves them, ``"mean"`` and
            ``"sum"`` give one number.

    Raises:
        TorchfairError: for an unknown reduction.

    Attributes:
        topology: who is beside whom, on the device of the module. It keeps its data when the module goes
            to the meta device.
        needs: names of the tables of :class:`Topology` that ``forward`` reads. They are filled in when the
            module is made or moved, so that ``forward`` compiles to one graph.
    """

    topology: Topology
    needs: ClassVar[tuple[str, ...]] = ("is_triangular", "faces_by_size")

    if TYPE_CHECKING:  # torch says Any

        def __call__(self, vertices: Tensor) -> Tensor:
            """What ``forward`` gives."""
            ...

    def __init__(self, topology: Topology, *, reduction: Reduction = "none") -> None:
        super().__init__()
        if reduction not in get_args(Reduction):
            raise TorchfairError(f'reduction must be "none", "mean" or "sum", got {reduction!r}')
        self.reduction: Reduction = reduction
        self._set_topology(topology)

    def per_mesh(self, vertices: Tensor) -> Tensor:
        """Values (*batch,) of the meshes ``vertices`` (*batch, V, 3); (*batch, n) of n joined ones."""
        raise NotImplementedError(f"{type(self).__name__} defines neither per_mesh nor forward")

    def forward(self, vertices: Tensor) -> Tensor:
        """Values (*batch,) of ``vertices`` (*batch, V, 3), (*batch, n) of n joined meshes, or their mean or sum."""
        values = self.per_mesh(vertices)
        if self.reduction == "none":
            return values
        return values.mean() if self.reduction == "mean" else values.sum()

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

    def __setstate__(self, state: dict[str, Any]) -> None:
        super().__setstate__(state)  # type: ignore[no-untyped-call]
        self._set_topology(self.topology)  # pickles leave its tables out

    @property
    def belongs_to_mesh(self) -> bool:
        """Whether the state holds something about this one mesh, which says nothing about another."""
        return False

    def _save_to_state_dict(self, destination: Any, prefix: str, keep_vars: bool) -> None:
        super()._save_to_state_dict(destination, prefix, keep_vars)
        if self.belongs_to_mesh and hasattr(destination, "_metadata"):
            destination._metadata[prefix[:-1]][_MESH] = self.topology.fingerprint

    def _load_from_state_dict(
        self, state_dict: Any, prefix: str, local_metadata: Any, strict: bool, missing: Any, other: Any, errors: Any
    ) -> None:
        super()._load_from_state_dict(state_dict, prefix, local_metadata, strict, missing, other, errors)
        saved = local_metadata.get(_MESH)
        if self.belongs_to_mesh and saved is not None and saved != self.topology.fingerprint:
            errors.append(
                f"{prefix[:-1] or type(self).__name__}: the state was saved for a mesh of other faces than those of "
                f"{self.topology!r}, whose edges have other numbers. Make the module with the topology of that mesh."
            )

    def extra_repr(self) -> str:
        """The topology and the reduction in words."""
        reduction = "" if self.reduction == "none" else f", reduction={self.reduction!r}"
        return repr(self.topology) + reduction


class EdgeEnergy(MeshModule):
    """An energy that is a sum over interior edges, each term multiplied by the weight of its edge.

    Subclasses define :meth:`per_edge`.

    Args:
        topology: connectivity of all meshes that the module is called with.
        edge_weights: (I,) or (*batch, I) floating factors of the terms, 1 if left out. A buffer, or a parameter if it
            is an ``nn.Parameter``: moves with the module and is part of its ``state_dict``, which is refused by a
            module of another mesh.
        reduction: see :class:`MeshModule`.

    Raises:
        ShapeError: if ``edge_weights`` does not end with one number per interior edge.
    """

    edge_weights: Tensor | None

    def __init__(
        self, topology: Topology, edge_weights: Tensor | None = None, *, reduction: Reduction = "none"
    ) -> None:
        super().__init__(topology, reduction=reduction)
        check_edge_weights(edge_weights, topology)
        register(self, "edge_weights", edge_weights)

    @property
    def belongs_to_mesh(self) -> bool:
        """Whether there are weights of edges."""
        return self.edge_weights is not None

    def extra_repr(self) -> str:
        """The topology, the reduction and the weights in words."""
        return super().extra_repr() + in_words("edge_weights", self.edge_weights)

    @abstractmethod
    def per_edge(self, vertices: Tensor) -> Tensor:
        """Terms (*batch, I) of the interior edges, weights included; they sum to ``forward(vertices)``."""

    def per_mesh(self, vertices: Tensor) -> Tensor:
        """Energies (*batch,) of ``vertices`` (*batch, V, 3)."""
        return self.topology.sum_per_mesh(self.per_edge(vertices), "interior_edges")


def register(module: nn.Module, name: str, tensor: Tensor | None) -> None:
    """Keeps a tensor in a module: a parameter as a parameter, any other as a buffer, fit for training."""
    if tensor is not None and tensor.is_inference():
        tensor = tensor.clone()
    if isinstance(tensor, nn.Parameter):
        module.register_parameter(name, tensor)
    else:
        module.register_buffer(name, tensor)


def in_words(name: str, tensor: Tensor | None) -> str:
    """What a repr says about a tensor of a module, nothing if there is none."""
    if tensor is None:
        return ""
    kind = "trained " if isinstance(tensor, nn.Parameter) else ""
    return f", {kind}{name} {tuple(tensor.shape)}"


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
