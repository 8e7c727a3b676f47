"""Surfaces and example meshes by name, for the command line and the experiments."""

from __future__ import annotations

from collections.abc import Callable

from torch import Tensor

from torchfair.errors import TorchfairError
from torchfair.topology import Topology

from .height_fields import FreeFormPatch, Paraboloid, PrincipalParaboloid
from .irregular import irregular_triangles
from .minimal import Enneper, Helicoid, PrincipalHelicoid
from .revolution import Catenoid, Cone, Cylinder, Hyperboloid, Torus
from .roofs import Canopy, example_roof, hybrid_roof
from .sphere import Sphere
from .surface import Surface


def spherical_zone() -> Sphere:
    """The unit sphere between the latitudes -1 and 1: a sphere without poles."""
    return Sphere(latitudes=(-1.0, 1.0))


def inner_torus() -> Torus:
    """The negatively curved half of the default torus."""
    return Torus(tube_angles=(1.5707963267948966, 4.71238898038469))


SURFACES: dict[str, Callable[..., Surface]] = {
    "sphere": Sphere,
    "spherical_zone": spherical_zone,
    "torus": Torus,
    "inner_torus": inner_torus,
    "cylinder": Cylinder,
    "cone": Cone,
    "catenoid": Catenoid,
    "hyperboloid": Hyperboloid,
    "paraboloid": Paraboloid,
    "principal_paraboloid": PrincipalParaboloid,
    "enneper": Enneper,
    "helicoid": Helicoid,
    "principal_helicoid": PrincipalHelicoid,
    "free_form_patch": FreeFormPatch,
    "canopy": Canopy,
}
"""Makers of the analytic surfaces, by name; each can be called without arguments."""

EXAMPLES: dict[str, Callable[[], tuple[Tensor, Topology]]] = {"roof": example_roof, "hybrid_roof": hybrid_roof}
"""Makers of the built-in example meshes, by name."""

_BUILTIN_COUNT = 1000


def builtin_mesh(name: str) -> tuple[Tensor, Topology]:
    """An example mesh by name: ``(vertices (V, 3) float64, topology)``.

    Names are those of :data:`EXAMPLES`, and those of :data:`SURFACES` for an irregular triangle mesh of 1000
    vertices on that surface.

    Raises:
        TorchfairError: for an unknown name; the message lists all names.
    """
    if name in EXAMPLES:
        return EXAMPLES[name]()
    if name in SURFACES:
        mesh = irregular_triangles(SURFACES[name](), _BUILTIN_COUNT)
        return mesh.vertices, mesh.topology
    raise TorchfairError(f"there is no example {name[:40]!r}: choose {', '.join([*EXAMPLES, *SURFACES])}")
