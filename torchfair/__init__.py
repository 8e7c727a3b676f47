"""torchfair: visual smoothness of polyhedral surfaces, measured and created.

The parts are imported by name: ``torchfair.geometry``, ``torchfair.energies``, ``torchfair.shapes``,
``torchfair.stars``, ``torchfair.subdivision``, ``torchfair.projection``, ``torchfair.constraints``,
``torchfair.formfinding``, ``torchfair.meshing``, ``torchfair.principal``, ``torchfair.batches``,
``torchfair.conversions``, ``torchfair.cameras``, ``torchfair.reflection``, ``torchfair.viewing``,
``torchfair.measuring``, ``torchfair.progress``. They, and the names below, are loaded with all that they need, torch
among it, when they are first asked for: what needs none of it, such as the help of the command line, does not wait
for it.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from . import batches as batches
    from . import boundary as boundary
    from . import cameras as cameras
    from . import constraints as constraints
    from . import conversions as conversions
    from . import creases as creases
    from . import curves as curves
    from . import design as design
    from . import energies as energies
    from . import errors as errors
    from . import fields as fields
    from . import formfinding as formfinding
    from . import geometry as geometry
    from . import io as io
    from . import linear as linear
    from . import measuring as measuring
    from . import meshing as meshing
    from . import normalisation as normalisation
    from . import polylines as polylines
    from . import principal as principal
    from . import progress as progress
    from . import projection as projection
    from . import rasterisation as rasterisation
    from . import reflection as reflection
    from . import repair as repair
    from . import self_intersections as self_intersections
    from . import settings as settings
    from . import shapes as shapes
    from . import stars as stars
    from . import subdivision as subdivision
    from . import topology as topology
    from . import triangulation as triangulation
    from . import viewing as viewing
    from .batches import MeshBatch as MeshBatch
    from .batches import collate as collate
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
    from .repair.repair_mesh import repair_mesh as repair_mesh
    from .topology import Topology as Topology

__version__ = "0.2.0"

_NAMES = {
    "batches": ("MeshBatch", "collate"),
    "energies": (
        *("AngleVariation", "NormalVariation", "PolylineFairness", "TotalAbsoluteCurvature"),
        *("TotalFrobeniusCurvature", "TotalMeanCurvature", "UmbrellaFairness"),
    ),
    "errors": ("MeshError", "MeshFileError", "ShapeError", "TorchfairError"),
    "io": ("PolygonMesh", "load_mesh", "save_mesh"),
    "polylines": ("mesh_polylines", "polylines_along", "straight_triples"),
    "repair": ("RepairedMesh", "repair_mesh"),
    "topology": ("Topology",),
}
_PARTS = (
    *(
        "batches",
        "boundary",
        "cameras",
        "constraints",
        "conversions",
        "creases",
        "curves",
        "design",
        "energies",
        "errors",
        "fields",
    ),
    *(
        "formfinding",
        "geometry",
        "io",
        "linear",
        "measuring",
        "meshing",
        "normalisation",
        "polylines",
        "principal",
        "progress",
    ),
    *("projection", "rasterisation", "reflection", "repair", "self_intersections", "settings", "shapes", "stars"),
    *("subdivision", "topology", "triangulation", "viewing"),
)
_HOME = {name: part for part, names in _NAMES.items() for name in names}

__all__ = list(_HOME)  # what ``from torchfair import *`` loads


def __getattr__(name: str) -> object:
    if name in _PARTS:
        return import_module(f".{name}", __name__)
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value: object = getattr(import_module(f".{_HOME[name]}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOME, *_PARTS})
