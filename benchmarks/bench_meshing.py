"""Principal meshes: time and memory up to 100 000 faces, and angles, E/C and time beside QuadriFlow and Instant Meshes.

Run ``python benchmarks/bench_meshing.py [--sizes 700:7000 ...] [--shapes torus ...] [--kinds quads ...] [--quads 700]
[--surfaces NAME ...] [--json FILE]``, on one thread; times are processor seconds.

=========  ==============================================================================================
sizes      faces asked for and triangles of the surface, a free-form patch and a torus, quads and triangles; every size
           in its own process, whose largest memory is printed (targets: 2, 3 and 15 s for the first three; 4 GB;
           growth at most 1.3)
surfaces   irregular triangles of analytic surfaces, and files beside the project if there are any; all sides get
           the same triangles and the same count, one after the other
angle      degrees between inner edges and principal directions, mean and 95 %; none where edges are so short that
           the surface is nearly flat over each of them
E/C        may be below 1: edges along the boundary carry no energy, and shrunken meshes have less
+ rim      E/C with what the surface still turns between faces and their edges along the boundary: 1 is least
distance   of the middles of edges and faces from the surface, largest, in mean edges
topology   whether Euler number and boundary loops are those of the surface
peers      run if they are installed (``pip install 'torchfair[peers]'``), otherwise left out with a line; targets:
           lower angle and E/C on every surface, time at most three times theirs
=========  ==============================================================================================
"""

from __future__ import annotations

import argparse
import json
import math
import resource
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import torch
from meshing_peers import PEERS, PeerMesh, installed, run_peer
from torch import Tensor

from torchfair import Topology, TorchfairError
from torchfair.geometry import edge_lengths, face_normals
from torchfair.io import load_mesh
from torchfair.meshing import MeshCreases, MeshingSettings, principal_quads, principal_triangles
from torchfair.meshing.components import ReadSurface, read_surface
from torchfair.meshing.report import measure
from torchfair.meshing.verification import shape_of
from torchfair.shapes import (
    Catenoid,
    Enneper,
    FreeFormPatch,
    PrincipalParaboloid,
    Torus,
    irregular_triangles,
    rotated_lattice,
)
from torchfair.triangulation import triangulate

Mesh = tuple[Tensor, Topology]
OURS = "torchfair"
SIZES = ((700, 7000), (2000, 7000), (20_000, 29_000), (50_000, 72_000), (100_000, 145_000))
TIMES = {(700, 7000): 2.0, (2000, 7000): 3.0, (20_000, 29_000): 15.0}
MEMORY, GROWTH, SLOWER = 4.0, 1.3, 3.0
SHAPES, KINDS = ("free-form patch", "torus"), ("quads", "triangles")
ANALYTIC = {
    "saddle": PrincipalParaboloid(1.0, -0.5),
    "torus": Torus(),
    "catenoid": Catenoid(),
    "Enneper": Enneper(),
    "free-form patch": FreeFormPatch(),
}
FOLDER = Path(__file__).resolve().parents[2] / "shared" / "meshes"
FILES = {
    "inspired": "inspired_mesh.obj",
    "annulus": "tri_mesh.obj",
    "bubble": "botanic-garden-bubble-0.obj",
    "vault of least C": "meshing/form_arch4.obj",
    "wave of least C": "meshing/form_wave3.obj",
    "ring of least C": "meshing/form_ring.obj",
}
_VERTICES = 3500


def surface_of(name: str) -> Mesh:
    """A surface by its name."""
    if name in ANALYTIC:
        made = irregular_triangles(ANALYTIC[name], _VERTICES)
        return made.vertices, made.topology
    mesh = load_mesh(FOLDER / FILES[name])
    triangles = triangulate(mesh.vertices, mesh.topology).triangles
    return mesh.vertices, Topology.from_faces(triangles, len(mesh.vertices))


def available() -> list[str]:
    """Names of surfaces that can be had here."""
    return [*ANALYTIC, *(name for name, file in FILES.items() if (FOLDER / file).exists())]


# ---- growth --------------------------------------------------------------------------------------------


def child(shape: str, kind: str, count: int, triangles: int) -> None:
    """Meshes one size after a small one and prints JSON."""
    lines, smooth = round(math.sqrt(triangles / 2)), ANALYTIC[shape]
    make = principal_quads if kind == "quads" else principal_triangles
    surface = rotated_lattice(smooth, lines, lines, 0.4, kind="triangles")
    small = rotated_lattice(smooth, 12, 12, 0.4, kind="triangles")
    make(small.vertices, small.topology, count=60)
    begin = time.process_time()
    made = make(surface.vertices, surface.topology, count=count)
    seconds = time.process_time() - begin
    unit = 1.0 if sys.platform == "darwin" else 1024.0  # bytes there, kibibytes elsewhere
    gigabytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e9
    row = {"triangles": surface.topology.num_faces, "faces": made.topology.num_faces, "seconds": seconds}
    print(json.dumps({**row, "memory": gigabytes, "angle": made.report["angle_mean_degrees"], "notes": made.notes}))


def growth(shape: str, kind: str, sizes: list[tuple[int, int]]) -> list[dict[str, Any]]:
    """One line for every size, and the exponent."""
    print(f"{shape}, {kind}")
    print(f"{'asked for':>10}{'faces':>9}{'triangles':>11}{'seconds':>9}{'memory':>9}{'angle':>7}  target")
    rows = []
    for count, triangles in sizes:
        command = [sys.executable, __file__, "--child", shape, kind, str(count), str(triangles)]
        row = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
        rows.append({"asked": count, **row})
        limit = TIMES.get((count, triangles))
        met = "" if limit is None else f"{limit:.0f} s: {verdict(row['seconds'] <= limit)}"
        print(f"{count:>10}{row['faces']:>9}{row['triangles']:>11}{row['seconds']:9.2f}{row['memory']:6.2f} GB", end="")
        angle = f"{row['angle']:7.2f}" if row["angle"] is not None else f"{'-':>7}"
        print(f"{angle}  {met}{''.join(f'  ({note})' for note in row['notes'])}", flush=True)
    if len(rows) > 1:
        first, last = rows[-2], rows[-1]
        exponent = math.log(last["seconds"] / first["seconds"]) / math.log(last["triangles"] / first["triangles"])
        met = verdict(exponent <= GROWTH)
        print(f"growth of the time with triangles, last two: {exponent:.2f}, target {GROWTH}: {met}")
        print(f"memory {last['memory']:.2f} GB, target {MEMORY:.0f}: {verdict(last['memory'] <= MEMORY)}")
    return rows


def verdict(met: bool) -> str:
    return "met" if met else "MISSED"


# ---- peers ---------------------------------------------------------------------------------------------


def ours(surface: Mesh, count: int) -> PeerMesh | str:
    """Our mesh, the better of two times."""
    times = []
    for _ in range(2):
        begin = time.process_time()
        try:
            made = principal_quads(*surface, count=count)
        except TorchfairError as error:
            return str(error)
        times.append(time.process_time() - begin)
    return PeerMesh(made.vertices.numpy(), made.topology, min(times))


def judged(mesh: PeerMesh | str, surface: Mesh, read: ReadSurface) -> dict[str, Any]:
    """What a mesh is like on the surface, which has been read, by one measure for all."""
    if isinstance(mesh, str):
        return {"failure": mesh}
    vertices = torch.as_tensor(mesh.vertices, dtype=torch.float64)
    try:
        quads = mesh.quads
        topology = quads if isinstance(quads, Topology) else Topology.from_faces(torch.from_numpy(quads), len(vertices))
    except TorchfairError as error:
        return {"failure": f"no manifold ({error})", "seconds": mesh.seconds}
    spacing = float(edge_lengths(vertices, topology).mean())
    no_creases = MeshCreases(torch.zeros((0, 2), dtype=torch.int64), vertices.new_zeros(0, 2, 3))
    report = measure(vertices, topology, read, spacing, vertices.new_zeros(0), no_creases)
    same = shape_of(topology) == shape_of(surface[1])
    rim = bending_at_the_rim(vertices, topology, read) / read.total_absolute_curvature
    return {
        "faces": topology.num_faces,
        "angle": report["angle_mean_degrees"],
        "angle_95": report["angle_95_degrees"],
        "ratio": report["variation_over_curvature"],
        "with_rim": report["variation_over_curvature"] + rim,
        "distance": report["distance_max"],
        "topology": same,
        "seconds": mesh.seconds,
    }


def bending_at_the_rim(vertices: Tensor, topology: Topology, read: ReadSurface) -> float:
    """What E leaves out: ``l a`` over boundary edges, a between their faces and the surface at their middles."""
    ends, triangles = topology.boundary_edges, read.smooth_frames.topology.triangles
    if not len(ends):
        return 0.0
    outer = topology.corner_edges >= topology.num_interior_edges
    order = topology.corner_edges[outer].argsort()  # as boundary edges are
    normals = face_normals(vertices, topology)[topology.corner_faces[outer][order]]
    on = read.reference.closest(vertices[ends].mean(1))
    corners = torch.cat([of.normals for of in read.fits])[triangles[on.faces]]
    smooth = (on.weights[..., None] * corners).sum(1)
    turned = torch.linalg.cross(smooth, normals).norm(dim=1)
    angles = torch.atan2(turned, (smooth * normals).sum(1).abs())  # peers may turn surfaces over
    return float((angles * vertices[ends].diff(dim=1).squeeze(1).norm(dim=1)).sum())


def compare(names: list[str], count: int) -> dict[str, dict[str, dict[str, Any]]]:
    """All sides on every surface, and whether ours is better."""
    peers = installed()
    for name in PEERS.keys() - set(peers):
        print(f"{name} is not installed: left out (pip install 'torchfair[peers]')")
    print(f"\n{'surface':<34}{'faces':>6}{'angle':>8}{'95 %':>7}{'E/C':>7}{'+ rim':>7}", end="")
    print(f"{'distance':>10}{'seconds':>9}  topology")
    table: dict[str, dict[str, dict[str, Any]]] = {}
    for name in names:
        surface = surface_of(name)
        arrays = surface[0].numpy(), surface[1].triangles.numpy()
        read = read_surface(*surface, MeshingSettings())
        rows = {OURS: judged(ours(surface, count), surface, read)}
        rows |= {peer: judged(run_peer(peer, *arrays, count), surface, read) for peer in peers}
        table[name] = rows
        for side, row in rows.items():
            print(f"{name if side == OURS else '':<18}{side:<16}{line(row)}", flush=True)
    for peer in peers:
        summarise(peer, table)
    return table


def line(row: dict[str, Any]) -> str:
    if "failure" in row:
        return f"  {row['failure']}"
    words = f"{row['faces']:>6}{row['angle']:8.2f}{row['angle_95']:7.2f}{row['ratio']:7.3f}{row['with_rim']:7.3f}"
    words += f"{row['distance']:10.3f}"
    return words + f"{row['seconds']:9.2f}  {'same' if row['topology'] else 'OTHER'}"


def summarise(peer: str, table: dict[str, dict[str, dict[str, Any]]]) -> None:
    """On how many surfaces ours is better than a peer."""
    both = [(rows[OURS], rows[peer]) for rows in table.values() if "failure" not in {*rows[OURS], *rows[peer]}]
    if not both:
        return
    angle, ratio = (sum(mine[key] < its[key] for mine, its in both) for key in ("angle", "ratio"))
    times = [mine["seconds"] / its["seconds"] for mine, its in both]
    fast = sum(slower <= SLOWER for slower in times)
    print(
        f"against {peer}, {len(both)} of {len(table)} surfaces: lower angle on {angle}, lower E/C on {ratio}, ", end=""
    )
    rims = sum(mine["with_rim"] < its["with_rim"] for mine, its in both)
    print(f"with the rim on {rims}, ", end="")
    print(f"{min(times):.1f} to {max(times):.1f} times its time, at most {SLOWER:.0f} times on {fast}")


# ---- program -------------------------------------------------------------------------------------------


def pair(text: str) -> tuple[int, int]:
    quads, triangles = text.split(":")
    return int(quads), int(triangles)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", type=pair, nargs="*", default=list(SIZES), help="none: left out")
    parser.add_argument("--shapes", choices=ANALYTIC, nargs="*", default=list(SHAPES), help="of the sizes")
    parser.add_argument("--kinds", choices=KINDS, nargs="*", default=list(KINDS), help="of the sizes")
    parser.add_argument("--quads", type=int, default=700, help="for the comparison")
    parser.add_argument("--surfaces", nargs="*", default=available(), help="none: left out")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--child", nargs=4, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    if arguments.child:
        shape, kind, count, triangles = arguments.child
        return child(shape, kind, int(count), int(triangles))
    both = [(shape, kind) for shape in arguments.shapes for kind in arguments.kinds]
    result = {
        "sizes": {f"{shape}, {kind}": growth(shape, kind, arguments.sizes) for shape, kind in both if arguments.sizes},
        "surfaces": compare(arguments.surfaces, arguments.quads) if arguments.surfaces else {},
    }
    if arguments.json:
        arguments.json.write_text(json.dumps(result, indent=1) + "\n")


if __name__ == "__main__":
    main()
