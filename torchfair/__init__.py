"""torchfair: visual smoothness of polyhedral surfaces, measured and created.

The parts are imported by name: ``torchfair.geometry``, ``torchfair.energies``, ``torchfair.shapes``,
``torchfair.stars``, ``torchfair.subdivision``, ``torchfair.projection``, ``torchfair.constraints``,
``torchfair.formfinding``, ``torchfair.meshing``, ``torchfair.principal``,
``torchfair.cameras``, ``torchfair.reflection``, ``torchfair.viewing``, ``torchfair.measuring``,
``torchfair.progress``.
"""

from .energies import AngleVariation as AngleVariation
from .energies import NormalVariation as NormalVariation
from .energies import PolylineFairness as PolylineFairness
from .energies import TotalAbsoluteCurvature as TotalAbsoluteCurvature
from .energies import TotalFrobeniusCurvature as TotalFrobeniusCurvature
from .energies import TotalMeanCurvature as TotalMeanCurvature
from .energies import UmbrellaFairness as UmbrellaFairness
from .errors import MeshError as MeshError
from .errors import MeshFileError as MeshFileError
from .errors import ShapeError as ShapeError
from .errors import TorchfairError as TorchfairError
from .io import PolygonMesh as PolygonMesh
from .io import load_mesh as load_mesh
from .io import save_mesh as save_mesh
from .polylines import mesh_polylines as mesh_polylines
from .polylines import polylines_along as polylines_along
from .polylines import straight_triples as straight_triples
from .repair import RepairedMesh as RepairedMesh
from .repair import repair_mesh as repair_mesh
from .topology import Topology as Topology

__version__ = "0.1.0"
