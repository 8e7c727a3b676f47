"""Curves in drawings: line elements of OBJ files, DXF and 3DM files."""

from __future__ import annotations

import itertools
import math
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import MeshFileError, TorchfairError
from .obj import obj_words, read_vertices, statement_rows, vertex_numbers
from .raw_mesh import Floats
from .reading import read_bytes
from .rhino import rhino_model, rhino_package

_FINE = 1e-4  # of the extent of a drawing: chords of arcs and splines are as near to them
_SAMPLES = 200  # of a curve in a 3DM file that is no polyline


def obj_pieces(path: Path) -> list[Floats]:
    """Line elements ``l`` of an OBJ file, as points (n, 3)."""
    data = read_bytes(path)
    text = obj_words(path, data)
    vertex_rows, line_rows = statement_rows(path, text, (b"v",), (b"l",))
    if not line_rows.size:
        raise MeshFileError(path, "has no line elements (l) that could be a boundary curve")
    points = read_vertices(path, text, vertex_rows)
    numbers, sizes = vertex_numbers(path, text, vertex_rows, line_rows, slashes=b"/" in data, what="a point of a line")
    if numbers.size and not (numbers.min() >= 0 and numbers.max() < len(points)):
        raise MeshFileError(path, f"a line element names a vertex that does not exist: there are {len(points)}")
    return [points[piece] for piece in np.split(numbers, np.cumsum(sizes)[:-1])]


def dxf_pieces(path: Path) -> list[Floats]:
    """Lines, polylines, arcs, circles, ellipses and splines in the model space of a DXF file, as points (n, 3)."""
    try:
        import ezdxf
        from ezdxf.path import make_path
    except ImportError:
        raise TorchfairError("DXF files need ezdxf: pip install 'torchfair[dxf]'. Or save the curve as text") from None
    read_bytes(path)
    try:
        document = ezdxf.filemanagement.readfile(path)
    except (ezdxf.lldxf.const.DXFError, OSError, UnicodeDecodeError) as error:
        raise MeshFileError(path, f"is no DXF file that can be read: {error}") from None
    found = []
    for entity in document.modelspace():
        try:
            found.append((entity, make_path(entity)))
        except TypeError:  # texts, faces and the like
            continue
    found = [(entity, piece) for entity, piece in found if len(piece)]
    if not found:
        raise MeshFileError(path, "has no lines, polylines, arcs or splines in its model space")
    corners = np.array([tuple(vertex) for _, piece in found for vertex in piece.control_vertices()])
    fine = _FINE * float(np.ptp(corners, axis=0).max())
    # Arcs and splines themselves; paths are made of Bezier curves, which polylines with bulges come near to.
    places = [getattr(entity, "flattening", piece.flattening)(fine) for entity, piece in found]
    return [np.array([tuple(place) for place in piece]) for piece in places]


def rhino_pieces(path: Path) -> list[Floats]:
    """Curves of a 3DM file, as points (n, 3): the corners of polylines, others sampled from knot to knot."""
    rhino_package()
    read_bytes(path)
    rhino, model = rhino_model(path)
    found = [item.Geometry for item in model.Objects if isinstance(item.Geometry, rhino.Curve)]
    if not found:
        raise MeshFileError(path, "has no curves")
    pieces = []
    while found:
        curve = found.pop(0)
        if isinstance(curve, rhino.PolyCurve):
            found = [*map(curve.SegmentCurve, range(curve.SegmentCount)), *found]
        else:
            pieces.append(np.array([(place.X, place.Y, place.Z) for place in _rhino_places(curve)]))
    return pieces


def _rhino_places(curve: Any) -> list[Any]:
    """Points on one smooth curve or polyline of rhino3dm; it may have a corner at a knot."""
    polyline = curve.TryGetPolyline()
    if polyline is not None:
        return [polyline[i] for i in range(len(polyline))]
    start, end = curve.Domain.T0, curve.Domain.T1
    nurbs = curve.ToNurbsCurve()
    inner = {nurbs.Knots[i] for i in range(len(nurbs.Knots))} if nurbs is not None else set()
    stops = sorted({start, end, *(knot for knot in inner if start < knot < end)})
    places = [curve.PointAt(start)]
    for a, b in itertools.pairwise(stops):
        steps = math.ceil(_SAMPLES * (b - a) / (end - start))
        places += [curve.PointAt(t) for t in np.linspace(a, b, steps + 1)[1:].tolist()]
    return places
