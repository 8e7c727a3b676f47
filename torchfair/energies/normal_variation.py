"""Normal variation E: edge lengths times dual edge lengths, the energy of visually smooth meshes."""

from __future__ import annotations

from torch import Tensor

from .._loading import safe_to_load
from .._precision import in_single_at_least
from ..topology import Topology
from ._normal_variation_function import fast_normal_variation, fast_path_serves, plain_terms
from .base import EdgeEnergy, check_edge_weights, weigh


@in_single_at_least
def normal_variation_per_edge(vertices: Tensor, topology: Topology, edge_weights: Tensor | None = None) -> Tensor:
    """Terms ``l l*`` of E for every interior edge, times its weight: (*batch, I).

    Arguments, degenerate cases and errors as for :func:`normal_variation`. Differentiated by autograd.

    Example:
        >>> from torchfair.energies import normal_variation_per_edge
        >>> from torchfair.shapes import Catenoid, principal_quads
        >>> mesh = principal_quads(Catenoid(), 8, 16)
        >>> normal_variation_per_edge(mesh.vertices, mesh.topology).shape
        torch.Size([240])
    """
    return weigh(plain_terms(vertices, topology), edge_weights, topology)


@in_single_at_least
def normal_variation(vertices: Tensor, topology: Topology, edge_weights: Tensor | None = None) -> Tensor:
    r"""Normal variation ``E = sum_e l_e l*_e`` over the interior edges (paper section 3).

    ``l`` is the length of the edge and ``l* = |n - n'| = 2 sin(|a|/2)`` the length of its dual in the Gauss
    image, ``n, n'`` being the unit normals of the two faces beside it::

                w                n . . . n'
               /|\                 ' l* '
        face  / | \  face'          ' a'
         n    \ |l/   n'             '
               \|/
                v

    E is never larger than the angle variation E'. On a principal mesh of a smooth surface it approximates
    the total absolute curvature ``integral of |k1| + |k2|``; any other mesh of a saddle has more, which is
    what makes E a measure of visual smoothness. Normals of polygons that are not planar are those of
    their area vectors.

    The gradient is that of Prop. 2 of the paper in closed form, computed together with the value and about
    as fast as the value alone. It equals the gradient of the plain formula to rounding, as do all further
    derivatives, which come from that formula. Under ``torch.compile`` and inside transforms of
    ``torch.func`` the plain formula serves throughout. On CPUs the topology keeps index tables and scratch
    memory for the next evaluation, about 200 bytes per triangle in float64.

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity; any polygons, mixed.
        edge_weights: (I,) or (*batch, I) factors of the terms, 1 if left out.

    Returns:
        (*batch,) >= 0, same unit as the vertices; scales with them, unchanged by rigid motions and by
        reversing all faces. At flat edges there is a kink with value 0, and the derivative given is 0, a
        subgradient; :func:`normal_variation_derivative` gives one-sided derivatives there. Edges of length
        zero, on the boundary or beside a degenerate face (see :func:`torchfair.geometry.face_normals`)
        contribute nothing, with zero derivatives, and so do isolated vertices.

    Raises:
        ShapeError: if ``vertices`` or ``edge_weights`` has the wrong shape or is not floating.

    Example:
        >>> from torchfair.energies import normal_variation
        >>> from torchfair.shapes import Catenoid, principal_quads
        >>> mesh = principal_quads(Catenoid(), 8, 16)
        >>> normal_variation(mesh.vertices, mesh.topology)
        tensor(23.3163, dtype=torch.float64)
    """
    topology.check_vertices(vertices)
    if not fast_path_serves():
        return topology.sum_per_mesh(normal_variation_per_edge(vertices, topology, edge_weights), "interior_edges")
    check_edge_weights(edge_weights, topology)
    if edge_weights is not None:
        edge_weights = edge_weights.to(vertices.dtype)
    return fast_normal_variation(vertices, edge_weights, topology)


@safe_to_load
class NormalVariation(EdgeEnergy):
    """Module form of :func:`normal_variation`: ``forward(vertices)`` (*batch, V, 3) -> (*batch,).

    Example:
        >>> from torchfair.energies import NormalVariation
        >>> from torchfair.shapes import Catenoid, principal_quads
        >>> mesh = principal_quads(Catenoid(), 8, 16)
        >>> energy = NormalVariation(mesh.topology)
        >>> energy(mesh.vertices)
        tensor(23.3163, dtype=torch.float64)
        >>> batch = mesh.vertices.expand(3, -1, -1)
        >>> energy(batch).shape
        torch.Size([3])
    """

    def per_edge(self, vertices: Tensor) -> Tensor:
        """Terms (*batch, I), weights included; see :func:`normal_variation_per_edge`."""
        return normal_variation_per_edge(vertices, self.topology, self.edge_weights)

    def per_mesh(self, vertices: Tensor) -> Tensor:
        """E (*batch,) of ``vertices`` (*batch, V, 3)."""
        return normal_variation(vertices, self.topology, self.edge_weights)
