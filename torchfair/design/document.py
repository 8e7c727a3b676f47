"""What undo goes back to and files hold: a mesh, what is asked of it, and where it comes from."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from ..io.written_back import Attributes

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]
Place = tuple[float, float, float]

MODES = ("fair", "form", "symmetric")


@dataclass(frozen=True, eq=False)
class Faces:
    """Polygons: face f has ``corners[offsets[f]:offsets[f + 1]]``.

    Attributes:
        corners: (H,) vertices.
        offsets: (F+1,).
    """

    corners: Ints
    offsets: Ints

    def same(self, other: Faces) -> bool:
        """Whether the polygons are the same ones in the same order."""
        if self is other:
            return True
        return np.array_equal(self.offsets, other.offsets) and np.array_equal(self.corners, other.corners)


@dataclass(frozen=True, eq=False)
class Document:
    """A mesh as it stands, frozen; positions in the unit of the input.

    Attributes:
        title: What it is called.
        mode: fair, form or symmetric.
        faces: The polygons.
        start: (V, 3) where the job of the mode starts; that it stays close to in the mode fair.
        vertices: (V, 3) as it is.
        coarse: The mesh that this one is a refinement of, in the same job; None for the first level.
        principal: (E,) bool, the principal edges in the numbers of the topology; None where nobody has asked.
        handles: Where vertices are pulled.
        held: Vertices that are fixed.
        weights: Those that were changed, by mode and name.
        choices: Likewise, words.
        names: (V,) number of each vertex in the file; None for the same numbers, or where there is no file.
        history: Commands that lead here but for those of the job itself, for the command line.
        attributes: Groups, materials, layers and the like of the file, for these faces; they are written back.
        words: What was done last, for undo.
    """

    title: str
    mode: str
    faces: Faces
    start: Floats
    vertices: Floats
    coarse: Document | None = None
    principal: Bools | None = None
    handles: Mapping[int, Place] = field(default_factory=dict)
    held: tuple[int, ...] = ()
    weights: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    choices: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    names: Ints | None = None
    history: tuple[Mapping[str, Any], ...] = ()
    attributes: Attributes | None = None
    words: str = "open"

    @property
    def count(self) -> int:
        """V."""
        return len(self.vertices)

    @property
    def origin(self) -> Floats:
        """Middle of the box around where the job starts; frames are relative to it."""
        middle: Floats = 0.5 * (self.start.min(0) + self.start.max(0))
        return middle

    def levels(self) -> Iterator[Document]:
        """This mesh, the one that it refines, and so on."""
        level: Document | None = self
        while level is not None:
            yield level
            level = level.coarse

    def moved(self, places: Mapping[int, Place]) -> Document:
        """With handles at other places."""
        held = tuple(vertex for vertex in self.held if vertex not in places)
        return replace(self, handles={**self.handles, **places}, held=held)

    def holding(self, vertices: tuple[int, ...]) -> Document:
        """With more vertices fixed, where they are."""
        handles = {vertex: place for vertex, place in self.handles.items() if vertex not in vertices}
        return replace(self, handles=handles, held=tuple(sorted({*self.held, *vertices})))

    def freeing(self, vertices: tuple[int, ...]) -> Document:
        """With handles and fixed vertices let go."""
        gone = set(vertices)
        handles = {vertex: place for vertex, place in self.handles.items() if vertex not in gone}
        return replace(self, handles=handles, held=tuple(vertex for vertex in self.held if vertex not in gone))

    def weighing(self, weights: Mapping[str, float]) -> Document:
        """With other weights in its mode."""
        return replace(self, weights={**self.weights, self.mode: {**self.weights.get(self.mode, {}), **weights}})

    def choosing(self, choices: Mapping[str, str]) -> Document:
        """With other choices in its mode."""
        return replace(self, choices={**self.choices, self.mode: {**self.choices.get(self.mode, {}), **choices}})

    def in_mode(self, mode: str) -> Document:
        """In another mode, which starts from where the mesh is."""
        return replace(self, mode=mode, start=self.vertices, coarse=None)

    def same_mesh(self, other: Document) -> bool:
        """Whether frames of one fit the topology of the other, labels included."""
        if (self.principal is None) != (other.principal is None) or not self.faces.same(other.faces):
            return False
        same = self.principal is None or np.array_equal(self.principal, other.principal)  # type: ignore[arg-type]
        return same and np.array_equal(self.start, other.start)
