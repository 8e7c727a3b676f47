"""The parts of torchfair stand on floors and use what is below; only the program itself knows the command line."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
FLOORS = (
    {"errors", "_interrupts", "_loading", "_memory", "_precision", "_short_repr", "_shown", "_solver_names", "_tables"}
    | {"_threads"},
    {
        "_names",
        "_numbers",
        "_ranges",
        "_reading_words",
        "_staged",
        "_portions",
        "_remembered",
        "_tracing",
        "cameras",
        "linear",
        "progress",
        "rasterisation",
    },
    {"_atomic", "_face_hints", "_mesh_sizes", "_mesh_sums", "_packed_tensors", "_side_by_side", "settings"},
    {"_half_edges", "_joined_tables", "_sorted_keys"},
    {"_fans", "_paired_half_edges", "projection"},
    {"_connectivity"},
    {"_topology_tables"},
    {"_joined_topology"},
    {"topology"},
    {"_graph"},
    {"_one_mesh", "batches", "boundary", "geometry", "polylines", "repair", "triangulation"},
    {
        "_embedded_stars",
        "_exact_triangles",
        "conversions",
        "creases",
        "curves",
        "energies",
        "io",
        "normalisation",
        "shapes",
        "subdivision",
    },
    {"fields", "principal", "reflection", "self_intersections", "stars"},
    {"constraints", "measuring", "meshing", "viewing"},
    {"formfinding"},
    {"design"},
    {"cli"},
)
FLOOR = {room: number for number, rooms in enumerate(FLOORS) for room in rooms}
MODULES = sorted((ROOT / "torchfair").rglob("*.py"))
SCRIPTS = [path for folder in ("experiments", "benchmarks", "docs") for path in sorted((ROOT / folder).rglob("*.py"))]


def room_of(path: Path) -> str:
    return path.relative_to(ROOT / "torchfair").parts[0].removesuffix(".py")


def imports(path: Path) -> Iterator[str]:
    """First names below ``torchfair`` of everything that a file imports, inside functions and for types, too."""
    package = path.relative_to(ROOT).parts[:-1]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        names: list[tuple[str, ...]] = []
        if isinstance(node, ast.Import):
            names = [tuple(alias.name.split(".")) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            start = package[: len(package) - node.level + 1] if node.level else ()
            start += tuple(node.module.split(".")) if node.module else ()
            names = [(*start, alias.name) for alias in node.names]
        yield from (name[1] for name in names if name[0] == "torchfair" and len(name) > 1)


@pytest.mark.parametrize("room", sorted({room_of(path) for path in MODULES} - {"__init__", "__main__"}))
def test_a_room_uses_lower_floors_only(room: str) -> None:
    assert room in FLOOR, f"{room} has no floor yet: give it one"
    used = {name for path in MODULES if room_of(path) == room for name in imports(path)} - {room, "__version__"}
    assert used <= FLOOR.keys()
    assert {name for name in used if FLOOR[name] >= FLOOR[room]} == set()


def test_every_floor_is_in_use() -> None:
    assert {room_of(path) for path in MODULES} >= FLOOR.keys()


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.name)
def test_scripts_import_no_command_line(path: Path) -> None:
    """What they need, such as measuring, reports and progress, is library."""
    assert "cli" not in set(imports(path))


def test_scripts_are_found() -> None:
    assert {"_common.py", "reflection_sheet.py", "bench_reflection.py"} <= {path.name for path in SCRIPTS}
