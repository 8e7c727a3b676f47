"""Other programs that make quad meshes of surfaces: QuadriFlow and Instant Meshes, as far as they are installed.

``pip install 'torchfair[peers]'`` installs both. They are compiled code that may end the process they run in, so each
call is a process of its own: ``python benchmarks/meshing_peers.py NAME INPUT.npz COUNT OUTPUT.npz``.
"""

from __future__ import annotations

import importlib.util
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from torchfair import Topology

Arrays = tuple[NDArray[np.float64], NDArray[np.int64]]
_LIMIT = 120.0  # seconds of a call


class PeerMesh(NamedTuple):
    """What a peer made: vertices (V, 3), quads (F, 4) or the topology of ours, processor seconds."""

    vertices: NDArray[np.float64]
    quads: NDArray[np.int64] | Topology
    seconds: float


def quadriflow(vertices: NDArray[np.float64], triangles: NDArray[np.int64], count: int) -> Arrays:
    """Boundaries are kept, as its users do; all else by default."""
    from pyQuadriFlow.pyQuadriFlow import pyquadriflow

    made = pyquadriflow(count, 0, vertices.tolist(), triangles.tolist(), False, True, False, False, False)
    return np.array(made["vertices"]), np.array(made["faces"])


def instant_meshes(vertices: NDArray[np.float64], triangles: NDArray[np.int64], count: int) -> Arrays:
    """Defaults of the program itself, boundaries aligned; it cuts every face of its first mesh into quads."""
    from pynanoinstantmeshes import remesh

    points, faces = remesh(
        vertices.astype(np.float32),
        triangles.astype(np.uint32),
        -1,
        face_count=count // 4,
        smooth_iter=2,
        align_to_boundaries=True,
        deterministic=True,
    )
    return np.asarray(points, np.float64), np.asarray(faces, np.int64)


PEERS: dict[str, tuple[str, Callable[[NDArray[np.float64], NDArray[np.int64], int], Arrays]]] = {
    "QuadriFlow": ("pyQuadriFlow", quadriflow),
    "Instant Meshes": ("pynanoinstantmeshes", instant_meshes),
}
"""Package and function by name."""


def installed() -> list[str]:
    """Names of peers that can be run."""
    return [name for name, (package, _) in PEERS.items() if importlib.util.find_spec(package) is not None]


def run_peer(name: str, vertices: NDArray[np.float64], triangles: NDArray[np.int64], count: int) -> PeerMesh | str:
    """The mesh of a peer, or in words why there is none."""
    with tempfile.TemporaryDirectory() as folder:
        given, made = Path(folder) / "given.npz", Path(folder) / "made.npz"
        np.savez(given, vertices=vertices, triangles=triangles)
        command = [sys.executable, __file__, name, str(given), str(count), str(made)]
        try:
            done = subprocess.run(command, capture_output=True, timeout=_LIMIT, check=False)
        except subprocess.TimeoutExpired:
            return f"stopped after {_LIMIT:.0f} s"
        if done.returncode or not made.exists():
            return f"ended with code {done.returncode}"
        with np.load(made) as arrays:
            return PeerMesh(arrays["vertices"], arrays["quads"], float(arrays["seconds"]))


def main(name: str, given: str, count: str, made: str) -> None:
    """A call in this process; the first of two, so that nothing is timed that is done once, is not counted."""
    function = PEERS[name][1]
    with np.load(given) as arrays:
        vertices, triangles = arrays["vertices"], arrays["triangles"]
    times = []
    for _ in range(2):
        begin = time.process_time()
        points, quads = function(vertices, triangles, int(count))
        times.append(time.process_time() - begin)
    np.savez(made, vertices=points, quads=quads, seconds=min(times))


if __name__ == "__main__":
    main(*sys.argv[1:])
