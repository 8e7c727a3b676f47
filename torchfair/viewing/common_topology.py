"""The connectivity of meshes that are shown together."""

from __future__ import annotations

from collections.abc import Sequence

from ..errors import ShapeError
from ..topology import Topology


def topologies_of(count: int, topology: Topology | Sequence[Topology]) -> list[Topology]:
    """One for each of so many meshes.

    Args:
        count: of meshes.
        topology: of all, or one for each.

    Raises:
        ShapeError: if there are neither one nor so many.
    """
    topologies = [topology] * count if isinstance(topology, Topology) else list(topology)
    if len(topologies) != count:
        raise ShapeError("topology", f"one of all meshes, or one for each of {count}", f"{len(topologies)} topologies")
    return topologies
