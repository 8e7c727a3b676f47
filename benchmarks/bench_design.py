"""The design page without its browser: how long it takes until a mesh answers, through the socket and back.

Run ``python benchmarks/bench_design.py [--modes fair symmetric] [--sizes 480 714 1920] [--json FILE]``.

A server is started with its engine in a process of its own, and a client takes the place of the page: it acknowledges
each frame as soon as it has it. Printed are, for each mode and size: ``ready``, from the start of the server until the
mesh can be pulled; ``first``, from a move of a handle at rest to the first changed frame (median of ten); ``frames/s``
while the handle moves sixty times a second for two seconds; ``rest``, from release to the last frame; ``bytes`` of a
frame beside 24 + 12 V + E; ``back``, from the end of a killed engine until the last settled shape can be pulled again;
and ``idle``, processor time of the engine in a second in which nothing moves. Times are those of the clock; on a
machine that does something else, too, look at ``cpu first`` and ``cpu frame``, processor time of the engine (Linux
only).
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import statistics
import struct
import tempfile
import time
from contextlib import closing
from pathlib import Path
from typing import Any

import torch
from symmetric_problems import SHAPES
from websockets.sync.client import connect

from torchfair import save_mesh
from torchfair.design.containers import FRAME, unpack
from torchfair.design.engine.requests import Open
from torchfair.design.running import BackgroundServer
from torchfair.design.server import ServerSettings
from torchfair.principal import principal_edges_of_lattice
from torchfair.shapes import principal_triangles

TARGETS = {  # seconds to the first frame, frames a second, seconds to rest
    ("fair", 480): (0.06, 20, 0.5),
    ("fair", 714): (0.12, 15, 1.0),
    ("fair", 1920): (0.25, 8, 3.0),
    ("symmetric", 480): (0.06, 10, 0.5),
    ("symmetric", 714): (0.12, 8, 1.0),
    ("symmetric", 1920): (0.25, 3, 3.0),
}
BACK, IDLE = 4.0, 0.01
_DRAG, _HERTZ, _AGAIN = 2.0, 60.0, 10


class Client:
    """What the page is for the server."""

    def __init__(self, server: BackgroundServer) -> None:
        address = server.url.partition("#")[0].replace("http", "ws") + "socket"
        self._connecting = connect(address, max_size=None, compression=None)
        self.socket = self._connecting.__enter__()
        self.say(type="hello", token=server.server.token, protocol=1)

    def close(self) -> None:
        self._connecting.__exit__(None, None, None)

    def say(self, **message: Any) -> None:
        self.socket.send(json.dumps(message))

    def hear(self, timeout: float = 120.0) -> dict[str, Any]:
        data = self.socket.recv(timeout)
        if isinstance(data, str):
            found: dict[str, Any] = json.loads(data)
            return found
        if data[0] != FRAME:
            return unpack(data)[0]
        _, flags, count, number = struct.unpack_from("<BBHI", data)
        self.say(type="ack", frame=number)
        return {"type": "frame", "flags": flags, "count": count, "bytes": len(data)}

    def until(self, kind: str, **fields: Any) -> dict[str, Any]:
        while True:
            message = self.hear()
            if message["type"] == kind and all(message.get(name) == value for name, value in fields.items()):
                return message


def processor_time(pid: int | None) -> float:
    """Seconds that a process has computed; 0 where that is not known."""
    try:
        words = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")


def measured(mode: str, size: int, folder: Path) -> dict[str, Any]:
    shape = SHAPES[size]
    mesh = principal_triangles(shape.surface, shape.rows, shape.columns, along="u")
    marks = principal_edges_of_lattice(mesh, "u").polylines()
    save_mesh(folder / "mesh.obj", mesh.vertices, mesh.topology, polylines=marks, overwrite=True)
    began = time.perf_counter()
    opening = Open(0, str(folder / "mesh.obj"), None, "mesh.obj", fresh=True)
    with BackgroundServer(ServerSettings(folder=folder), opening) as server, closing(Client(server)) as client:
        client.until("state", state="READY")
        ready = time.perf_counter() - began
        if mode != "fair":
            client.say(type="mode", mode=mode)
            client.until("state", state="READY", mode=mode)
        handle = int(mesh.topology.num_vertices * 0.4)
        result = {"mode": mode, "vertices": mesh.topology.num_vertices, "ready": ready}
        result |= dragged(client, server, mesh.vertices[handle], handle)
        result["bound"] = 24 + 12 * mesh.topology.num_vertices + mesh.topology.num_edges
        return result | restarted(client, server)


def dragged(client: Client, server: BackgroundServer, place: torch.Tensor, handle: int) -> dict[str, Any]:
    pid = server.server.hub.engine.pid if server.server.hub.engine else None
    out = place / place.norm() * 0.01 * float(place.norm())
    firsts, costs = [], []
    for number in range(1, _AGAIN + 1):
        client.say(type="move", places=[[handle, *(place + 0.2 * number * out).tolist()]], count=number)
        start, before = time.perf_counter(), processor_time(pid)
        client.until("frame", count=number)
        firsts.append(time.perf_counter() - start)
        costs.append(processor_time(pid) - before)
        drained(client)
    frames, cost, nbytes = continuous(client, pid, place, out, handle)
    client.say(type="release")
    start = time.perf_counter()
    client.until("frame", flags=2)
    rest = time.perf_counter() - start
    client.until("state", state="READY")
    before = processor_time(pid)
    time.sleep(1.0)
    return {
        "first": statistics.median(firsts), "cpu_first": statistics.median(costs), "frames_a_second": frames / _DRAG,
        "cpu_frame": cost / max(frames, 1), "rest": rest, "bytes": nbytes, "idle": processor_time(pid) - before,
    }  # fmt: skip


def drained(client: Client) -> None:
    """Until the mesh has caught up with its handle."""
    try:
        while True:
            client.hear(timeout=0.5)
    except TimeoutError:
        return


def continuous(
    client: Client, pid: int | None, place: torch.Tensor, out: torch.Tensor, handle: int
) -> tuple[int, float, int]:
    """Frames while a handle moves to and fro, processor time meanwhile, and bytes of a frame."""
    frames, nbytes, count = 0, 0, 100
    start, before = time.perf_counter(), processor_time(pid)
    due = start
    while (now := time.perf_counter()) < start + _DRAG:
        if now >= due:
            count, due = count + 1, due + 1.0 / _HERTZ
            share = 2.0 + 2.0 * abs(1.0 - (now - start) / _DRAG * 2.0)
            client.say(type="move", places=[[handle, *(place + share * out).tolist()]], count=count)
        try:
            message = client.hear(timeout=max(1e-3, due - time.perf_counter()))
        except TimeoutError:
            continue
        if message["type"] == "frame":
            frames, nbytes = frames + 1, message["bytes"]
    return frames, processor_time(pid) - before, nbytes


def restarted(client: Client, server: BackgroundServer) -> dict[str, Any]:
    engine = server.server.hub.engine
    assert engine is not None
    assert engine.pid is not None
    start = time.perf_counter()
    os.kill(engine.pid, signal.SIGKILL)
    client.until("state", state="LOST")
    client.until("state", state="READY")
    back = time.perf_counter() - start
    return {"back": back, "cpu_back": processor_time(server.server.hub.engine.pid if server.server.hub.engine else 0)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--modes", nargs="+", default=["fair", "symmetric"], choices=["fair", "form", "symmetric"])
    parser.add_argument("--sizes", nargs="+", type=int, default=[480, 714, 1920], choices=sorted(SHAPES))
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    rows = []
    print(
        "mode       vertices  ready s  first ms (cpu)  frames/s (cpu ms)  rest s  bytes (bound)  back s (cpu)  idle s"
    )
    with tempfile.TemporaryDirectory() as folder:
        for mode in arguments.modes:
            for size in arguments.sizes:
                row = measured(mode, size, Path(folder))
                rows.append(row)
                first, rate, rest = TARGETS.get((mode, size), (None, None, None))
                print(
                    f"{mode:10} {row['vertices']:8} {row['ready']:8.2f} {1e3 * row['first']:9.0f} "
                    f"({1e3 * row['cpu_first']:.0f}) {row['frames_a_second']:12.1f} ({1e3 * row['cpu_frame']:.0f}) "
                    f"{row['rest']:9.2f} {row['bytes']:9} ({row['bound']}) {row['back']:8.2f} ({row['cpu_back']:.1f}) "
                    f"{row['idle']:7.2f}   wanted: {first} s, {rate}, {rest} s, {BACK} s, {IDLE} s",
                    flush=True,
                )
    if arguments.json:
        arguments.json.write_text(json.dumps(rows, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
