"""Subdivision of polygon meshes as sparse linear maps that carry labels along."""

from .catmull_clark import catmull_clark as catmull_clark
from .hybrid import hybrid as hybrid
from .interpolation import interpolate_vertices as interpolate_vertices
from .interpolation import near as near
from .loop import loop as loop
from .midpoint import midpoint as midpoint
from .refine import refine as refine
from .refinement import Origin as Origin
from .refinement import Refinement as Refinement
