"""The server over its sockets: who is let in, what is served, frames and files; with a client that is no browser."""

from __future__ import annotations

import http.client
import json
import os
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from design_tools import ThreadEngine

from torchfair import load_mesh
from torchfair.design.containers import AT_REST, FRAME, JUMP, pack, unpack
from torchfair.design.engine.requests import Open
from torchfair.design.running import BackgroundServer

pytest.importorskip("websockets")
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from torchfair.design.server import ServerSettings

WAIT = 60.0


@pytest.fixture
def page(tmp_path: Path) -> Path:
    folder = tmp_path / "page"
    (folder / "vendor").mkdir(parents=True)
    (folder / "index.html").write_text("<!doctype html>")
    (folder / "main.js").write_text("export {};")
    (folder / "vendor" / "three.js").write_text("export {};")
    (folder / "secret.py").write_text("token")
    return folder


@pytest.fixture
def server(tube: Path, page: Path) -> Iterator[BackgroundServer]:
    settings = ServerSettings(folder=tube.parent, page=page, upload_bytes=1 << 20)
    with BackgroundServer(settings, Open(0, str(tube), None, tube.name), ThreadEngine) as running:
        yield running


class Client:
    """A window that acknowledges what it gets."""

    def __init__(self, server: BackgroundServer, token: str | None = None, acknowledges: bool = True) -> None:
        address = server.url.partition("#")[0].replace("http", "ws") + "socket"
        self._connecting = connect(address, max_size=None, compression=None)
        self.socket: ClientConnection = self._connecting.__enter__()
        self.acknowledges, self.seen = acknowledges, []  # type: ignore[var-annotated]
        self.say(type="hello", token=token or server.server.token, protocol=1)

    def close(self) -> None:
        self._connecting.__exit__(None, None, None)

    def say(self, **message: Any) -> None:
        self.socket.send(json.dumps(message))

    def hear(self) -> Any:
        """A message; arrays beside it if it is a container, bytes if it is a frame."""
        data = self.socket.recv(WAIT)
        if isinstance(data, str):
            message = json.loads(data)
        elif data[0] == FRAME:
            message = {"type": "frame", "data": data, "number": int.from_bytes(data[4:8], "little"), "flags": data[1]}
            if self.acknowledges:
                self.say(type="ack", frame=message["number"])
        else:
            message, arrays = unpack(data)
            message["arrays"] = arrays
        self.seen.append(message)
        return message

    def until(self, kind: str, **fields: Any) -> Any:
        while True:
            message = self.hear()
            if message["type"] == kind and all(message.get(name) == value for name, value in fields.items()):
                return message


@pytest.fixture
def window(server: BackgroundServer) -> Iterator[Callable[..., Client]]:
    """Opens windows, and closes them in the end."""
    with ExitStack() as stack:
        yield lambda **how: stack.enter_context(closing(Client(server, **how)))


def get(server: BackgroundServer, path: str, **headers: str) -> tuple[int, dict[str, str], bytes]:
    connection = http.client.HTTPConnection("127.0.0.1", server.server.port, timeout=WAIT)
    connection.putrequest("GET", path, skip_host="Host" in headers)
    for name, value in headers.items():
        connection.putheader(name, value)
    connection.endheaders()
    response = connection.getresponse()
    found = response.status, dict(response.getheaders()), response.read()
    connection.close()
    return found


def place_of(message: Any, arrays: Any, vertex: int) -> Any:
    positions = np.frombuffer(message["data"], "<f4", 3 * arrays["boundary"].size, 24).reshape(-1, 3)
    return positions[vertex].astype(float)


def test_a_drag_over_the_socket(window: Callable[..., Client], tube: Path) -> None:
    client, mesh = window(), load_mesh(tube)
    client.until("state", state="READY")
    topology = next(m for m in client.seen if m["type"] == "topology")
    frame = next(m for m in client.seen if m["type"] == "frame")
    assert frame["flags"] == AT_REST | JUMP
    assert len(frame["data"]) == 24 + 12 * mesh.topology.num_vertices + mesh.topology.num_edges
    origin = np.array(topology["origin"])
    assert np.allclose(place_of(frame, topology["arrays"], 30) + origin, mesh.vertices[30].numpy(), atol=1e-6)
    target = (mesh.vertices[30] * 1.05).tolist()
    client.say(type="move", places=[[30, *target]], count=9)
    moving = client.until("frame", flags=1)
    assert int.from_bytes(moving["data"][2:4], "little") == 9
    client.say(type="release", id=4)
    client.until("state", state="READY")
    rest = [m for m in client.seen if m["type"] == "frame"][-1]
    assert rest["flags"] == AT_REST
    edge = topology["mean_edge"]
    assert np.linalg.norm(place_of(rest, topology["arrays"], 30) + origin - target) < 0.05 * edge
    assert [m for m in client.seen if m["type"] == "done"] == [{"type": "done", "id": 4}]
    numbers = [m["frame"] for m in client.seen if m["type"] == "frame" and "frame" in m]
    assert numbers == sorted(numbers)


def test_a_window_that_does_not_acknowledge_gets_one_frame(window: Callable[..., Client]) -> None:
    slow, quick = window(acknowledges=False), window()
    for client in (slow, quick):
        client.until("state", state="READY", windows=2) if client is quick else client.until("frame")
    for count in range(1, 4):
        quick.say(type="move", places=[[30, 1.2 + 0.02 * count, 0.0, 0.0]], count=count)
        quick.until("frame")
    quick.say(type="release")
    quick.until("state", state="READY")
    slow.until("state", state="READY", undo=1)
    assert [m["type"] for m in slow.seen].count("frame") == 1
    newest = max(m["number"] for m in quick.seen if m["type"] == "frame")
    slow.say(type="ack", frame=next(m["number"] for m in slow.seen if m["type"] == "frame"))
    assert slow.until("frame")["number"] == newest


def test_two_windows_share_a_design(window: Callable[..., Client]) -> None:
    first, second = window(), window()
    first.until("state", state="READY", windows=2)
    second.until("state", state="READY")
    first.say(type="hold", vertices=[30])
    assert second.until("handles", held=[30])["handles"] == []
    second.until("state", state="READY", undo=1)
    second.say(type="undo")
    first.until("state", state="READY", redo=1)


def test_files_come_and_go(window: Callable[..., Client], tube: Path) -> None:
    client = window()
    client.until("state", state="READY")
    client.say(type="list", id=1)
    assert [file["name"] for file in client.until("files")["files"]] == ["tube.obj"]
    client.say(type="save", format="off", to="folder", name="out", id=2)
    assert client.until("saved", id=2)["name"] == "out.off"
    assert (tube.parent / "out.off").is_file()
    client.say(type="save", format="off", to="folder", name="out.off", id=3)
    assert "exists" in client.until("error", id=3)["sentence"]
    client.say(type="save", format="session", to="download", id=4)
    download = client.until("download", id=4)
    data = download["arrays"]["bytes"].tobytes()
    client.socket.send(
        pack({"type": "upload", "id": 5, "name": "again.torchfair"}, {"bytes": np.frombuffer(data, "u1")})
    )
    client.until("done", id=5)
    for name in ("../out.obj", "/tmp/out.obj", ".hidden", "a/b.obj", "C:\\a.obj"):
        client.say(type="save", format="obj", to="folder", name=name, id=6)
        assert client.until("error", id=6)
    client.say(type="open", source="../../etc/passwd", id=7)
    assert client.until("error", id=7)


def test_uploads_are_bounded(window: Callable[..., Client]) -> None:
    client = window()
    client.until("state", state="READY")
    head = {"type": "upload", "id": 5, "name": "a.obj"}
    client.socket.send(pack(head, {"bytes": np.zeros(3 << 19, np.uint8)}))
    assert "at most 1048576" in client.until("error", id=5)["sentence"]
    with suppress(ConnectionClosed):  # the server may not even read it all
        client.socket.send(pack(head, {"bytes": np.zeros(4 << 20, np.uint8)}))
    with pytest.raises(ConnectionClosed) as closed:
        client.hear()
    assert closed.value.rcvd is not None
    assert closed.value.rcvd.code == 1009


def test_hostile_binary_messages_are_refused(server: BackgroundServer, window: Callable[..., Client]) -> None:
    client = window()
    client.until("state", state="READY")
    source = np.random.default_rng(0)
    right = pack({"type": "upload", "id": 5, "name": "a.obj"}, {"bytes": np.zeros(9, np.uint8)})
    for _ in range(200):
        data = bytearray(right)
        for place in source.integers(0, 40, 3):
            data[place] = source.integers(256)
        data = data[: source.integers(1, len(data) + 1)]
        client.socket.send(bytes(data))
    client.say(type="list", id=77)
    client.until("done", id=77)
    told = "welcome state settings topology frame handles numbers error files done notice".split()  # noqa: SIM905
    assert {m["type"] for m in client.seen} <= set(told)
    assert server.server.session.document is not None
    assert server.server.session.document.title == "tube"


# ---- who is let in ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "hello",
    ['{"type": "hello", "token": "wrong", "protocol": 1}', '{"type": "list"}', "{", "x" * 10_000,
     '{"type": "undo", "id": 1}', '{"type": "hello", "token": "", "protocol": 1}'],
)  # fmt: skip
def test_without_the_token_nobody_is_let_in(server: BackgroundServer, hello: str) -> None:
    with connect(f"ws://127.0.0.1:{server.server.port}/socket") as socket:
        socket.send(hello)
        with pytest.raises(ConnectionClosed) as closed:
            socket.recv(WAIT)
    assert closed.value.rcvd is not None
    assert closed.value.rcvd.code == 4401


def test_another_version_of_the_page_is_told(server: BackgroundServer) -> None:
    with connect(f"ws://127.0.0.1:{server.server.port}/socket") as socket:
        socket.send(json.dumps({"type": "hello", "token": server.server.token, "protocol": 2}))
        with pytest.raises(ConnectionClosed) as closed:
            socket.recv(WAIT)
    assert closed.value.rcvd is not None
    assert closed.value.rcvd.code == 4409


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "null", "http://127.0.0.1.evil.example", "file://", "http://"]
)
def test_pages_of_elsewhere_open_no_socket(server: BackgroundServer, origin: str) -> None:
    address = f"ws://127.0.0.1:{server.server.port}/socket"
    with pytest.raises(InvalidStatus) as refused, connect(address, additional_headers={"Origin": origin}):
        pass
    assert refused.value.response.status_code == 403


@pytest.mark.parametrize("origin", ["http://localhost:9999", "https://127.0.0.1", "http://[::1]:8080"])
def test_a_tunnel_may_change_the_port(server: BackgroundServer, origin: str) -> None:
    address = f"ws://127.0.0.1:{server.server.port}/proxy/8888/socket?x=1"
    with connect(address, additional_headers={"Origin": origin}) as socket:
        socket.send(json.dumps({"type": "hello", "token": server.server.token, "protocol": 1}))
        assert json.loads(socket.recv(WAIT))["type"] == "welcome"


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1.evil.example:80", "a@127.0.0.1", "", "127.0.0.1:x"])
def test_another_name_of_the_host_is_refused(server: BackgroundServer, host: str) -> None:
    """A page whose name was bound to this machine later (DNS rebinding)."""
    for path in ("/", "/socket"):
        assert get(server, path, Host=host)[0] == 421


@pytest.mark.parametrize(
    ("path", "status"),
    [("/", 200), ("/index.html", 200), ("/?x", 200), ("/main.js", 200), ("/vendor/three.js", 200), ("/proxy/80/", 200),
     ("/proxy/80/main.js", 200), ("/proxy/80/vendor/three.js", 200), ("/secret.py", 404), ("/../secret.py", 404),
     ("/vendor/../main.jsx", 404), ("/%2e%2e/secret.py", 404), ("//etc/passwd", 404), ("/vendor", 404),
     ("/main.js/", 404), ("/tube.obj", 404)],
)  # fmt: skip
def test_pages_are_those_of_the_list(server: BackgroundServer, path: str, status: int) -> None:
    found, headers, content = get(server, path)
    if path == "/main.js/":  # a folder of a proxy, where the page itself stands
        assert content == b"<!doctype html>"
        return
    assert found == status
    assert "token" not in content.decode()
    assert headers["Content-Security-Policy"].startswith("default-src 'none'; script-src 'self';")
    assert headers["Content-Security-Policy"].endswith("frame-ancestors 'none'")
    assert "unsafe" not in headers["Content-Security-Policy"]
    assert headers["X-Content-Type-Options"] == "nosniff"
    assert headers["Referrer-Policy"] == "no-referrer"
    assert "Access-Control-Allow-Origin" not in headers


# ---- a process in truth ----------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_an_engine_that_is_killed_comes_back_with_the_last_settled_shape(tube: Path, page: Path) -> None:
    settings = ServerSettings(folder=tube.parent, page=page)
    with BackgroundServer(settings, Open(0, str(tube), None, tube.name)) as server:
        client = Client(server)  # closed with its server
        client.until("state", state="READY")
        client.say(type="move", places=[[30, 1.2, 0.0, 0.0]], release=True)
        client.until("state", state="READY", undo=1)
        settled = [m for m in client.seen if m["type"] == "frame"][-1]["data"]
        client.say(type="move", places=[[30, 1.4, 0.0, 0.0]])
        client.until("frame", flags=1)
        engine = server.server.hub.engine
        assert engine is not None
        assert engine.pid is not None
        os.kill(engine.pid, signal.SIGKILL)
        client.until("state", state="LOST")
        assert "engine has ended" in next(m for m in client.seen[::-1] if m["type"] == "notice")["sentence"]
        client.until("state", state="READY", undo=1)
        back = [m for m in client.seen if m["type"] == "frame"][-1]
        assert back["flags"] == AT_REST | JUMP
        assert back["data"][24:] == settled[24:]
        client.say(type="move", places=[[30, 1.25, 0.0, 0.0]], release=True)
        client.until("state", state="READY", undo=2)
        pid = server.server.hub.engine.pid  # type: ignore[union-attr]
    for _ in range(50):
        if not Path(f"/proc/{pid}").exists():
            return
        time.sleep(0.1)
    raise AssertionError("the engine outlives its server")
