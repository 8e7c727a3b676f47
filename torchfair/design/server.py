"""The server: files of the page, and the sockets of its windows."""

from __future__ import annotations

import asyncio
import http
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from websockets.asyncio.server import Server, ServerConnection, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from .access import LOOPBACK, Access, new_token
from .autosave import Keeper
from .commands import MOST_JSON, PROTOCOL, CommandRefused, read_command
from .engine import process
from .engine.requests import Open
from .folder import OPENS, Folder
from .formats import formats_message
from .hub import Hub, MakeEngine, Window
from .limits import MOST_UPLOAD, MOST_VERTICES
from .session import DesignSession
from .static import PAGE, headers, is_socket, page_at, pages

_HELLO = 10.0  # seconds in which a window has to say its token
_MOST_BEFORE = 4096  # characters of its first message
_MOST_WINDOWS = 32
_ANYWHERE = ("", "0.0.0.0", "::")


@dataclass(frozen=True)
class ServerSettings:
    """How a server is reached.

    Attributes:
        folder: Where files are.
        host: Address to listen on.
        port: 0 for any that is free.
        names: Names of hosts under which it is reached, besides those of this machine.
        framed: Who may show the page in a frame.
        upload_bytes: Largest upload.
        token: That windows have to say; a new one by default.
        page: Folder of the page.
    """

    folder: Path = field(default_factory=Path.cwd)
    host: str = "127.0.0.1"
    port: int = 0
    names: Sequence[str] = ()
    framed: Sequence[str] = ()
    upload_bytes: int = MOST_UPLOAD
    token: str = field(default_factory=new_token)
    page: Path = PAGE


class DesignServer:
    """Serves one design.

    Args:
        settings: How it is reached.
        opening: What is opened first.
        make_engine: By default a child process.

    Attributes:
        hub: Windows, design and engine.
    """

    def __init__(
        self, settings: ServerSettings, opening: Open | None = None, make_engine: MakeEngine | None = None
    ) -> None:
        self._settings, self._opening = settings, opening
        self._access = Access(settings.token, [*LOOPBACK, *settings.names])
        self._pages = pages(settings.page)
        self._folder = Folder(settings.folder)
        session = DesignSession(self._folder, time.monotonic, settings.upload_bytes)
        self.hub = Hub(session, Keeper(self._folder.path), make_engine or process.EngineProcess)
        self._server: Server | None = None

    @property
    def session(self) -> DesignSession:
        """The design."""
        return self.hub.session

    # ---- running ---------------------------------------------------------------------------------------

    async def start(self) -> None:
        """Listens, and starts the engine."""
        settings = self._settings
        self._server = await serve(
            self._serve_window,
            settings.host,
            settings.port,
            process_request=self._answer,
            max_size=settings.upload_bytes + MOST_JSON,
            compression=None,
            server_header=None,
        )
        self.hub.start(self._opening)

    async def wait(self) -> None:
        """Until the server is stopped."""
        assert self._server is not None
        await self._server.wait_closed()

    async def stop(self) -> None:
        """Ends windows and engine; what was not saved has been kept."""
        if self._server is not None:
            self._server.close()
            await self._server.wait_closed()
        await self.hub.stop()

    @property
    def port(self) -> int:
        """On which it listens."""
        assert self._server is not None
        return int(next(iter(self._server.sockets)).getsockname()[1])

    @property
    def token(self) -> str:
        """That windows have to say."""
        return self._settings.token

    @property
    def url(self) -> str:
        """Address of the page, with its token."""
        host = self._settings.host
        name = "127.0.0.1" if host in _ANYWHERE else f"[{host}]" if ":" in host else host
        return f"http://{name}:{self.port}/#token={self.token}"

    # ---- requests --------------------------------------------------------------------------------------

    def _answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """A file of the page, a refusal, or None for the socket."""
        if not self._access.host_is_right(_only(request, "Host")):
            return self._response(http.HTTPStatus.MISDIRECTED_REQUEST, "this server has another name")
        if is_socket(request.path):
            if not self._access.origin_is_right(_only(request, "Origin")):
                return self._response(http.HTTPStatus.FORBIDDEN, "pages of elsewhere are not let in")
            return None
        page = page_at(request.path, self._pages)
        if page is None:
            return self._response(http.HTTPStatus.NOT_FOUND, "there is no such page")
        return self._response(http.HTTPStatus.OK, page.content, page.media)

    def _response(self, status: http.HTTPStatus, content: str | bytes, media: str = "text/plain") -> Response:
        body = content.encode() if isinstance(content, str) else content
        found = Headers(headers(media, framed=self._settings.framed))
        found["Content-Length"] = str(len(body))
        found["Connection"] = "close"
        return Response(status.value, status.phrase, found, body)

    # ---- windows ---------------------------------------------------------------------------------------

    async def _serve_window(self, connection: ServerConnection) -> None:
        refused = await self._greeted(connection)
        if refused is not None:
            await connection.close(*refused)
            return
        number, window = self.hub.enter(self._welcome())
        sender = asyncio.create_task(_send(connection, window))
        try:
            async for message in connection:
                self.hub.hear(number, message)
        except ConnectionClosed:
            pass
        finally:
            sender.cancel()
            self.hub.leave(number)

    async def _greeted(self, connection: ServerConnection) -> tuple[int, str] | None:
        """Why a window is not let in: code and reason; None where it is."""
        try:
            message = await asyncio.wait_for(connection.recv(), _HELLO)
        except TimeoutError:
            return 4408, "no hello"
        except ConnectionClosed:
            return 1000, ""
        if not isinstance(message, str) or len(message) > _MOST_BEFORE:
            return 4401, "hello with the token comes first"
        try:
            hello = read_command(message)
        except CommandRefused:
            return 4401, "hello with the token comes first"
        if hello.type != "hello" or not self._access.token_is_right(hello["token"]):
            return 4401, "wrong token"
        if hello["protocol"] != PROTOCOL:
            return 4409, f"this server speaks version {PROTOCOL}"
        return (1013, "too many windows") if self.hub.num_windows >= _MOST_WINDOWS else None

    def _welcome(self) -> dict[str, Any]:
        from .. import __version__

        return {
            "type": "welcome",
            "protocol": PROTOCOL,
            "version": __version__,
            "folder": self._folder.path.name,
            "open": list(OPENS),
            "save": formats_message(),
            "limits": {"upload_bytes": self._settings.upload_bytes, "vertices": MOST_VERTICES},
        }


def _only(request: Request, name: str) -> str | None:
    """The one header of that name; what has several is taken for wrong."""
    found = request.headers.get_all(name)
    return found[0] if len(found) == 1 else None if not found else " ".join(found)


async def _send(connection: ServerConnection, window: Window) -> None:
    """Sends what is put in line for a window, one after the other."""
    try:
        while True:
            await connection.send(await window.outgoing.get())
    except ConnectionClosed:
        return
