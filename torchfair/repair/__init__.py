"""Repair of polygon lists until they are an oriented manifold mesh.

One repair per file, each from a :class:`~torchfair.repair.soup.Soup` to another one; :func:`repair_mesh` does them one
after the other and keeps account of what became of every vertex, face and corner.
"""

from .packed import repair_packed as repair_packed
from .packed import weld_packed as weld_packed
from .packed import weld_soup as weld_soup
from .repair_mesh import repair_mesh as repair_mesh
from .result import RepairedMesh as RepairedMesh
from .seams import coincident_edges as coincident_edges
