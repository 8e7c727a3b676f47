"""Fields of directions on triangle meshes: principal directions, crosses along them, and their singular vertices.

Arrays of NumPy, without gradients: what :mod:`torchfair.meshing` is built on, not an interface for users.
"""

from .direction_field import Pull as Pull
from .direction_field import Symmetry as Symmetry
from .direction_field import connection_laplacian as connection_laplacian
from .direction_field import direction_field as direction_field
from .direction_field import hermitian_solver as hermitian_solver
from .directions import Directions as Directions
from .directions import carried_directions as carried_directions
from .directions import directions_of as directions_of
from .directions import half_turns as half_turns
from .frames import FaceFrames as FaceFrames
from .matchings import loop_charges as loop_charges
from .matchings import matchings as matchings
from .matchings import vertex_charges as vertex_charges
from .merging import merge_singularities as merge_singularities
