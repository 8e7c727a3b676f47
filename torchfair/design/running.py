"""A server that runs: in the foreground for the command, in a thread for notebooks and tests."""

from __future__ import annotations

import asyncio
import importlib.util
import threading
from collections.abc import Awaitable, Callable, Coroutine
from typing import TYPE_CHECKING, Any, TypeVar

from ..errors import TorchfairError

if TYPE_CHECKING:
    from .engine.requests import Open
    from .hub import MakeEngine
    from .server import DesignServer, ServerSettings

T = TypeVar("T")


def require_websockets() -> None:
    """Raises TorchfairError where the page cannot be served."""
    if importlib.util.find_spec("websockets") is None:
        raise TorchfairError(
            "the page is served by websockets, which is not installed: pip install 'torchfair[design]'"
        )


async def serve(server: DesignServer, ready: Callable[[DesignServer], Awaitable[None] | None]) -> None:
    """Runs a server until it is cancelled; ``ready`` is called once it listens."""
    await server.start()
    try:
        done = ready(server)
        if done is not None:
            await done
        await server.wait()
    finally:
        await server.stop()


class BackgroundServer:
    """A server in a thread.

    Args:
        settings: How it is reached.
        opening: What is opened first.
        make_engine: By default a child process.

    Example::

        with BackgroundServer(ServerSettings(), Open(0, "example:roof")) as server:
            print(server.url)
    """

    def __init__(
        self, settings: ServerSettings, opening: Open | None = None, make_engine: MakeEngine | None = None
    ) -> None:
        require_websockets()
        from .server import DesignServer

        self.server = DesignServer(settings, opening, make_engine)
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True, name="torchfair-design")
        self._thread.start()
        try:
            self.call(self.server.start())
        except BaseException:
            self._end()
            raise

    @property
    def url(self) -> str:
        """Address of the page, with its token."""
        return self.server.url

    def call(self, work: Coroutine[Any, Any, T], timeout: float = 60.0) -> T:
        """The value of something that runs on the server's loop."""
        return asyncio.run_coroutine_threadsafe(work, self._loop).result(timeout)

    def stop(self) -> None:
        """Ends server and engine; a second time does nothing."""
        if self._loop.is_running():
            self.call(self.server.stop())
            self._end()

    def _end(self) -> None:
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(5.0)
        self._loop.close()

    def __enter__(self) -> BackgroundServer:
        return self

    def __exit__(self, *error: object) -> None:
        self.stop()
