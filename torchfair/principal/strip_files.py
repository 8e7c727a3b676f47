"""Strips to files: OBJ with texture coordinates, SVG and DXF drawings."""

from __future__ import annotations

import importlib.util
import io
import os
from pathlib import Path

from ..errors import MeshFileError, TorchfairError
from ..io import atomic_write_bytes, atomic_write_text
from ..io.text_rows import vertex_lines
from ._strip_drawing import StripDrawing, draw_strips
from .developable_strips import DevelopableStrips

_CUT, _SCORE, _LABEL = "#ff0000", "#0000ff", "#000000"
_SHEET = "#999999"
_CUT_COLOR, _SCORE_COLOR, _LABEL_COLOR, _SHEET_COLOR = 1, 5, 7, 8  # the same as DXF color indices


def save_strips_obj(path: str | os.PathLike[str], strips: DevelopableStrips, *, overwrite: bool = False) -> None:
    """Writes strips in space, with their places on the sheet as texture coordinates ``vt``.

    Each strip is a group named after it, such as ``strip_3b``. Texture coordinates are lengths in the unit of the
    vertices, not scaled to 0..1. The file appears whole or not at all.

    Raises:
        TorchfairError: if there are no strips.
        MeshFileError: if the extension is not .obj or the file cannot be written.
    """
    path = _checked(path, ".obj")
    if not strips.names:
        raise TorchfairError("there are no strips to write")
    places = "".join(f"vt {u!r} {v!r}\n" for u, v in strips.uv.tolist())
    parts = [vertex_lines(strips.vertices.numpy(), "v "), places]
    quads = [
        " ".join(f"{corner}/{corner}" for corner in quad) for quad in (strips.topology.corners.view(-1, 4) + 1).tolist()
    ]
    first = 0
    for name, rulings in zip(strips.names, strips.offsets.diff().tolist(), strict=True):
        parts += [f"g strip_{name}\n", *(f"f {quad}\n" for quad in quads[first : first + rulings - 1])]
        first += rulings - 1
    atomic_write_text(path, "".join(parts), overwrite=overwrite)


def save_strips_svg(
    path: str | os.PathLike[str], strips: DevelopableStrips, *, millimetres: float = 1.0, overwrite: bool = False
) -> None:
    """Draws the sheet with the strips, true to scale: the unit of the drawing is the millimetre.

    Group ``cut`` (red) holds the closed outlines, ``score`` (blue) the rulings inside the strips, along which they
    are folded or bent, and ``label`` (black) the names, such as #3b, along the polylines and upright: vertex
    normals point to their top, or to their foot where a v stands behind. Lines are a 1500th of the longer side of a
    sheet wide. Where there are several sheets, group ``sheet`` (grey) holds their rims.
    The y axis of the strips points upwards, as in the file of :func:`save_strips_dxf`.

    Args:
        path: the file, with the extension .svg.
        strips: the strips.
        millimetres: length in the drawing of one unit of length of the strips.
        overwrite: whether an existing file may be replaced.

    Raises:
        TorchfairError: if ``millimetres`` is not positive or there are no strips.
        MeshFileError: if the extension is another one or the file cannot be written.
    """
    path = _checked(path, ".svg")
    atomic_write_text(path, _svg(draw_strips(strips, millimetres)), overwrite=overwrite)


def save_strips_dxf(
    path: str | os.PathLike[str], strips: DevelopableStrips, *, millimetres: float = 1.0, overwrite: bool = False
) -> None:
    """As :func:`save_strips_svg`, in DXF (AutoCAD 2010) by the package ezdxf, ``pip install 'torchfair[dxf]'``.

    Layers CUT, SCORE and LABEL hold closed LWPOLYLINE, LINE and TEXT entities, SHEET the rims of several sheets; the
    unit is the millimetre.

    Raises:
        TorchfairError: if ezdxf is missing, ``millimetres`` is not positive or there are no strips.
        MeshFileError: if the extension is not .dxf or the file cannot be written.
    """
    path = _checked(path, ".dxf")
    drawing = draw_strips(strips, millimetres)
    if importlib.util.find_spec("ezdxf") is None:
        raise TorchfairError("DXF files need ezdxf: pip install 'torchfair[dxf]'. SVG files do without")
    atomic_write_bytes(path, _dxf(drawing), overwrite=overwrite)


def _checked(path: str | os.PathLike[str], suffix: str) -> Path:
    path = Path(path)
    if path.suffix.lower() != suffix:
        raise MeshFileError(path, f"expected a file name that ends in {suffix}")
    return path


def _svg(drawing: StripDrawing) -> str:
    width, height = drawing.size
    stroke = f"{drawing.stroke:.4g}"

    def point(x: float, y: float) -> str:
        return f"{x:.12g},{height - y:.12g}"

    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.12g}mm" height="{height:.12g}mm" '
        f'viewBox="0 0 {width:.12g} {height:.12g}">',
        *_svg_sheets(drawing),
        f'<g id="cut" fill="none" stroke="{_CUT}" stroke-width="{stroke}">',
        *(f'<path d="M{" ".join(point(x, y) for x, y in line.tolist())}Z"/>' for line in drawing.outlines),
        f'</g>\n<g id="score" fill="none" stroke="{_SCORE}" stroke-width="{stroke}">',
        *(f'<path d="M{point(*a)} {point(*b)}"/>' for a, b in drawing.scores.tolist()),
        f'</g>\n<g id="label" fill="{_LABEL}" font-family="sans-serif" text-anchor="middle">',
    ]
    for text, (x, y), angle, size in drawing.labels:
        turn = f"translate({point(x, y)}) rotate({-angle:.6g})"
        lines.append(f'<text transform="{turn}" y="{0.35 * size:.6g}" font-size="{size:.6g}">{text}</text>')
    return "\n".join([*lines, "</g>\n</svg>\n"])


def _svg_sheets(drawing: StripDrawing) -> list[str]:
    """The rims of sheets, if there are several."""
    if drawing.sheets == 1:
        return []
    (width, height), stroke = drawing.size, f"{drawing.stroke:.4g}"
    high = height / drawing.sheets
    rims = [
        f'<rect x="0" y="{number * high:.12g}" width="{width:.12g}" height="{high:.12g}"/>'
        for number in range(drawing.sheets)
    ]
    return [f'<g id="sheet" fill="none" stroke="{_SHEET}" stroke-width="{stroke}">', *rims, "</g>"]


def _dxf(drawing: StripDrawing) -> bytes:
    from ezdxf import units
    from ezdxf.enums import TextEntityAlignment
    from ezdxf.filemanagement import new as new_document

    document = new_document("R2010", units=units.MM)
    for layer, color in (("CUT", _CUT_COLOR), ("SCORE", _SCORE_COLOR), ("LABEL", _LABEL_COLOR)):
        document.layers.add(layer, color=color)
    space = document.modelspace()
    if drawing.sheets > 1:
        document.layers.add("SHEET", color=_SHEET_COLOR)
    width, high = drawing.size[0], drawing.size[1] / drawing.sheets
    for number in range(drawing.sheets if drawing.sheets > 1 else 0):
        low = number * high
        rim = [(0.0, low), (width, low), (width, low + high), (0.0, low + high)]
        space.add_lwpolyline(rim, close=True, dxfattribs={"layer": "SHEET"})
    for line in drawing.outlines:
        space.add_lwpolyline(line.tolist(), close=True, dxfattribs={"layer": "CUT"})
    for a, b in drawing.scores.tolist():
        space.add_line(a, b, dxfattribs={"layer": "SCORE"})
    for text, place, angle, size in drawing.labels:
        entity = space.add_text(text, height=size, rotation=angle, dxfattribs={"layer": "LABEL"})
        entity.set_placement(place, align=TextEntityAlignment.MIDDLE_CENTER)
    stream = io.StringIO()
    document.write(stream)
    return stream.getvalue().encode(document.output_encoding)
