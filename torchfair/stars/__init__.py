"""Vertex stars: convex, saddle-shaped or neither; normal pyramids and the whole Gauss image (paper section 2)."""

from .arcs import arc_crossings as arc_crossings
from .classification import StarClasses as StarClasses
from .classification import StarKind as StarKind
from .classification import classify_stars as classify_stars
from .gauss_overlaps import GaussOverlaps as GaussOverlaps
from .gauss_overlaps import gauss_overlaps as gauss_overlaps
from .polar_dual import PolarDual as PolarDual
from .polar_dual import polar_dual as polar_dual
from .pyramid import normal_pyramid as normal_pyramid
from .pyramid import pyramid_perimeters as pyramid_perimeters
from .pyramid import pyramid_self_intersections as pyramid_self_intersections
from .pyramid import pyramid_windings as pyramid_windings
from .pyramid_penalty import PyramidPenalty as PyramidPenalty
from .pyramid_penalty import pyramid_penalty as pyramid_penalty
from .pyramid_penalty import pyramid_penalty_per_vertex as pyramid_penalty_per_vertex
from .saddle_penalty import SaddlePenalty as SaddlePenalty
from .saddle_penalty import saddle_penalty as saddle_penalty
from .saddle_penalty import saddle_penalty_per_vertex as saddle_penalty_per_vertex
