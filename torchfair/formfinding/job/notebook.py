"""A result as a notebook shows it: figures, promises and a picture."""

from __future__ import annotations

import base64
import html
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from ...errors import TorchfairError

if TYPE_CHECKING:
    from .result import JobResult, L

_MOST_FACES = 100_000  # of a mesh that is drawn
_FIRST = ("normal_variation", "total_absolute_curvature", "angle_variation", "smallest_angle_degrees", "area")


def result_html(result: JobResult[L]) -> str:
    """HTML of a result: a table of figures before and after, what was promised, why it ended, and the mesh.

    Edges of the picture are coloured by ``l |a|``. There is none of meshes of more than 100 000 faces.
    """
    rows = "".join(_row(key, result.before, result.after) for key in _keys(result))
    promises = "".join(f"<li>{html.escape(str(promise))}</li>" for promise in result.promises)
    notes = "".join(f"<li>{html.escape(note)}</li>" for note in result.notes)
    return (
        f"<div><p>{html.escape(repr(result))}</p>{_picture(result)}"
        f"<table><thead><tr><th></th><th>before</th><th>after</th></tr></thead><tbody>{rows}</tbody></table>"
        f"<ul>{promises}{notes}</ul><p>{html.escape(result.message)}</p></div>"
    )


def _keys(result: JobResult[L]) -> list[str]:
    both = [key for key in result.after if key in result.before]
    return [*(key for key in _FIRST if key in both), *(key for key in both if key not in _FIRST)]


def _row(key: str, before: Mapping[str, float], after: Mapping[str, float]) -> str:
    values = "".join(f"<td>{before_or_after[key]:.5g}</td>" for before_or_after in (before, after))
    return f"<tr><th>{html.escape(key.replace('_', ' '))}</th>{values}</tr>"


def _picture(result: JobResult[L]) -> str:
    """The mesh, as part of the page."""
    if result.topology.num_faces > _MOST_FACES:
        return ""
    from ...viewing import picture_edges

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "edges.png"
        try:
            picture_edges(file, {"result": result.vertices}, result.topology, width=800)
        except TorchfairError as error:
            return f"<p>no picture: {html.escape(str(error))}</p>"
        data = base64.b64encode(file.read_bytes()).decode()
    return f'<img alt="the mesh, edges by their length times their angle" src="data:image/png;base64,{data}">'
