"""A second device without a GPU: tensors that say that they are elsewhere, and keep their values here.

Inside ``with PretendedDevice():`` tensors can be made on :data:`PRETENDED` or moved there. Everything works on them,
set-up that depends on values included, and results can be compared with those of the CPU. An operation that meets a
tensor of the CPU raises, as on a GPU; also where GPUs copy it silently (indices, single numbers).

Inside ``with PretendedDevice(strict=True):`` only what runs on a GPU without the CPU waiting for it is allowed. An
operation raises that makes a tensor on the CPU, be it to copy it over, or whose result depends on values: ``item``,
``nonzero``, boolean masks as indices. Operators of torchfair itself may do inside what they like. Where it is not
strict, the device counts such operations instead.

Torch's own fake tensors carry no values, so they come to an end in such set-up, and where torch is built without CUDA
they cannot be differentiated on a GPU that is not there.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack
from typing import Any

import torch
from torch import Tensor
from torch.overrides import TorchFunctionMode
from torch.utils._python_dispatch import TorchDispatchMode

PRETENDED = torch.device("lazy", 0)
"""A device that every build of torch knows by name and differentiates in the calling thread; nobody else uses it."""

_aten = torch.ops.aten
_MOVES = {_aten._to_copy.default, _aten.copy_.default}
_BY_VALUE = {torch.Tag.data_dependent_output, torch.Tag.dynamic_output_shape}
_INDEXED = {_aten.index.Tensor, _aten.index_put_.default, _aten.index_put.default, _aten._index_put_impl_.default}


class PretendedTensor(Tensor):
    """A tensor on :data:`PRETENDED`.

    Attributes:
        here: The same on the CPU.
    """

    here: Tensor

    @staticmethod
    def __new__(cls, here: Tensor) -> PretendedTensor:
        details: dict[str, Any] = {"dtype": here.dtype, "device": PRETENDED}
        if here.layout == torch.strided:
            details.update(strides=here.stride(), storage_offset=here.storage_offset())
        else:
            details.update(layout=here.layout)
        made = Tensor._make_wrapper_subclass(cls, here.shape, **details)
        made.here = here
        return made

    def tolist(self) -> Any:
        return self.cpu().tolist()

    def __repr__(self) -> str:
        return f"pretended {self.here!r}"

    @classmethod
    def __torch_dispatch__(cls, operation: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        return _run(operation, args, kwargs or {}, PretendedDevice())


class PretendedDevice(TorchDispatchMode):
    """See above. May be nested: operations are those of the innermost.

    Attributes:
        strict: Whether operations are refused that make the CPU wait.
        waits: Those that did, in order, operators of torchfair among them.
    """

    def __init__(self, *, strict: bool = False) -> None:
        super().__init__()
        self.strict = strict
        self.waits: list[str] = []
        self._entered: list[ExitStack] = []

    def __enter__(self) -> PretendedDevice:
        stack = ExitStack()
        stack.callback(torch._C._set_only_lift_cpu_tensors, torch._C._only_lift_cpu_tensors())
        torch._C._set_only_lift_cpu_tensors(True)  # torch.tensor(...) asks before it copies to another device
        stack.enter_context(_NewTensors())
        self._entered.append(stack)
        super().__enter__()
        return self

    def __exit__(self, *error: object) -> None:
        super().__exit__(*error)
        self._entered.pop().close()

    def __torch_dispatch__(self, operation: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        return _run(operation, args, kwargs or {}, self)


class _NewTensors(TorchFunctionMode):
    """``x.new_tensor(...)``, which does not find the device of ``x`` inside torch.func."""

    def __torch_function__(self, function: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        if function is Tensor.new_tensor:
            like, data = args
            return torch.tensor(data, **{"dtype": like.dtype, "device": like.device, **(kwargs or {})})
        return function(*args, **(kwargs or {}))


def _run(operation: Any, args: Any, kwargs: Any, device: PretendedDevice) -> Any:
    tensors = [*_tensors(args), *_tensors(kwargs.values())]
    there = [tensor for tensor in tensors if isinstance(tensor, PretendedTensor)]
    if operation is torch.ops.prim.device.default:
        return PRETENDED if there else operation(*args)
    asked = kwargs.get("device")
    target = torch.device(asked) if asked is not None else PRETENDED if there else torch.device("cpu")
    goes_there = target.type == PRETENDED.type
    if len({type(tensor) is PretendedTensor for tensor in tensors}) > 1 and operation not in _MOVES:
        raise RuntimeError(f"{operation}: tensors on two devices, {_shapes(tensors)}")
    stays = goes_there and len(there) == len(tensors)
    if not stays or _depends_on_values(operation, args):
        if device.strict:
            reason = "waits for values" if stays else "a tensor on the CPU"
            raise RuntimeError(f"{operation}: {reason}, {_shapes(tensors)}")
        if there or goes_there:
            device.waits.append(str(operation))
    if operation.namespace not in ("aten", "prim"):  # with a kernel in Python, which may do what it likes
        device.waits.append(str(operation))
        with PretendedDevice(), torch._C.DisableTorchFunction():
            return operation._op_dk(torch._C.DispatchKey.CompositeExplicitAutograd, *args, **kwargs)
    if torch._C._dispatch_has_kernel_for_dispatch_key(operation.name(), "CompositeImplicitAutograd"):
        with device, torch._C.DisableTorchFunction():  # in such kernels they come as a whole
            return operation.decompose(*args, **kwargs)
    if asked is not None and goes_there:
        kwargs = {**kwargs, "device": torch.device("cpu")}
    if operation is _aten._to_copy.default and len(there) == len(tensors) == 1 and not goes_there:
        return operation(args[0].here, **kwargs)
    result = operation(*_mapped(_here, args), **{name: _mapped(_here, value) for name, value in kwargs.items()})
    if operation._schema.is_mutable:
        return _written(operation, args, kwargs)
    return _mapped(_there, result) if goes_there else result


def _depends_on_values(operation: Any, args: Any) -> bool:
    if operation in _INDEXED:
        return any(index is not None and index.dtype in (torch.bool, torch.uint8) for index in args[1])
    return bool(_BY_VALUE & set(operation.tags))


def _written(operation: Any, args: Any, kwargs: Any) -> Any:
    """The arguments that an operation has written to, which are what it returns."""
    schema = operation._schema
    written = [
        args[number] if number < len(args) else kwargs.get(argument.name)
        for number, argument in enumerate(schema.arguments)
        if argument.alias_info is not None and argument.alias_info.is_write
    ]
    if not schema.returns:
        return None
    return written[0] if len(schema.returns) == 1 else tuple(written)


def _tensors(values: Iterable[Any]) -> Iterator[Tensor]:
    for value in values:
        if isinstance(value, Tensor):
            yield value
        elif isinstance(value, (list, tuple)):
            yield from _tensors(value)


def _mapped(function: Callable[[Any], Any], value: Any) -> Any:
    return type(value)([_mapped(function, v) for v in value]) if type(value) in (list, tuple) else function(value)


def _here(value: Any) -> Any:
    return value.here if isinstance(value, PretendedTensor) else value


def _there(value: Any) -> Any:
    return PretendedTensor(value) if type(value) is Tensor else value


def _shapes(tensors: list[Tensor]) -> str:
    return ", ".join(f"{tuple(tensor.shape)} {tensor.dtype} on {tensor.device}" for tensor in tensors)
