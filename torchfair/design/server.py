"""The server: files of the page, sockets of its windows, and the engine; on one event loop."""

from __future__ import annotations

import asyncio
import http
import json
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from websockets.asyncio.server import Server, ServerConnection, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from ..errors import TorchfairError
from .access import LOOPBACK, Access, new_token
from .autosave import Keeper
from .commands import MOST_JSON, PROTOCOL, Command, CommandRefused, read_command
from .containers import frame, pack, unpack
from .effects import Ask, Autosave, Deliver, Draw, Effect, StartEngine, Store, Tell, Wake
from .engine.process import EngineProcess
from .engine.requests import Event, Open, Shown
from .folder import OPENS, Folder
from .formats import FORMATS, formats_message
from .session import DesignSession
from .static import headers, is_socket, page_at, pages
from .telling import error_message
from .windows import FrameGate

_HELLO = 10.0  # seconds in which a window has to say its token
_MOST_BEFORE = 4096  # characters of its first message
_MOST_WINDOWS = 32


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
    """

    folder: Path = field(default_factory=Path.cwd)
    host: str = "127.0.0.1"
    port: int = 0
    names: Sequence[str] = ()
    framed: Sequence[str] = ()
    upload_bytes: int = 128 << 20
    token: str = field(default_factory=new_token)


class DesignServer:
    """One design in any number of windows.

    Args:
        settings: How it is reached.
        opening: What is opened first.

    Attributes:
        session: The design.
    """

    def __init__(self, settings: ServerSettings, opening: Open | None = None) -> None:
        self._settings, self._opening = settings, opening
        self._access = Access(settings.token, [*LOOPBACK, *settings.names])
        self._pages = pages()
        self._folder = Folder(settings.folder)
        self.session = DesignSession(self._folder, time.monotonic, settings.upload_bytes)
        self._keeper = Keeper(self._folder.path)
        self._engine: EngineProcess | None = None
        self._windows: dict[int, tuple[ServerConnection, FrameGate]] = {}
        self._outgoing: dict[int, asyncio.Queue[str | bytes]] = {}
        self._opened = 0
        self._server: Server | None = None
        self._tasks: set[asyncio.Task[None]] = set()

    # ---- running ---------------------------------------------------------------------------------------

    async def start(self) -> None:
        """Listens, and starts the engine."""
        self._loop = asyncio.get_running_loop()
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
        self._do(self.session.begin(self._opening))

    async def wait(self) -> None:
        """Until the server is stopped."""
        assert self._server is not None
        await self._server.wait_closed()

    async def stop(self) -> None:
        """Ends windows and engine; what was not saved has been kept."""
        if self._engine is not None:
            await asyncio.to_thread(self._engine.end)
        await asyncio.to_thread(self._keeper.finish)
        if self._server is not None:
            self._server.close(code=1001)
            await self._server.wait_closed()

    @property
    def port(self) -> int:
        """On which it listens."""
        assert self._server is not None
        return int(next(iter(self._server.sockets)).getsockname()[1])

    @property
    def url(self) -> str:
        """Address of the page, with its token."""
        host = self._settings.host
        name = "127.0.0.1" if host in ("", "0.0.0.0", "::") else f"[{host}]" if ":" in host else host
        return f"http://{name}:{self.port}/#token={self._settings.token}"

    @property
    def engine_pid(self) -> int | None:
        """Number of the process of the engine."""
        return None if self._engine is None else self._engine.pid

    # ---- requests --------------------------------------------------------------------------------------

    def _answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """A file of the page, a refusal, or None for the socket."""
        if not self._access.host_is_right(request.headers.get("Host")):
            return self._response(http.HTTPStatus.MISDIRECTED_REQUEST, "this server has another name")
        if is_socket(request.path):
            if not self._access.origin_is_right(request.headers.get("Origin")):
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
        self._opened += 1
        window = self._opened
        self._windows[window] = connection, FrameGate()
        self._outgoing[window] = asyncio.Queue()
        sender = asyncio.create_task(self._send(window))
        self._put(window, json.dumps(self._welcome()))
        self._do(self.session.window_opened(window))
        try:
            async for message in connection:
                self._hear(window, message)
        except ConnectionClosed:
            pass
        finally:
            sender.cancel()
            del self._windows[window], self._outgoing[window]
            self._do(self.session.window_closed(window))

    async def _greeted(self, connection: ServerConnection) -> tuple[int, str] | None:
        """Why a window is not let in: code and reason; None where it is."""
        try:
            message = await asyncio.wait_for(connection.recv(), _HELLO)
        except (TimeoutError, asyncio.TimeoutError):
            return 4408, "no hello"
        except ConnectionClosed:
            return 1000, ""
        try:
            if not isinstance(message, str) or len(message) > _MOST_BEFORE:
                raise CommandRefused("hello comes first")
            hello = read_command(message)
        except CommandRefused:
            return 4401, "hello with the token comes first"
        if hello.type != "hello" or not self._access.token_is_right(hello["token"]):
            return 4401, "wrong token"
        if hello["protocol"] != PROTOCOL:
            return 4409, f"this server speaks version {PROTOCOL}"
        return (1013, "too many windows") if len(self._windows) >= _MOST_WINDOWS else None

    def _welcome(self) -> dict[str, Any]:
        from .. import __version__
        from ..shapes import EXAMPLES, SURFACES

        return {
            "type": "welcome",
            "protocol": PROTOCOL,
            "version": __version__,
            "folder": self._folder.path.name,
            "examples": [
                {"name": f"example:{name}", "words": name.replace("_", " ")} for name in [*EXAMPLES, *SURFACES]
            ],
            "open": list(OPENS),
            "save": formats_message(),
            "limits": {"upload_bytes": self._settings.upload_bytes, "vertices": 200_000},
        }

    def _hear(self, window: int, message: str | bytes) -> None:
        try:
            command = read_command(message) if isinstance(message, str) else uploaded(message)
        except CommandRefused as refused:
            self._put(window, json.dumps(error_message(str(refused), refused.command, refused.id)))
            return
        if command.type == "ack":
            frame = self._windows[window][1].acknowledged(command["frame"])
            if frame is not None:
                self._put(window, frame)
            return
        self._do(self.session.command(window, command))

    async def _send(self, window: int) -> None:
        """Sends what is put in line for a window, one after the other."""
        connection, queue = self._windows[window][0], self._outgoing[window]
        try:
            while True:
                await connection.send(await queue.get())
        except ConnectionClosed:
            return

    def _put(self, window: int, message: str | bytes) -> None:
        if window in self._outgoing:
            self._outgoing[window].put_nowait(message)

    # ---- effects ---------------------------------------------------------------------------------------

    def _do(self, effects: Sequence[Effect]) -> None:
        for effect in effects:
            self._do_one(effect)

    def _do_one(self, effect: Effect) -> None:
        if isinstance(effect, Tell):
            message = effect.message if isinstance(effect.message, bytes) else json.dumps(effect.message)
            for window in self._of(effect.window):
                self._put(window, message)
        elif isinstance(effect, Draw):
            self._draw(effect)
        elif isinstance(effect, Ask):
            if self._engine is not None:
                self._engine.ask(effect.request)
        elif isinstance(effect, StartEngine):
            self._start_engine()
        elif isinstance(effect, Wake):
            self._loop.call_later(effect.seconds, lambda: self._do(self.session.awoken(effect.why)))
        elif isinstance(effect, Autosave):
            self._keeper.keep(self.session.title, effect.content)
        elif isinstance(effect, Store | Deliver):
            self._later(self._file(effect))

    def _of(self, window: int | None) -> list[int]:
        return list(self._windows) if window is None else [window] if window in self._windows else []

    def _draw(self, effect: Draw) -> None:
        data = frame_bytes(effect.frame, effect.number)
        for window in self._of(effect.window):
            now = self._windows[window][1].offer(effect.number, data)
            if now is not None:
                self._put(window, now)

    def _later(self, work: Any) -> None:
        task = self._loop.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _file(self, effect: Store | Deliver) -> None:
        """Makes a file, and writes it or sends it."""
        window = effect.window if effect.window is not None else 0
        try:
            if isinstance(effect, Deliver):
                answer: str | bytes = await asyncio.to_thread(_download, effect)
            else:
                answer = json.dumps(await asyncio.to_thread(_store, effect))
        except (TorchfairError, OSError, ValueError) as error:
            answer = json.dumps(error_message(str(error), "save", effect.id))
        self._put(window, answer)

    # ---- the engine ------------------------------------------------------------------------------------

    def _start_engine(self) -> None:
        old = self._engine
        if old is not None:
            old.end()
        box: list[EngineProcess] = []

        def of_it(then: Callable[[], None]) -> None:
            if box and self._engine is box[0]:
                then()

        def said(event: Event) -> None:
            self._loop.call_soon_threadsafe(of_it, lambda: self._do(self.session.engine_said(event)))

        def lost() -> None:
            self._loop.call_soon_threadsafe(of_it, lambda: self._do(self.session.engine_lost()))

        self._engine = EngineProcess(said, lost)
        box.append(self._engine)


def frame_bytes(shown: Shown, number: int) -> bytes:
    """A state as a frame."""
    return frame(
        shown.vertices - shown.origin, shown.edges, shown.scale, number=number, topology=shown.topology,
        flags=shown.flags, count=shown.count,
    )  # fmt: skip


def uploaded(data: bytes) -> Command:
    """The command of a binary message.

    Raises:
        CommandRefused: it is no upload.
    """
    try:
        message, arrays = unpack(data)
    except ValueError as error:
        raise CommandRefused(str(error)) from None
    number = message.get("id")
    number = number if isinstance(number, int) and not isinstance(number, bool) else None
    name = message.get("name")
    if message.get("type") != "upload" or set(arrays) != {"bytes"} or arrays["bytes"].dtype.itemsize != 1:
        raise CommandRefused("a binary message has to be an upload of bytes", "upload", number)
    if not isinstance(name, str) or not 0 < len(name) <= 255 or not name.isprintable():
        raise CommandRefused("upload: name: expected the name of a file", "upload", number)
    return Command("upload", {"name": name, "bytes": arrays["bytes"].tobytes()}, number)


def _download(effect: Deliver) -> bytes:
    import numpy as np

    media = next((media for suffix, _, media in FORMATS.values() if effect.name.endswith(suffix)), "")
    message = {"type": "download", "name": effect.name, "media": media or "application/octet-stream", "id": effect.id}
    return pack(message, {"bytes": np.frombuffer(effect.content(), np.uint8)})


def _store(effect: Store) -> dict[str, Any]:
    from ..io import atomic_write_bytes

    content = effect.content()
    atomic_write_bytes(effect.path, content, overwrite=effect.overwrite)
    name = Path(effect.path).name
    return {"type": "saved", "id": effect.id, "name": name, "sentence": f"{name} is saved ({len(content)} bytes)"}
