"""``torchfair reflect``: how smooth a mesh looks as a mirror."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..progress import phase
from .arguments import count, positive_count, positive_or_none
from .errors import CommandError
from .exit_codes import EXIT_NOT_REACHED, EXIT_OK
from .inputs import add_repair, read_input
from .reading import said_of
from .several import add_inputs
from .told_files import told_files, written_with_report
from .views import add_views, view_of

if TYPE_CHECKING:
    from ..cameras import Camera
    from ..io import PolygonMesh
    from ..reflection import ReflectionScore
    from ..viewing import ViewDirection

NAME = "torchfair reflect"
REPORT = "reflection.json"
PICTURES = ("views.png", "differences.png")
TURNTABLE = "turntable.gif"
_LEAST_SIZE = 16
_LARGEST_FRAME = 256
_FRAMES, _MANY_FACES = 24, 500_000
_DESCRIPTION = (
    "Renders a polygon mesh as a mirror, every face plane, among stripes, and compares the pictures with those of a "
    "smooth surface: the reference, or the same mesh smoothly shaded. The score is 1 - SSIM, averaged over views and "
    "stripe directions: 0 for the picture of the smooth surface."
)
_LEAST_COMPARED = 0.2  # of what is seen of the mesh
_NOTHING = (
    "nothing to compare: no view shows mesh and reference together on more than a few pixels, so there is no score"
)
_ROWS = {
    "score": "score (1 - SSIM; 0 is smooth)",
    "reflection_variation": "reflection variation (over the root of the area)",
    "rms": "error of the mirrored direction (rms)",
    "wobble": "  what is left of it beyond one edge length",
}


def add_parser(subparsers: Any) -> None:
    """Adds ``reflect`` to the commands."""
    parser: argparse.ArgumentParser = subparsers.add_parser(
        "reflect", help="judge a mesh by its reflections", description=_DESCRIPTION, allow_abbrev=False
    )
    add = parser.add_argument
    add_inputs(parser, "mesh file (OBJ, OFF, PLY, STL, 3DM, DXF; GLB, ... through trimesh), or a built-in example:NAME")
    add("--reference", metavar="FILE", help="smooth surface to compare with: a fine mesh, mirrored with its vertex "
        "normals (default: the input itself)")  # fmt: skip
    add("--json", action="store_true", help="print one JSON object instead of a table, a line for each of several "
        "inputs")  # fmt: skip
    add("-o", "--output", metavar="FOLDER", help=f"folder for NAME.{REPORT}, pictures and a turntable; nothing is "
        "written without it")  # fmt: skip
    add("--size", type=positive_count, default=256, metavar="PIXELS", help="pixels along a picture (default 256)")
    add("--frequency", type=positive_or_none, default=None, metavar="F", help="stripe pairs per unit of the mirrored "
        "direction (default: such that the smooth surface shows about four)")  # fmt: skip
    add("--frames", type=count, default=None, metavar="N", help=f"pictures of the turntable, 0 for none (default "
        f"{_FRAMES}; none of more than {_MANY_FACES} faces, which take a second or more for each)")  # fmt: skip
    add("--no-pictures", action="store_true", help="write no pictures and no turntable")
    add_views(parser, label=False, view="score and pictures of this view alone")
    add("--force", action="store_true", help="replace files that exist")
    add_repair(parser)
    parser.set_defaults(run=run, name=NAME, output_is_folder=True, keeps_memory=True)


def run(arguments: argparse.Namespace) -> int:
    """Checks what can be checked first, then reads, renders, writes and prints."""
    from .._threads import threads_for

    files = _files(arguments)
    if arguments.size < _LEAST_SIZE:
        raise CommandError(f"--size {arguments.size}: pictures need at least {_LEAST_SIZE} pixels to be compared")
    mesh = read_input(arguments.input, arguments)
    reference = read_input(arguments.reference, arguments) if arguments.reference else None
    if arguments.frames is None:
        arguments.frames = _FRAMES if mesh.topology.num_faces <= _MANY_FACES else 0
        if files and not arguments.frames and not arguments.no_pictures:
            files = _files(arguments)
            print(f"{NAME}: no turntable is drawn of so many faces; --frames {_FRAMES} does", file=sys.stderr)
    with threads_for(0, mesh.vertices.device):  # pictures of this size are made of very short operations
        view = view_of(arguments, mesh)
        with phase("comparing reflections"):
            score = _score(mesh, reference, view, arguments)
        report: dict[str, Any] = dict(score.numbers())
        report |= _compared(score) | {
            "file": arguments.input,
            "reference": arguments.reference,
            "repairs": list(mesh.repairs),
            "notes": list(mesh.notes),
        }
        if files:
            write(files, mesh, score, view, report, arguments)
    if arguments.json:
        from ..io import to_json

        sys.stdout.write(to_json(report))
        return _ended(report)
    for line in [*said_of(mesh), *(said_of(reference, arguments.reference) if reference else [])]:
        print(line)
    print(f"{arguments.input}\n{format_numbers(report)}")
    print("".join(f"wrote {path}\n" for path in files), end="")
    return _ended(report)


def _compared(score: ReflectionScore) -> dict[str, Any]:
    """How much of the mesh was compared; where that is nothing, scores that are none."""
    seen = float((score.coverage > 0.0).sum())
    part = float(score.window.sum()) / seen if seen else 0.0
    found: dict[str, Any] = {"compared_of_mesh": part}
    if not part:
        return found | dict.fromkeys(_ROWS)
    shown = score.compared > 0.0
    by_view = zip(score.per_view.mean(-1).tolist(), shown.tolist(), strict=True)
    return found | {"score_by_view": [value if known else None for value, known in by_view]}


def _ended(report: dict[str, Any]) -> int:
    """The exit code; says on stderr what is wrong with the score."""
    part = report["compared_of_mesh"]
    if report["score"] is None:
        print(f"{NAME}: {_NOTHING}; are both in one unit and place?", file=sys.stderr)
        return EXIT_NOT_REACHED
    if part < _LEAST_COMPARED:
        print(
            f"{NAME}: warning: only {100.0 * part:.2g} % of what is seen of the mesh was compared: the score says "
            "little (is the reference in the same place? are parts thinner than a few pixels? raise --size)",
            file=sys.stderr,
        )
    return EXIT_OK


def format_numbers(report: dict[str, Any]) -> str:
    """The four numbers and the scores of the views as lines of text."""
    width = max(map(len, _ROWS.values()))
    lines = ["", *(f"  {label:<{width}}  {_number(report[key]):>9}" for key, label in _ROWS.items())]
    if report["score"] is None:
        return "\n".join([*lines, "", _NOTHING])
    lines += ["", "score by view, and the part of the picture that was compared"]
    views = zip(report["score_by_view"], report["compared"].tolist(), strict=True)
    lines += [f"  {view + 1:>3}  {_number(value):>9}  {100 * part:>5.1f} %" for view, (value, part) in enumerate(views)]
    return "\n".join(lines)


def _number(value: Any) -> str:
    return "-" if value is None else f"{float(value):.4g}"


def write(
    files: list[Path],
    mesh: PolygonMesh,
    score: ReflectionScore,
    view: ViewDirection | None,
    report: dict[str, Any],
    arguments: argparse.Namespace,
) -> None:
    """Writes report and pictures, all or nothing, then the turntable, which takes long."""
    pictures, films = files[1:3], files[3:]
    with written_with_report(files, report, arguments, later=films):
        if pictures:
            from ..viewing.picture_reflections import picture_reflection_differences, picture_reflections

            name = Path(arguments.input).name
            with phase("drawing pictures"):
                picture_reflections(pictures[0], score, name, overwrite=arguments.force)
                picture_reflection_differences(pictures[1], score, name, overwrite=arguments.force)
    for film in films:
        from ..progress import frame_progress
        from ..viewing.turntable import turntable

        with frame_progress(arguments.frames, "turntable") as progress:
            turntable(
                film, mesh.vertices, mesh.topology, score.setup.reference,
                up=None if view is None else view.up, frames=arguments.frames,
                size=min(arguments.size, _LARGEST_FRAME), progress=progress,
                overwrite=arguments.force,
            )  # fmt: skip


def _score(
    mesh: PolygonMesh, reference: PolygonMesh | None, view: ViewDirection | None, arguments: argparse.Namespace
) -> ReflectionScore:
    from ..reflection import reflection_score

    return reflection_score(
        mesh.vertices,
        mesh.topology,
        None if reference is None else (reference.vertices, reference.topology),
        camera=None if view is None else _camera(mesh if reference is None else reference, view, arguments),
        frequency=arguments.frequency,
        size=arguments.size,
    )


def _camera(smooth: PolygonMesh, view: ViewDirection, arguments: argparse.Namespace) -> Camera:
    """The one view that is asked for, or the usual ones with something else up."""
    from ..cameras import OrthographicCamera
    from ..reflection import SmoothReference, default_camera

    if arguments.view is None:
        return default_camera(SmoothReference.of_mesh(smooth.vertices, smooth.topology), view.up)
    points = smooth.vertices[smooth.topology.corners]
    return OrthographicCamera.fit(points, directions=-view.towards_eye, ups=view.up)


def _files(arguments: argparse.Namespace) -> list[Path]:
    """The files to write, the report first; refuses those that exist."""
    pictures = () if arguments.no_pictures else (*PICTURES, *(() if arguments.frames == 0 else (TURNTABLE,)))
    return told_files(arguments, (REPORT, *pictures))
