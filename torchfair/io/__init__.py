"""Polygon meshes in and out of files.

:func:`load_mesh` and :func:`save_mesh` choose the format by the extension: OBJ, OFF and PLY are read and
written here and keep polygons, order and orientation; other formats go through trimesh, which is imported
only then. Marked edges, such as principal ones, are line elements of an OBJ file or stand in a JSON file.
Results and reports are JSON that every reader accepts. Files appear whole or not at all, together where they belong
together.
"""

from .._atomic import atomic_write_bytes as atomic_write_bytes
from .._atomic import atomic_write_text as atomic_write_text
from .._atomic import written_together as written_together
from .curve_points import CurvePoints as CurvePoints
from .curve_points import load_curve as load_curve
from .curve_points import load_curves as load_curves
from .edge_labels import edge_labels_path as edge_labels_path
from .edge_labels import load_edge_labels as load_edge_labels
from .edge_labels import save_edge_labels as save_edge_labels
from .json_text import plain as plain
from .json_text import to_json as to_json
from .obj_attributes import ObjAttributes as ObjAttributes
from .polygon_mesh import PolygonMesh as PolygonMesh
from .reading import load_mesh as load_mesh
from .report import versions as versions
from .report import write_report as write_report
from .rhino_parts import RhinoParts as RhinoParts
from .writing import numbers_from as numbers_from
from .writing import save_mesh as save_mesh
