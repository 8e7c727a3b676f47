"""JSON with arrays behind it, as one binary message; and frames, which are smaller still."""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

FRAME, CONTAINER = 1, 2
DRAGGING, AT_REST, JUMP = 1, 2, 4
"""Flags of a frame."""
_HEADER = struct.Struct("<BBHIIIIf")
_TYPES = {"u8": "<u1", "u32": "<u4", "i32": "<i4", "f32": "<f4", "f64": "<f8"}
_NAMES = {np.dtype(code): name for name, code in _TYPES.items()}
_STEP = 8

Array = npt.NDArray[Any]


def pack(message: Mapping[str, Any], arrays: Mapping[str, Array]) -> bytes:
    """A container: the message with its arrays, each of uint8, uint32, int32, float32 or float64."""
    flat = {name: np.ascontiguousarray(array).reshape(-1) for name, array in arrays.items()}
    head = [{"name": n, "dtype": _NAMES[a.dtype.newbyteorder("<")], "length": len(a)} for n, a in flat.items()]
    text = json.dumps({**message, "arrays": head}, allow_nan=False).encode()
    text += b" " * (-len(text) % _STEP)
    parts = [bytes([CONTAINER, 0, 0, 0]), struct.pack("<I", len(text)), text]
    for array in flat.values():
        data = array.astype(array.dtype.newbyteorder("<"), copy=False).tobytes()
        parts += [data, bytes(-len(data) % _STEP)]
    return b"".join(parts)


def unpack(data: bytes) -> tuple[dict[str, Any], dict[str, Array]]:
    """The message and the arrays of a container.

    Raises:
        ValueError: it is none; says why.
    """
    if len(data) < _STEP or data[0] != CONTAINER:
        raise ValueError("a binary message has to be a container")
    (length,) = struct.unpack_from("<I", data, 4)
    if length > len(data) - _STEP or length > 1 << 20:
        raise ValueError("a container ends in its own head")
    try:
        message = json.loads(data[_STEP : _STEP + length].decode())
        entries = message.pop("arrays")
        wanted = [(str(e["name"]), np.dtype(_TYPES[e["dtype"]]), _size(e["length"])) for e in entries]
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise ValueError("the head of a container has to be JSON with a list of arrays") from None
    arrays, place = {}, _STEP + length
    for name, dtype, size in wanted:
        end = place + size * dtype.itemsize
        if end > len(data):
            raise ValueError(f"a container ends in its array {name[:40]!r}")
        arrays[name] = np.frombuffer(data, dtype, size, place)
        place = end + -(size * dtype.itemsize) % _STEP
    return message, arrays


def _size(value: object) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise ValueError
    return value


def frame(
    positions: Array, edges: Array, scale: float, *, number: int, topology: int, flags: int, count: int = 0
) -> bytes:
    """A frame: 24 bytes, float32 positions (V, 3), one byte an edge (E,).

    Args:
        positions: Minus the origin of the topology.
        edges: uint8, in parts of ``scale`` / 255.
        scale: What 255 stands for.
        number: Of the frame.
        topology: Of the mesh that it belongs to.
        flags: :data:`DRAGGING`, :data:`AT_REST`, :data:`JUMP`.
        count: Of the newest move that it answers.
    """
    head = _HEADER.pack(FRAME, flags, count, number, topology, len(positions), len(edges), scale)
    return head + positions.astype("<f4").tobytes() + edges.astype("<u1").tobytes()
