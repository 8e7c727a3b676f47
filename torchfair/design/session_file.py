"""Session files: the whole history of a design in one file of plain arrays and JSON, without code in it."""

from __future__ import annotations

import json
import math
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import MeshFileError
from .commands import COMMANDS
from .document import MODES, Document, Faces
from .stored_attributes import stored_attributes

SUFFIX = ".torchfair"
KEPT = f".autosave{SUFFIX}"
"""How names of session files end that nobody asked for."""
VERSION = 1
_LARGEST = 1 << 30
"""Bytes of all arrays together."""
_MOST = 100_000
ARRAYS = ("corners", "offsets", "start", "vertices", "principal", "names")
"""Of each document."""


@dataclass(frozen=True)
class StoredSession:
    """What a session file holds.

    Attributes:
        documents: The history, oldest first.
        now: Which of them it stands at.
        camera: As of the command ``camera``; None without.
    """

    documents: tuple[Document, ...]
    now: int
    camera: Mapping[str, Any] | None = None


def read_session(path: Path) -> StoredSession:
    """What a session file holds.

    Raises:
        MeshFileError: it cannot be read, or is none; says why.
    """
    try:
        with zipfile.ZipFile(path) as file:
            if sum(part.file_size for part in file.infolist()) > _LARGEST:
                raise MeshFileError(path, f"holds more than {_LARGEST} bytes of arrays")
            return _read(file)
    except FileNotFoundError:
        raise MeshFileError(path, "does not exist") from None
    except OSError as error:
        raise MeshFileError(path, f"cannot be read ({error.strerror or error})") from None
    except MeshFileError:
        raise
    except (zipfile.BadZipFile, zlib.error, ValueError, KeyError, TypeError, IndexError, AttributeError, EOFError,
            RecursionError, NotImplementedError, OverflowError) as error:  # fmt: skip
        raise MeshFileError(path, f"is no session file of torchfair ({error})") from None


def _read(file: zipfile.ZipFile) -> StoredSession:
    head = json.loads(file.read("design.json"))
    if head["torchfair"] != VERSION:
        raise ValueError(f"its version is {head['torchfair']!r}, this torchfair reads {VERSION}")
    known: dict[str, Any] = {}
    documents: list[Document] = []
    attributes: dict[int, Any] = {}
    if not 0 < len(head["documents"]) <= _MOST:
        raise ValueError("it holds no mesh")
    for entry in head["documents"]:
        arrays = {name: _array(file, entry[name], known) for name in ARRAYS}
        coarse = None if entry["coarse"] is None else documents[_index(entry["coarse"], len(documents))]
        document = _document(entry, arrays, coarse)
        number = entry.get("attributes")  # older files have none
        if number is not None:
            words = head["attributes"][_index(number, len(head["attributes"]))]
            if number not in attributes:
                attributes[number] = stored_attributes(
                    words, lambda name: _array(file, name, known), document.faces, document.count
                )
            document = replace(document, attributes=attributes[number])
        documents.append(document)
    history = tuple(documents[_index(number, len(documents))] for number in head["history"])
    now = _index(head["now"], len(history))
    return StoredSession(history, now, _camera(head["camera"]))


def _array(file: zipfile.ZipFile, name: Any, known: dict[str, Any]) -> Any:
    if name is None:
        return None
    if name not in known:
        with file.open(f"{name}.npy") as part:
            known[name] = np.lib.format.read_array(part, allow_pickle=False)
    return known[name]


def _document(entry: Mapping[str, Any], arrays: Mapping[str, Any], coarse: Document | None) -> Document:
    corners, offsets, start, vertices = (arrays[name] for name in ARRAYS[:4])
    count = len(start)
    if vertices.shape != (count, 3) or start.shape != (count, 3):
        raise ValueError("its places do not fit each other")
    if any(array.dtype != np.float64 or not np.isfinite(array).all() for array in (start, vertices)):
        raise ValueError("its places are not finite numbers")
    if any(array.dtype != np.int64 or array.ndim != 1 for array in (corners, offsets)):
        raise ValueError("its faces are no whole numbers")
    rising = offsets.size > 1 and offsets[0] == 0 and offsets[-1] == len(corners) and (np.diff(offsets) > 2).all()
    if not rising or corners.min() < 0 or corners.max() >= count:
        raise ValueError("its faces are no faces of its vertices")
    principal, names = arrays["principal"], arrays["names"]
    if principal is not None and (principal.dtype != np.bool_ or principal.ndim != 1):
        raise ValueError("its principal edges are no marks")
    if names is not None and (names.shape != (count,) or names.dtype != np.int64):
        raise ValueError("its numbers of vertices do not fit")
    if entry["mode"] not in MODES:
        raise ValueError(f"there is no mode {entry['mode']!r}")
    return Document(
        title=str(entry["title"]),
        mode=entry["mode"],
        faces=Faces(corners, offsets),
        start=start,
        vertices=vertices,
        coarse=coarse,
        principal=principal,
        handles={_index(v, count): (_finite(x), _finite(y), _finite(z)) for v, x, y, z in entry["handles"]},
        held=tuple(_index(vertex, count) for vertex in entry["held"]),
        weights={str(m): {str(n): _finite(w) for n, w in ws.items()} for m, ws in entry["weights"].items()},
        choices={str(m): {str(n): str(w) for n, w in ws.items()} for m, ws in entry["choices"].items()},
        names=names,
        history=tuple(dict(step) for step in entry["steps"]),
        words=str(entry["words"]),
    )


def _camera(value: Any) -> Mapping[str, Any] | None:
    camera: Mapping[str, Any] | None = None if value is None else COMMANDS["camera"]["camera"].check(value)
    return camera


def _index(value: Any, count: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < count:
        raise ValueError(f"expected a number from 0 to {count - 1}, got {value!r}")
    return value


def _finite(value: Any) -> float:
    found = float(value)
    if not math.isfinite(found):
        raise ValueError("expected finite numbers")
    return found
