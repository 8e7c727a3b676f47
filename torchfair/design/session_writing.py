"""Session files, written: documents as JSON that names its arrays, each array once."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .document import Document
from .session_file import ARRAYS, VERSION
from .stored_attributes import attribute_words


def session_bytes(documents: Sequence[Document], now: int, camera: Mapping[str, Any] | None = None) -> bytes:
    """The content of a session file; arrays that several documents share are stored once."""
    parts = _Parts()
    history = [parts.entry(document) for document in documents]
    head = {"torchfair": VERSION, "history": history, "now": now, "camera": camera, "attributes": parts.attributes,
            "documents": parts.entries}  # fmt: skip
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as file:
        file.writestr("design.json", json.dumps(head, allow_nan=False))
        for name, array in parts.arrays.items():
            with file.open(f"{name}.npy", "w") as part:
                np.lib.format.write_array(part, np.ascontiguousarray(array), allow_pickle=False)
    return buffer.getvalue()


class _Parts:
    """What documents are made of, each object once.

    Attributes:
        arrays: By the names that entries use.
        attributes: Words of what came with the mesh file.
        entries: Words of documents; finer ones name theirs by number.
    """

    def __init__(self) -> None:
        self.arrays: dict[str, Any] = {}
        self.attributes: list[dict[str, Any]] = []
        self.entries: list[dict[str, Any]] = []
        self._names: dict[int, str] = {}  # by identity, as the others; all objects are held by the documents
        self._attribute_numbers: dict[int, int] = {}
        self._numbers: dict[int, int] = {}

    def entry(self, document: Document) -> int:
        """Number of a document, behind that of its coarse one."""
        if id(document) not in self._numbers:
            words = _words(document) | {
                "coarse": None if document.coarse is None else self.entry(document.coarse),
                "attributes": self._attributes_of(document),
                "corners": self._name_of(document.faces.corners),
                "offsets": self._name_of(document.faces.offsets),
                **{name: self._name_of(getattr(document, name)) for name in ARRAYS[2:]},
            }
            self._numbers[id(document)] = len(self.entries)
            self.entries.append(words)
        return self._numbers[id(document)]

    def _attributes_of(self, document: Document) -> int | None:
        found = document.attributes
        if found is None:
            return None
        if id(found) not in self._attribute_numbers:
            self._attribute_numbers[id(found)] = len(self.attributes)
            self.attributes.append(attribute_words(found, self._name_of))
        return self._attribute_numbers[id(found)]

    def _name_of(self, array: Any) -> str | None:
        if array is None:
            return None
        if id(array) not in self._names:
            name = self._names[id(array)] = f"array{len(self.arrays)}"
            self.arrays[name] = array
        return self._names[id(array)]


def _words(document: Document) -> dict[str, Any]:
    return {
        "title": document.title,
        "mode": document.mode,
        "handles": [[vertex, *place] for vertex, place in document.handles.items()],
        "held": list(document.held),
        "weights": document.weights,
        "choices": document.choices,
        "steps": list(document.history),
        "words": document.words,
    }
