"""Principal edges of triangle meshes: which they are, the stars and polylines they make, and strips along them.

In a principal-symmetric mesh (paper section 2.3) one third of the edges follows principal curvature lines and the
others lie symmetrically to them. :class:`PrincipalEdges` says which third that is.
"""

from .developable_strips import DevelopableStrips as DevelopableStrips
from .directions import LARGE_MISALIGNMENT as LARGE_MISALIGNMENT
from .directions import AlignedEdges as AlignedEdges
from .directions import fitted_directions as fitted_directions
from .directions import misalignment_of as misalignment_of
from .directions import principal_edges_from_directions as principal_edges_from_directions
from .labels import principal_edges_from_seed as principal_edges_from_seed
from .labels import principal_edges_of_lattice as principal_edges_of_lattice
from .principal_edges import PrincipalEdges as PrincipalEdges
from .principal_edges import PrincipalStars as PrincipalStars
from .quads import half_shifted as half_shifted
from .quads import triangles_from_quads as triangles_from_quads
from .spheres import StarSpheres as StarSpheres
from .spheres import principal_normals as principal_normals
from .spheres import star_spheres as star_spheres
from .strip_files import save_strips_dxf as save_strips_dxf
from .strip_files import save_strips_obj as save_strips_obj
from .strip_files import save_strips_svg as save_strips_svg
from .strip_limits import StripLimits as StripLimits
from .strip_limits import strip_limits as strip_limits
from .strips import developable_strips as developable_strips
from .support_structure import SupportStructure as SupportStructure
from .support_structure import support_structure as support_structure
