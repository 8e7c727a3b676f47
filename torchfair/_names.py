"""What vertices and faces are called in sentences: by their numbers from 0, or by those of the file they are from."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from .errors import MeshError

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    Ints = npt.NDArray[np.int64]
else:
    Ints = Any  # the command line has words for vertices before it needs NumPy

Part = str | tuple[str, int]
"""Of a sentence: words, or ("vertex", number) or ("face", number)."""

_SHOWN = 5


@dataclass(frozen=True, eq=False)
class Names:
    """How vertices and faces are counted.

    Attributes:
        first: Number of the first vertex and of the first face.
        vertices: (V,) where each vertex stands among those that are counted; None for the same order.
        faces: (F,) the same of each face.
        face_lines: Line in a file of each face that is counted; None where there are none.
    """

    first: int = 0
    vertices: Ints | None = None
    faces: Ints | None = None
    face_lines: Ints | None = None

    def vertex(self, number: int) -> str:
        """What a vertex is called."""
        return str(self.first + (number if self.vertices is None else int(self.vertices[number])))

    def face(self, number: int) -> str:
        """What a face is called, with its line."""
        line = self.line(number)
        return f"{self.first + self._row(number)}" + ("" if line is None else f" (line {line})")

    def line(self, number: int) -> int | None:
        """Where a face stands in its file."""
        return None if self.face_lines is None else int(self.face_lines[self._row(number)])

    def _row(self, face: int) -> int:
        return face if self.faces is None else int(self.faces[face])


FROM_ZERO = Names()


@dataclass(frozen=True)
class Sentence:
    """Words with numbers of vertices and faces among them.

    Attributes:
        parts: Words, ("vertex", number) or ("face", number), from 0.
    """

    parts: tuple[Part, ...]

    def told(self, names: Names = FROM_ZERO) -> str:
        """As text, with everything called by its name."""
        return "".join(part if isinstance(part, str) else getattr(names, part[0])(part[1]) for part in self.parts)

    @property
    def face(self) -> int | None:
        """The first face that it names."""
        return next((part[1] for part in self.parts if not isinstance(part, str) and part[0] == "face"), None)


def sentence(*parts: Part | Iterable[Part]) -> Sentence:
    """A sentence of parts, and of lists of them."""
    flat: list[Part] = []
    for part in parts:
        if isinstance(part, str) or (isinstance(part, tuple) and len(part) == 2 and isinstance(part[1], int)):
            flat.append(part)
        else:
            flat.extend(part)
    return Sentence(tuple(flat))


class PlacedError(MeshError):
    """A fault of a mesh at certain vertices and faces.

    Attributes:
        sentence: What is wrong, and where.
    """

    def __init__(self, *parts: Part | Iterable[Part]) -> None:
        self.sentence = sentence(*parts)
        super().__init__(self.sentence.told())


def first_few(items: Iterable[object], total: int) -> str:
    """The first few items as text, followed by how many were left out."""
    shown = [str(item) for item, _ in zip(items, range(_SHOWN), strict=False)]
    return ", ".join(shown) + _more(total - len(shown))


def few(kind: str, numbers: Sequence[int] | Ints) -> list[Part]:
    """The first few vertices or faces, followed by how many were left out."""
    shown: list[Part] = []
    for number in numbers[:_SHOWN]:
        shown += [", ", (kind, int(number))]
    return [*shown[1:], _more(len(numbers) - _SHOWN)]


def few_groups(groups: Iterable[Sequence[Any]], total: int) -> list[Part]:
    """The first few of things that are told in parts, followed by how many were left out."""
    shown: list[Part] = []
    for group, _ in zip(groups, range(_SHOWN), strict=False):
        shown += [", ", *group]
    return [*shown[1:], _more(total - _SHOWN)]


def _more(count: int) -> str:
    return f" and {count} more" if count > 0 else ""
