"""Geometric quantities: pure functions ``(vertices, topology) -> tensor``, one per file."""

from .angles import angle_defects as angle_defects
from .angles import corner_angles as corner_angles
from .areas import face_area_vectors as face_area_vectors
from .areas import face_areas as face_areas
from .closest_curve_point import ClosestCurvePoints as ClosestCurvePoints
from .closest_curve_point import ReferenceCurve as ReferenceCurve
from .closest_curve_point import ReferenceCurves as ReferenceCurves
from .closest_point import ClosestPoints as ClosestPoints
from .closest_point import ClosestPointTracker as ClosestPointTracker
from .closest_point import ReferenceSurface as ReferenceSurface
from .dihedral import dihedral_angles as dihedral_angles
from .dual_edges import dual_edge_lengths as dual_edge_lengths
from .gauss_image import GaussImage as GaussImage
from .gauss_image import gauss_image as gauss_image
from .lengths import edge_lengths as edge_lengths
from .lengths import edge_vectors as edge_vectors
from .mean_curvature import mean_curvature_vectors as mean_curvature_vectors
from .normals import adjacent_normals as adjacent_normals
from .normals import degenerate_faces as degenerate_faces
from .normals import face_normals as face_normals
from .normals import vertex_normals as vertex_normals
from .planarity import planarity as planarity
from .polylines import second_differences as second_differences
from .shape_operator import shape_operators as shape_operators
from .umbrella import umbrella_vectors as umbrella_vectors
