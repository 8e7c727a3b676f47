"""The mesh that is on the screen: its live session, step by step, from one document to the next."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import torch
from torch import Tensor

from ...errors import TorchfairError
from ...formfinding import Session
from ...topology import Topology
from ..document import Document, Floats, Place
from .coarse import coarse_answer
from .measures import Deviation
from .recipes import AnyRecipe, put, same_job, session_of, tensor_of, topology_of
from .sliders import weight_range

_COARSE_FROM = 8000
"""Vertices: of larger meshes a step takes half a second and more."""
_CALM = 0.03
"""Mean edges: after a step that moves no vertex farther than this, the mesh waits for the next move of the mouse."""


class Stepped(NamedTuple):
    """What a live step did.

    Attributes:
        moved: Whether the mesh has moved.
        goes_on: Whether there is a reason for another one.
    """

    moved: bool
    goes_on: bool


class Follower:
    """One document, followed.

    Args:
        document: Where it begins.

    Raises:
        TorchfairError: the document cannot be followed, with the reason.

    Attributes:
        document: The last one that was taken; its places are exact as long as nothing has moved since.
        topology: Its connectivity.
        session: What follows.
        number: Number of the topology in messages.
        status: What the session does, in a sentence.
        is_at_rest: Whether nothing moves, and nothing is about to.
    """

    def __init__(self, document: Document, number: int) -> None:
        self.document, self.number = document, number
        self.topology: Topology = topology_of(document)
        self.session: Session[AnyRecipe] = session_of(document)
        self._moved = False
        self._deviation: Deviation | None = None
        self._before: dict[str, float] | None = None
        self.status, self.is_at_rest = "at rest", True

    @property
    def vertices(self) -> Tensor:
        """(V, 3) where the mesh is; to the bit as in the document where nothing has moved."""
        if self._moved:
            return self.session.vertices
        return tensor_of(self.document.vertices)

    @property
    def places(self) -> Floats:
        """The same as an array."""
        result: Floats = self.vertices.numpy().copy()
        return result

    def taking(self, document: Document, number: int) -> Follower:
        """A follower of another document: this one where the session can go on, else a new one."""
        if not same_job(self.document, document):
            return Follower(document, number if not self.document.same_mesh(document) else self.number)
        put(self.session, document)
        same = self.document.same_mesh(document)
        self.document, self._moved = document, False
        self.number = self.number if same else number
        self.status, self.is_at_rest = "at rest", True
        return self

    # ---- moving ----------------------------------------------------------------------------------------

    def drag(self, places: Mapping[int, Place], weights: Mapping[str, float]) -> None:
        """Handles and weights from now on.

        Raises:
            TorchfairError: a handle cannot be pulled, or a weight is none.
        """
        document = self.document.moved(places) if places else self.document
        if weights:
            for name, value in weights.items():
                _, least, most = weight_range(document.mode, name)
                if not least <= value <= most:
                    raise TorchfairError(f"the weight {name} goes from {least:g} to {most:g}, got {value:g}")
            document = document.weighing(weights)
            self.session.weigh(**weights)
        if places:
            self.session.move(places)
        self.document = replace(document, vertices=self.document.vertices)

    def coarse(self) -> Tensor | None:
        """(V, 3) what a large mesh shows before its step: humps around handles; None for others, or where none is away.

        The mesh of the session is not touched.
        """
        pulled = self.document.handles
        if self.document.count < _COARSE_FROM or not pulled:
            return None
        recipe, now, handles = self.session.recipe, self.vertices, torch.tensor(list(pulled))
        places = torch.tensor(list(pulled.values()), dtype=now.dtype)
        if float(torch.linalg.vector_norm(places - now[handles], dim=1).max()) <= _CALM * recipe.unit.length:
            return None
        return coarse_answer(now, self.topology, handles, places, recipe.stays() | recipe.pulls.held)

    def step(self) -> Stepped:
        """One live step.

        Steps could go on lowering the merit for long after handles have been reached; :meth:`settle` does that at once.
        """
        self.is_at_rest = False
        before, progress = self.session.vertices, self.session.step()
        handles = len(self.document.handles)
        self.status = progress.reason or f"follows {handles} handle{'s' * (handles != 1)}"
        if not progress.accepted:
            return Stepped(False, False)
        self._moved = True
        way = float(torch.linalg.vector_norm(self.session.vertices - before, dim=1).max())
        return Stepped(True, way > _CALM * self.session.recipe.unit.length)

    def settle(self, *, whole: bool, stop: Callable[[], bool], watch: Callable[[Tensor], None]) -> bool:
        """To rest, or the whole job; whether it was stopped."""
        session = self.session
        session.callback, session.watch = lambda record: stop(), watch
        self.is_at_rest = False
        try:
            stopped = session.solve() if whole else session.settle()
        finally:
            session.callback = session.watch = None
        self._moved = self.is_at_rest = True
        last = session.runs[-1] if session.runs else None
        self.status = "at rest" if last is None else ("stopped" if stopped else last.message)
        return stopped

    # ---- measuring -------------------------------------------------------------------------------------

    @property
    def deviation(self) -> Deviation:
        """Distances from the surface on which the job started."""
        if self._deviation is None:
            *_, root = self.document.levels()
            topology = self.topology if root is self.document else topology_of(root)
            self._deviation = Deviation(tensor_of(root.start), topology)
        return self._deviation

    def promises(self) -> list[dict[str, Any]]:
        """What the job promises, and whether it holds now."""
        recipe = self.session.recipe
        if self._before is None:
            self._before = recipe.before()
        after = recipe.measures(self.vertices)
        return [{"words": str(promise), "holds": promise.holds} for promise in recipe.promises(self._before, after)]

    @property
    def notes(self) -> tuple[str, ...]:
        """What the job has decided, in sentences."""
        return tuple(dict.fromkeys(self.session.recipe.notes))
