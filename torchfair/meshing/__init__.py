"""Principal meshing: from a surface to quads and triangles along its principal curvature lines."""

from ..settings.meshing_settings import MeshingSettings as MeshingSettings
from .mesh_creases import MeshCreases as MeshCreases
from .no_mesh import NoMeshError as NoMeshError
from .principal_quads import principal_quads as principal_quads
from .principal_triangles import principal_triangles as principal_triangles
from .quad_mesh import QuadMesh as QuadMesh
from .report import measure_mesh_on as measure_mesh_on
from .triangle_mesh import TriangleMesh as TriangleMesh
