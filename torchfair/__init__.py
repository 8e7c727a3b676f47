"""torchfair: visual smoothness of polyhedral surfaces, measured and created."""

from .errors import MeshError as MeshError
from .errors import MeshFileError as MeshFileError
from .errors import ShapeError as ShapeError
from .errors import TorchfairError as TorchfairError
from .topology import Topology as Topology

__version__ = "0.1.0"
