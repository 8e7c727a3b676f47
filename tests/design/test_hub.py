"""One design in several windows on one loop: which engine is listened to."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path

from torchfair.design.autosave import Keeper
from torchfair.design.engine.requests import Request
from torchfair.design.engine.saying import Event, Said, Started
from torchfair.design.folder import Folder
from torchfair.design.hub import Hub
from torchfair.design.session import DesignSession


class Puppet:
    """An engine that computes nothing and says what it is told to."""

    pid = 1

    def __init__(self, said: Callable[[Event], None], lost: Callable[[], None]) -> None:
        self.said, self.lost = said, lost
        self.ended = False

    def ask(self, request: Request) -> None:
        """Nothing."""

    def end(self) -> None:
        self.ended = True


async def settle() -> None:
    for _ in range(3):
        await asyncio.sleep(0)


def test_what_an_engine_says_after_another_took_its_place_is_not_heard(tmp_path: Path) -> None:
    engines: list[Puppet] = []

    def another(said: Callable[[Event], None], lost: Callable[[], None]) -> Puppet:
        engines.append(Puppet(said, lost))
        return engines[-1]

    async def play() -> None:
        session = DesignSession(Folder(tmp_path), lambda: 0.0)
        hub = Hub(session, Keeper(tmp_path), another)
        hub.start(None)
        first = engines[0]
        first.said(Started(0))
        await settle()
        first.lost()
        await settle()
        assert len(engines) == 2
        assert first.ended
        assert hub.engine is engines[1]
        _, window = hub.enter({"type": "welcome"})
        while not window.outgoing.empty():
            window.outgoing.get_nowait()
        first.said(Said(0, "note", {"type": "note", "text": "of the first"}))
        first.lost()
        await settle()
        assert len(engines) == 2
        assert window.outgoing.empty()
        engines[1].said(Said(0, "note", {"type": "note", "text": "of the second"}))
        await settle()
        assert "of the second" in str(window.outgoing.get_nowait())
        await hub.stop()
        engines[1].lost()
        await settle()
        assert len(engines) == 2
        assert engines[1].ended

    asyncio.run(play())
