"""Meshes of other libraries, from and to, by their attributes: none of them is imported.

``from_NAME`` reads an object of the library, ``as_NAME`` gives the arguments that make one. Tensors keep their
derivatives and devices; vertices keep their dtype.
"""

from .compas import as_compas as as_compas
from .compas import from_compas as from_compas
from .kaolin import as_kaolin as as_kaolin
from .kaolin import from_kaolin as from_kaolin
from .pytorch3d import as_pytorch3d as as_pytorch3d
from .pytorch3d import from_pytorch3d as from_pytorch3d
from .torch_geometric import as_torch_geometric as as_torch_geometric
from .torch_geometric import from_torch_geometric as from_torch_geometric
from .trimesh import as_trimesh as as_trimesh
from .trimesh import from_trimesh as from_trimesh
