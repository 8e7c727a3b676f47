"""Ready-made terms for guided projection. Each file holds one idea: a stencil, an element residual, a weight."""

from .absolute_curvature import absolute_curvature_terms as absolute_curvature_terms
from .along_directions import along_directions as along_directions
from .barrier import barrier as barrier
from .closeness import closeness_terms as closeness_terms
from .closeness import distance_limit_terms as distance_limit_terms
from .element_quality import corner_angle_terms as corner_angle_terms
from .element_quality import face_area_terms as face_area_terms
from .fairness import boundary_fairness_terms as boundary_fairness_terms
from .fairness import displacement_fairness_terms as displacement_fairness_terms
from .fairness import even_fairness_terms as even_fairness_terms
from .fairness import interior_fairness_terms as interior_fairness_terms
from .fairness import tangential_fairness_terms as tangential_fairness_terms
from .gliding import gliding_terms as gliding_terms
from .handles import handle_terms as handle_terms
from .normal_variation import normal_variation_terms as normal_variation_terms
from .planarity import planarity_terms as planarity_terms
from .principal_symmetric import between_stars as between_stars
from .principal_symmetric import coplanar_terms as coplanar_terms
from .principal_symmetric import cospherical_terms as cospherical_terms
from .principal_symmetric import sphere_blocks as sphere_blocks
from .saddle_sides import SaddleSides as SaddleSides
from .stars import pyramid_terms as pyramid_terms
from .stars import saddle_terms as saddle_terms
from .tangent_planes import BoundaryNormals as BoundaryNormals
from .tangent_planes import tangent_plane_terms as tangent_plane_terms
