"""Principal meshing: from a surface to quads along its principal curvature lines."""

from .ladder import NoMeshError as NoMeshError
from .principal_quads import principal_quads as principal_quads
from .quad_mesh import QuadMesh as QuadMesh
from .settings import MeshingSettings as MeshingSettings
