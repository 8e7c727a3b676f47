"""Groups, materials, layers and the like in session files, as words and arrays."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .document import Faces

if TYPE_CHECKING:
    from ..io.written_back import Attributes

_TEXTURE = (b"vt",)


def attribute_words(attributes: Attributes, stored: Callable[[Any], str | None]) -> dict[str, Any]:
    """What JSON holds of them; ``stored`` puts an array into the file, and names it."""
    from ..io import RhinoParts  # here, since the server does not wait for torch

    if isinstance(attributes, RhinoParts):
        return {"unit": attributes.unit, "objects": list(map(list, attributes.objects)),
                "owners": stored(attributes.owners)}  # fmt: skip
    return {
        "folder": str(attributes.folder),
        "statements": [[place, _text(line)] for place, line in attributes.statements],
        "behind": list(map(_text, attributes.behind)),
        "textures": list(map(_text, attributes.textures)),
        "corner_textures": stored(attributes.corner_textures),
        "dropped": {_text(keyword): count for keyword, count in attributes.dropped.items()},
    }


def stored_attributes(
    words: Mapping[str, Any], array: Callable[[Any], np.ndarray], faces: Faces, vertices: int
) -> Attributes:
    """The attributes again.

    Raises:
        ValueError: they are none of a mesh with these faces and so many vertices, or hold other lines than those of
            attributes.
    """
    from ..io import ObjAttributes, RhinoParts
    from ..io.obj_attributes import KEPT

    count = len(faces.offsets) - 1
    if "unit" in words:
        objects = tuple((str(name), str(layer)) for name, layer in words["objects"])
        owners = _whole(array(words["owners"]), (count,), 0, len(objects))
        if not str(words["unit"]).isidentifier():
            raise ValueError("its unit is none")
        return RhinoParts(str(words["unit"]), objects, owners)
    textures = _lines(words["textures"], _TEXTURE)
    corners = array(words["corner_textures"])
    behind = _lines(words["behind"])
    if len(behind) not in (0, vertices):
        raise ValueError("what stands behind its vertices does not fit them")
    places = [int(place) for place, _ in words["statements"]]
    if places != sorted(places) or (places and not 0 <= places[0] <= places[-1] <= count):
        raise ValueError("its groups are not those of its faces")
    return ObjAttributes(
        Path(str(words["folder"])),
        tuple(zip(places, _lines([line for _, line in words["statements"]], KEPT), strict=True)),
        behind,
        textures,
        _whole(corners, (len(faces.corners) if len(textures) else 0,), -1, len(textures)),
        {_bytes(keyword): int(number) for keyword, number in words["dropped"].items()},
    )


def _lines(texts: Sequence[Any], keywords: Sequence[bytes] = ()) -> tuple[bytes, ...]:
    lines = tuple(map(_bytes, texts))
    for line in lines:
        first = (line.split() or [b""])[0]
        if b"\n" in line or b"\r" in line or (keywords and first not in keywords):
            raise ValueError(f"it holds a line that is none of attributes: {line[:40]!r}")
    return lines


def _whole(array: np.ndarray, shape: tuple[int, ...], least: int, beyond: int) -> np.ndarray:
    if array.shape != shape or array.dtype != np.int64 or (array.size and not least <= array.min()):
        raise ValueError("its attributes do not fit its faces")
    if array.size and array.max() >= beyond:
        raise ValueError("its attributes do not fit its faces")
    return array


def _text(line: bytes) -> str:
    return line.decode("latin-1")


def _bytes(text: Any) -> bytes:
    return str(text).encode("latin-1")
