"""Principal meshes of a whole collection of surfaces: how many are meshed, refused, broken, or take too long.

Run ``python benchmarks/bench_meshing_corpus.py [--kinds quads triangles planar] [--surfaces NAME ...] [--json FILE]``.

========  ===============================================================================================
surfaces  analytic ones as irregular triangles, others that are made here, and the files beside the project, if any
count     700 faces of surfaces with 3000 triangles, else 300; a name with ``:N`` at its end asks for N
process   every mesh in a process of its own, on one thread, that ends after 60 s of processor time
broken    a mesh that is returned is checked here: Euler number, loops, components, and no face that is turned over
planar    quads, then ``planar_quads``: largest planarity (target 1e-4), distance of vertices from the surface in edges
          (target 0.03, or as far as they were before), and mean angles before and after (target: 1 degree more)
========  ===============================================================================================
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import resource
import time
from collections import Counter
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import torch
from bench_meshing import FOLDER, Mesh

from torchfair import Topology, TorchfairError
from torchfair.formfinding import planar_quads
from torchfair.geometry import ReferenceSurface, face_centres, face_normals
from torchfair.io import load_mesh
from torchfair.meshing import QuadMesh, TriangleMesh, principal_quads, principal_triangles
from torchfair.meshing.verification import shape_of
from torchfair.shapes import EXAMPLES, SURFACES, PrincipalParaboloid, builtin_mesh, icosphere, irregular_triangles
from torchfair.triangulation import triangulate

KINDS = ("quads", "triangles", "planar")
LIMIT = 60
RATIO = "variation_over_curvature"
PLANAR, AWAY, TURNED = 1e-4, 0.03, 1.0  # planarity, distance in edges, degrees
_MANY = 3000  # triangles
_FOLDED = 0.01  # of the faces may look the other way than the surface next to them, at sharp edges


def height_field(height: Callable[[torch.Tensor, torch.Tensor], torch.Tensor]) -> Mesh:
    """A function of x and y over a square."""
    made = irregular_triangles(PrincipalParaboloid(1.0, -0.5), 1000)
    x, y = made.vertices.T[:2]
    return torch.stack([x, y, height(x, y)], 1), made.topology


def box(lines: int = 12) -> Mesh:
    """A box of edges 1, 0.8 and 0.6: each side is a lattice cut into triangles."""
    steps = torch.linspace(-0.5, 0.5, lines + 1, dtype=torch.float64)
    x, y = (of.reshape(-1) for of in torch.meshgrid(steps, steps, indexing="ij"))
    at = torch.arange((lines + 1) ** 2).reshape(lines + 1, lines + 1)
    a, b, c, d = (of.reshape(-1) for of in (at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]))
    faces = torch.cat([torch.stack([a, b, c], 1), torch.stack([a, c, d], 1)])
    half = torch.full_like(x, 0.5)
    sides = [torch.stack(of, 1).roll(turn, 1) for turn in range(3) for of in ((x, y, half), (y, x, -half))]
    points, corners = torch.cat(sides), torch.cat([faces + number * len(x) for number in range(6)])
    points, inverse = torch.unique((points * 1e6).round() / 1e6, dim=0, return_inverse=True)
    size = points.new_tensor([1.0, 0.8, 0.6])
    return points * size, Topology.from_faces(inverse[corners], len(points))


def ellipsoid() -> Mesh:
    """Of three different axes."""
    ball = icosphere(4)
    return ball.vertices * ball.vertices.new_tensor([1.0, 0.75, 0.5]), ball.topology


MADE: dict[str, Callable[[], Mesh]] = {
    "box": box,
    "ellipsoid": ellipsoid,
    "monkey saddle": lambda: height_field(lambda x, y: x**3 - 3 * x * y**2),
    "five-fold saddle": lambda: height_field(lambda x, y: 0.5 * (x**4 - 6 * x**2 * y**2 + y**4)),
    "waves": lambda: height_field(lambda x, y: 0.15 * torch.sin(4 * x) * torch.cos(3 * y)),
    "trough": lambda: height_field(lambda x, y: 0.5 * x**2 + 0.1 * y**3),
}


def collection() -> dict[str, Callable[[], Mesh]]:
    """All surfaces by name."""

    def named(name: str) -> Callable[[], Mesh]:
        return lambda: builtin_mesh(name)

    def read(path: Path) -> Callable[[], Mesh]:
        return lambda: (lambda mesh: (mesh.vertices, mesh.topology))(load_mesh(path))

    files = sorted(path for path in FOLDER.rglob("*") if path.suffix in {".obj", ".off"}) if FOLDER.exists() else []
    built_in = {name: named(name) for name in (*SURFACES, *EXAMPLES)}
    return built_in | MADE | {path.stem: read(path) for path in files}


# ---- one mesh ------------------------------------------------------------------------------------------


def fault(vertices: torch.Tensor, topology: Topology, surface: Mesh) -> str:
    """What is wrong with a mesh of a surface, in words; nothing if it is sound."""
    triangles = Topology.from_faces(triangulate(*surface).triangles, len(surface[0]))
    if shape_of(topology) != shape_of(triangles):
        return f"{shape_of(topology)} instead of {shape_of(triangles)}"
    if not vertices.isfinite().all():
        return "coordinates that are no numbers"
    nearest = ReferenceSurface(surface[0], triangles).closest(face_centres(vertices, topology))
    ahead = (face_normals(vertices, topology) * face_normals(surface[0], triangles)[nearest.faces]).sum(1)
    over = int((ahead < -0.5).sum())
    return f"{over} face(s) turned over" if over > _FOLDED * topology.num_faces else ""


def made(surface: Mesh, kind: str, count: int) -> dict[str, Any]:
    """The mesh of a kind, judged."""
    row: dict[str, Any] = {}
    mesh: QuadMesh | TriangleMesh
    if kind == "triangles":
        mesh = principal_triangles(*surface, count=count)
    else:
        mesh = quads = principal_quads(*surface, count=count)
    if kind == "planar":
        mesh, job = planar_quads(quads, surface)
        row = {"planarity": mesh.report["planarity_max"], "missed": [str(of) for of in job.promises if not of.holds]}
        row |= {"angle_before": quads.report["angle_mean_degrees"], "ratio_before": quads.report[RATIO]}
        row |= {"away": job.after["largest_distance_relative"], "away_before": job.before["largest_distance_relative"]}
    report = mesh.report
    row |= {
        "faces": report["faces"],
        "angle": report["angle_mean_degrees"],
        "ratio": report[RATIO],
    }
    row |= {"distance": report["distance_max"], "singular": report["singular"], "notes": mesh.notes}
    return row | {"fault": fault(mesh.vertices, mesh.topology, surface)}


def child(name: str, kind: str, count: int | None, answer: Connection) -> None:
    """Sends what came of a mesh."""
    resource.setrlimit(resource.RLIMIT_CPU, (LIMIT, LIMIT))
    torch.set_num_threads(1)
    begin = time.process_time()
    try:
        surface = collection()[name]()
        count = count or (700 if int((surface[1].face_sizes - 2).sum()) >= _MANY else 300)
        begin = time.process_time()
        row = made(surface, kind, count)
        row["end"] = "broken" if row["fault"] else "meshed"
    except TorchfairError as error:
        row = {"end": "refused" if "\n" not in str(error) else "broken", "why": str(error)}
    answer.send(row | {"asked": count, "seconds": time.process_time() - begin})


def run(name: str, kind: str, count: int | None) -> dict[str, Any]:
    """What came of a mesh in a process of its own."""
    context = multiprocessing.get_context("fork")
    ours, theirs = context.Pipe(duplex=False)
    process = context.Process(target=child, args=(name, kind, count, theirs))
    process.start()
    theirs.close()
    try:
        row: dict[str, Any] = ours.recv()
    except EOFError:
        row = {"end": "ended", "asked": count, "seconds": float("nan")}
    process.join()
    hang = row["end"] == "ended" and process.exitcode in {-9, -24}
    return row | ({"end": "hang", "seconds": float(LIMIT)} if hang else {})


def line(row: dict[str, Any]) -> str:
    """What came of a mesh, in words."""
    words = f"{row['end']:<8}{row['seconds']:7.1f} s"
    if "faces" not in row:
        return f"{words}  {row.get('why', '')}"
    angle, ratio = (f"{row[name]:7.2f}" if row[name] is not None else f"{'-':>7}" for name in ("angle", "ratio"))
    words += f"  {row['faces']:5} of {row['asked']:4}  angle {angle}  E/C {ratio}  distance {row['distance']:.3f}"
    if "planarity" in row:
        words += f"  planarity {row['planarity']:.1e}  vertices {row['away']:.3f} away  turned {turned(row):.2f}"
    return "  ".join([words, *filter(None, [row["fault"]]), *row.get("missed", []), *row["notes"]])


def turned(row: dict[str, Any]) -> float:
    """Degrees by which planar faces have turned edges away from directions; 0 where there are none."""
    before, after = row["angle_before"], row["angle"]
    return 0.0 if before is None or after is None else float(after - before)


def short_of(row: dict[str, Any]) -> list[str]:
    """The targets of planar quads that a mesh misses."""
    far = row["away"] > 1.0001 * max(AWAY, row["away_before"])
    missed = {"planarity": row["planarity"] > PLANAR, "distance": far, "angle": turned(row) > TURNED}
    return [name for name, is_missed in missed.items() if is_missed]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kinds", nargs="*", choices=KINDS, default=list(KINDS))
    parser.add_argument("--surfaces", nargs="*", default=list(collection()))
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    table: dict[str, dict[str, Any]] = {}
    for kind in arguments.kinds:
        table[kind] = {}
        for asked in arguments.surfaces:
            name, _, count = asked.partition(":")
            table[kind][asked] = row = run(name, kind, int(count) if count else None)
            print(f"{kind:<10}{asked:<26}{line(row)}", flush=True)
        ends = Counter(row["end"] for row in table[kind].values())
        print(f"{kind}: {len(table[kind])} surfaces, " + ", ".join(f"{count} {end}" for end, count in ends.items()))
        missed = {name: short_of(row) for name, row in table[kind].items() if "planarity" in row and short_of(row)}
        if kind == "planar":
            print(f"planar: targets missed by {missed or 'none'}")
        if arguments.json:
            arguments.json.write_text(json.dumps(table, indent=1) + "\n")


if __name__ == "__main__":
    main()
