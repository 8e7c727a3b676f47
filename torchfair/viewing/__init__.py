"""Pictures of meshes without a display: PNG files from a z-buffer in torch; matplotlib sets the words.

Importing this package imports neither matplotlib nor PIL; they are loaded when a picture is written.
"""

from ..rasterisation.rasterise import Fragments as Fragments
from ..rasterisation.rasterise import rasterise as rasterise
from .camera import fit_camera as fit_camera
from .chosen_view import chosen_view as chosen_view
from .lines import EdgeStyle as EdgeStyle
from .picture_before_after import picture_before_after as picture_before_after
from .picture_curvature import picture_curvature as picture_curvature
from .picture_edges import picture_edges as picture_edges
from .picture_gauss_image import picture_gauss_image as picture_gauss_image
from .picture_gauss_images import picture_gauss_images as picture_gauss_images
from .picture_labels import picture_labels as picture_labels
from .picture_mesh import picture_mesh as picture_mesh
from .picture_principal_edges import picture_principal_edges as picture_principal_edges
from .picture_principal_mesh import picture_principal_mesh as picture_principal_mesh
from .picture_pyramids import picture_pyramids as picture_pyramids
from .picture_reflections import picture_reflection_differences as picture_reflection_differences
from .picture_reflections import picture_reflections as picture_reflections
from .picture_star_classes import picture_star_classes as picture_star_classes
from .render import MeshView as MeshView
from .turntable import turntable as turntable
from .view_direction import ViewDirection as ViewDirection
from .view_direction import view_direction as view_direction
