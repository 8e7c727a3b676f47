"""Integrated shape operators of vertex stars."""

from __future__ import annotations

from torch import Tensor

from ..topology import Topology
from ._any_size import of_any_size
from ._ops import cross, scatter_sum, unit
from .dihedral import dihedral_angles
from .lengths import edge_vectors
from .normals import adjacent_normals


@of_any_size(1)
def shape_operators(vertices: Tensor, topology: Topology, *, sine: bool = True) -> Tensor:
    r"""Shape operator of every vertex star as a 3x3 matrix, integrated over the star (paper section 5.3).

    ``W'_v = 1/2 sum_e (n_f x n_f') (w - v)^T`` over the interior edges ``e = (v, w)`` at ``v``, with face
    ``f`` on the left when going from ``v`` to ``w``::

              v ----- f ----- w        reversed, f and f' as well as v and w change places:
                      f'               the same matrix for the stars of both ends

    Where faces are planar each edge contributes ``1/2 sin(a) / l * e e^T`` with its edge vector ``e``, length
    ``l`` and dihedral angle ``a``: a symmetric matrix. Faces that are not planar make it slightly
    unsymmetric. The variant ``sine=False`` has ``a`` in place of ``sin a`` (the normal cycle of
    Cohen-Steiner and Morvan, symmetric always, half the error).

    In the normal cycle the eigenvector of one principal curvature is the *other* principal direction. On
    smooth surfaces one eigenvalue is near zero; at sharp corners all three are not: restrict to the plane
    orthogonal to the vertex normal before taking eigenvalues.

    Every interior edge belongs to the stars of both its ends, boundary vertices included, so the traces sum
    to ``sum_e l sin a`` (planar faces), or ``sum_e l a`` for ``sine=False``, which is twice the total mean
    curvature.

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity; any polygons, mixed.
        sine: whether to use ``sin a`` (the paper's) or ``a``.

    Returns:
        (*batch, V, 3, 3), same unit as the vertices: curvature times area, positive where convex. Smooth at
        flat edges. Zero for isolated vertices; edges on the boundary, beside degenerate faces (see
        :func:`face_normals`) or of length zero contribute nothing, with zero derivatives.

    Raises:
        ShapeError: if ``vertices`` is not a floating tensor (*batch, V, 3).

    Example:
        >>> from torchfair.geometry import shape_operators
        >>> from torchfair.shapes import icosphere
        >>> ball = icosphere(2, radius=2.0)
        >>> shape_operators(ball.vertices, ball.topology).shape  # integrals over the stars
        torch.Size([162, 3, 3])
    """
    edges = edge_vectors(vertices, topology)[..., : topology.num_interior_edges, :]
    if sine:
        left, right, _ = adjacent_normals(vertices, topology)
        axis = cross(left, right)  # zero beside degenerate faces, whose normal is zero
    else:
        axis = unit(edges) * dihedral_angles(vertices, topology)[..., None]
    per_edge = (axis[..., :, None] * edges[..., None, :]).flatten(-2) / 2
    v, w = topology.interior_edges.unbind(1)
    stars = scatter_sum(per_edge, v, topology.num_vertices).index_add(-2, w, per_edge)
    return stars.reshape((*vertices.shape[:-1], 3, 3))
