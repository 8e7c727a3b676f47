"""``torchfair diagnose``: which vertex stars are bad, and what that does to the Gauss image."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..progress import phase
from .arguments import count
from .chosen_vertices import NUMBERS, ChosenVertices
from .errors import CommandError
from .inputs import add_repair, read_input
from .reading import said_of
from .several import add_inputs
from .told_files import told_files, written_with_report
from .views import LABELS, add_views, view_of

if TYPE_CHECKING:
    from ..io import PolygonMesh
    from ..measuring import Diagnosis
    from ..viewing import ViewDirection

NAME = "torchfair diagnose"
PICTURES = ("classes.png", "pyramids.png", "gauss_image.png")
COLORED = "classes.ply"
REPORT = "diagnosis.json"
_DESCRIPTION = (
    "Says of every inner vertex of a polygon mesh whether its star is convex, a good saddle, a bad saddle or neither, "
    "and where the face normals around a vertex form a self-intersecting pyramid."
)
_ROWS = {
    "convex": "convex",
    "flat": "  flat among them",
    "saddle": "saddle-shaped",
    "good_saddle": "  good saddles among them",
    "bad_saddle": "  bad saddles among them",
    "neither": "neither",
    "self_intersecting_pyramids": "normal pyramids that intersect themselves",
    "pyramid_self_intersections": "  self-intersections",
    "negative_angle_defects": "angle sum above 360 degrees",
    "neither_with_negative_angle_defect": "  neither convex nor saddle among them",
    "degenerate_stars": "stars with a face without area",
    "boundary_vertices": "boundary vertices (not judged)",
    "isolated_vertices": "vertices without a face (not judged)",
}

_PATTERNS = (
    ("saddles by edges above and below their best plane", "saddle_patterns"),
    ("inner vertices by edges above and below the plane at the vertex normal", "ordinary_patterns"),
)


def add_parser(subparsers: Any) -> None:
    """Adds ``diagnose`` to the commands."""
    parser: argparse.ArgumentParser = subparsers.add_parser(
        "diagnose", help="find bad saddles and folded normals", description=_DESCRIPTION, allow_abbrev=False
    )
    add = parser.add_argument
    add_inputs(parser, "mesh file (OBJ, OFF, PLY, STL, 3DM, DXF; GLB, ... through trimesh), or a built-in example:NAME")
    add("--json", action="store_true", help="print one JSON object instead of tables, a line for each of several "
        "inputs")  # fmt: skip
    add("--per-vertex", action="store_true", help="with --json or --output: list the class of every vertex")
    add("--worst", type=count, default=10, metavar="N", help="list the N worst vertices (default 10)")
    add(
        "-o", "--output", metavar="FOLDER", help=f"folder for NAME.{REPORT} and pictures; nothing is written without it"
    )
    add("--vertex", action="append", default=[], metavar="VERTEX ...", help="draw the normal pyramids of these "
        f"vertices: {NUMBERS}, or 'near X Y Z'; by default of the worst, then of some of each class")  # fmt: skip
    add_views(parser)
    add("--no-pictures", action="store_true", help="write no pictures")
    add("--force", action="store_true", help="replace files that exist")
    add_repair(parser)
    parser.set_defaults(run=run, name=NAME, output_is_folder=True, keeps_memory=True)


def run(arguments: argparse.Namespace) -> int:
    """Checks what can be checked first, then reads, judges, writes and prints."""
    from .._remembered import remembering
    from ..measuring import diagnose_mesh, layout_advice

    files = _files(arguments)
    mesh = read_input(arguments.input, arguments)
    chosen = ChosenVertices(mesh)
    drawn = _drawn(arguments, chosen)
    with remembering():
        with phase("judging stars"):
            diagnosis = diagnose_mesh(mesh.vertices, mesh.topology)
        numbers, worst = diagnosis.counts(), diagnosis.worst_vertices(arguments.worst)
        with phase("comparing edges with principal directions"):
            advice = layout_advice(mesh.vertices, mesh.topology, diagnosis, names=mesh.names)
    with phase("trying what mends the worst stars"):
        _explain(worst, mesh)
    report = {
        **numbers,
        "file": arguments.input,
        "repairs": list(mesh.repairs),
        "notes": list(mesh.notes),
        "worst_vertices": worst,
        "advice": advice,
    }
    if arguments.per_vertex:
        report["per_vertex"] = diagnosis.per_vertex()
    if files:
        write(files, mesh, diagnosis, report, drawn, arguments)
    if arguments.json:
        from ..io import to_json

        sys.stdout.write(to_json(report))
        return 0
    for line in [*said_of(mesh), *(f"note: {note}" for note in chosen.notes)]:
        print(line)
    print(f"{arguments.input}\n{format_counts(numbers)}")
    if worst:
        print(format_vertices(worst, mesh.names.first))
    if advice:
        print("\n".join(["", "advice", *(f"  {sentence}" for sentence in advice)]))
    print("".join(f"wrote {path}\n" for path in files), end="")
    return 0


def write(
    files: list[Path],
    mesh: PolygonMesh,
    diagnosis: Diagnosis,
    report: dict[str, Any],
    drawn: list[int],
    arguments: argparse.Namespace,
) -> None:
    """Writes report and pictures, all or nothing; ``drawn`` vertices have their pyramids drawn."""
    with written_with_report(files, report, arguments):
        if len(files) > 1:
            with phase("drawing pictures"):
                _draw(files[1:], mesh, diagnosis, report, drawn, view=view_of(arguments, mesh), force=arguments.force)


def _draw(
    files: list[Path],
    mesh: PolygonMesh,
    diagnosis: Diagnosis,
    report: dict[str, Any],
    drawn: list[int],
    *,
    view: ViewDirection | None,
    force: bool,
) -> None:
    from ..io import save_mesh
    from ..viewing.picture_gauss_image import picture_gauss_image
    from ..viewing.picture_labels import FEW, picture_labels
    from ..viewing.picture_pyramids import picture_pyramids
    from ..viewing.picture_star_classes import picture_star_classes, star_class_colors

    vertices, topology, classes, crossings = mesh.vertices, mesh.topology, diagnosis.classes, diagnosis.crossings
    overview, pyramids, sphere, colored, *labels = files
    picture_star_classes(overview, vertices, classes, crossings, view=view, overwrite=force)
    chosen = drawn or _instructive(diagnosis, report["worst_vertices"])
    picture_pyramids(pyramids, vertices, classes, crossings, chosen, names=mesh.names, overwrite=force)
    picture_gauss_image(sphere, vertices, topology, crossings, overwrite=force)
    for path in labels:
        shown = None if topology.num_vertices <= FEW else [row["vertex"] for row in report["worst_vertices"]]
        picture_labels(path, vertices, topology, shown, names=mesh.names, view=view, overwrite=force)
    colors = star_class_colors(classes)
    save_mesh(colored, vertices, topology, overwrite=force, binary=True, colors=colors)


def format_counts(numbers: dict[str, Any]) -> str:
    """Counts as lines of text, with the share of all inner vertices."""
    width = max(map(len, _ROWS.values()))
    inner = numbers["inner_vertices"]
    lines = ["", f"  {'inner vertices':<{width}}  {inner:>9}"]
    for key, label in _ROWS.items():
        share = "" if "not judged" in label or not inner else f"  {100 * numbers[key] / inner:5.1f} %"
        lines.append(f"  {label:<{width}}  {numbers[key]:>9}{share if key != 'pyramid_self_intersections' else ''}")
    crossings, between = numbers["gauss_image_crossings"], numbers["gauss_image_crossings_between_stars"]
    words = "not counted" if crossings is None else f"{crossings:>9}  ({between} of them between different stars)"
    lines.append(f"  {'crossings in the whole Gauss image':<{width}}  {words}")
    for title, key in _PATTERNS:
        shown = list(numbers[key].items())
        if shown:
            lines += ["", title]
            lines += [f"  {n:>9}  {_words(name)} ({name})" for name, n in shown[:8]]
            lines += [f"  {'':>9}  {len(shown) - 8} other patterns"] if len(shown) > 8 else []
    return "\n".join(lines)


def _words(name: str) -> str:
    """The pattern of that name in words."""
    from ..measuring import pattern_words

    return pattern_words([int(run) for run in name.split(",") if run.isdigit()])


def format_vertices(worst: list[dict[str, Any]], first_number: int = 0) -> str:
    """The worst vertices as a table, and what each of them needs."""
    lines = [
        "",
        f"worst vertices (numbers as in the file, from {first_number}; perimeter of the normal pyramid in degrees; "
        "edges above and below the plane at the normal)",
        f"  {'vertex':>9} {'valence':>8} {'class':>12} {'crossings':>10} {'perimeter':>10}  {'x y z':<32}  edges",
    ]
    for row in worst:
        place = "{:.6g} {:.6g} {:.6g}".format(*row["position"])
        lines.append(
            f"  {row['number_in_file']:>9} {row['valence']:>8} {row['class']:>12} "
            f"{row['self_intersections']:>10} {row['perimeter_degrees']:>10.4g}  {place:<32}  {row['pattern_words']}"
        )
        lines.append(f"  {'':>9} {_remedy_words(row['remedy'])}")
    return "\n".join(lines)


def _remedy_words(remedy: dict[str, Any] | None) -> str:
    if remedy is None:
        return "no slide of it and no flip of an edge beside it leaves fewer bad stars: see the advice for the mesh"
    return f"{remedy['words']}: bad stars here {remedy['bad_before']} -> {remedy['bad_after']}"


def _explain(worst: list[dict[str, Any]], mesh: PolygonMesh) -> None:
    """Adds to every vertex where it is, its number in the file, its pattern in words, and what it needs."""
    from ..measuring import pattern_words, star_remedies

    vertices = mesh.vertices.double()
    remedies = star_remedies(vertices, mesh.topology, [row["vertex"] for row in worst], names=mesh.names)
    for row, remedy in zip(worst, remedies, strict=True):
        vertex = row["vertex"]
        row["position"] = vertices[vertex].tolist()
        row["number_in_file"] = int(mesh.names.vertex(vertex))
        row["pattern_words"] = pattern_words(row["ordinary_pattern"], row["valence"])
        row["remedy"] = None if remedy is None else remedy.as_dict()


def _files(arguments: argparse.Namespace) -> list[Path]:
    """The files to write, the report first; refuses those that exist."""
    if arguments.output is None:
        if arguments.vertex:
            raise CommandError("--vertex draws a picture and needs a folder for it: --output FOLDER")
        return []
    pictures = () if arguments.no_pictures else (*PICTURES, COLORED, *([LABELS] if arguments.label else []))
    return told_files(arguments, (REPORT, *pictures))


def _drawn(arguments: argparse.Namespace, chosen: ChosenVertices) -> list[int]:
    """The vertices of ``--vertex``."""
    mesh = chosen.mesh
    found = [vertex for words in arguments.vertex for vertex in chosen.of("--vertex", words)]
    for vertex in found:
        if mesh.topology.is_boundary_vertex[vertex] or not mesh.topology.valences[vertex]:
            name = mesh.names.vertex(vertex)
            raise CommandError(f"--vertex {name}: it is not inside the mesh and has no normal pyramid")
    return found


def _instructive(diagnosis: Diagnosis, worst: list[dict[str, Any]]) -> list[int]:
    """The two worst vertices and some of each class, six in all if there are so many."""
    import torch

    from ..stars import StarKind

    classes = diagnosis.classes
    chosen = [row["vertex"] for row in worst[:2]]
    convex = classes.is_kind(StarKind.CONVEX) & ~classes.flat
    masks = ((classes.bad_saddles, 3), (classes.good, 5), (convex, 6), (classes.bad | convex, 6), (diagnosis.inner, 6))
    for mask, most in masks:
        found = torch.nonzero(mask).squeeze(1)
        others = [v for v in found[:: max(1, len(found) // 12)].tolist() if v not in chosen]
        chosen += others[: max(0, most - len(chosen))]
    return chosen
