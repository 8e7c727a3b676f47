"""Which triangle is seen where: shared by pictures of meshes and by reflections."""

from .rasterise import Fragments as Fragments
from .rasterise import interpolate as interpolate
from .rasterise import rasterise as rasterise
from .rasterise import visible_triangles as visible_triangles
