"""A polygon mesh as it comes from a file."""

from __future__ import annotations

from dataclasses import dataclass

from torch import Tensor

from ..topology import Topology


@dataclass(frozen=True, eq=False)
class PolygonMesh:
    """Positions and connectivity together, for files and the command line only.

    Everything else in torchfair takes ``vertices`` and ``topology`` apart, so that one topology serves many
    vertex tensors.

    Attributes:
        vertices: (V, 3) float64 positions in the unit of the file.
        topology: connectivity.
        repairs: what a repair did to the mesh of the file, in words; empty if nothing.
    """

    vertices: Tensor
    topology: Topology
    repairs: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        self.topology.check_vertices(self.vertices)
