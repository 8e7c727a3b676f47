"""Signed dihedral angles."""

from __future__ import annotations

import torch
from torch import Tensor

from .._portions import portions_unless
from .._remembered import remembered
from ..topology import Topology
from ._any_size import of_any_size
from ._ops import cross, dot, gather, norm
from .normals import face_normals, normals_beside


@remembered
@of_any_size(0)
def dihedral_angles(vertices: Tensor, topology: Topology) -> Tensor:
    r"""Signed angle between the normals of the two faces of every interior edge, in radians.

    Zero where flat, **positive where convex** (seen from the side to which the normals point), negative
    where concave, beyond pi/2 at sharp edges (1.9106 in a regular tetrahedron), pi where folded::

            n    n'                      looking along the edge from v to w:
             \  /                        left face with normal n on the left,
          ____\/____      a = 0 flat     right face with normal n' on the right
              /\
             /  \         a > 0: this roof

    ``a = atan2((n x n') . e, n . n')`` with the unit vector ``e`` along the edge (paper section 3:
    ``|a| = angle(n, n')``). Faces that are not planar have ``n x n'`` not quite parallel to ``e``; ``|a|``
    is then still the angle between the normals, with the sign of ``(n x n') . e``.

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity; any polygons, mixed.

    Returns:
        (*batch, I) in [-pi, pi], unchanged by rigid motions and scaling. Smooth across flat edges: the
        derivative there is the one of the signed angle, in general not 0. Edges of length zero and edges
        beside a degenerate face (see :func:`face_normals`) have value and derivatives 0. Boundary edges
        have no entry.

    Raises:
        ShapeError: if ``vertices`` is not a floating tensor (*batch, V, 3).

    Example:
        >>> import torch
        >>> from torchfair import Topology
        >>> from torchfair.geometry import dihedral_angles
        >>> vertices = torch.tensor([[0.0, 0, 0], [2, 0, 0], [2, 2, 1], [0, 2, 1], [0, 4, 0], [2, 4, 0]])
        >>> topology = Topology.from_faces([[0, 1, 2, 3], [3, 2, 5, 4]])  # a ridge
        >>> torch.rad2deg(dihedral_angles(vertices, topology))  # convex: the ridge is an edge of a roof
        tensor([53.1301])
    """
    normals = face_normals(vertices, topology)
    portions = portions_unless(vertices.requires_grad, topology.num_interior_edges, vertices)
    parts = [_sine_and_cosine(vertices, normals, topology, part) for part in portions]
    sine, cosine = parts[0] if len(parts) == 1 else (torch.cat(each, dim=-1) for each in zip(*parts, strict=True))
    return torch.atan2(sine, cosine)  # at once: its last bits depend on how many are worked out together


def _sine_and_cosine(vertices: Tensor, normals: Tensor, topology: Topology, part: slice) -> tuple[Tensor, Tensor]:
    """Those (*batch, n) of some interior edges, with the normals (*batch, F, 3): temporaries stay in the cache."""
    v, w = topology.edges[: topology.num_interior_edges][part].unbind(1)
    edges = gather(vertices, w) - gather(vertices, v)
    left, right, valid = normals_beside(normals, topology.interior_edge_faces[part])
    lengths = norm(edges)
    valid = valid & (lengths > 0)
    axis = cross(left, right)
    sine = dot(axis, edges) / torch.where(valid, lengths, 1.0)
    if not topology.is_triangular:
        sine = _lengthen(sine, axis)
    # (0, 1) has angle 0 and keeps atan2 away from (0, 0), where its derivative is NaN.
    return torch.where(valid, sine, 0.0), torch.where(valid, dot(left, right), 1.0)


def _lengthen(sine: Tensor, axis: Tensor) -> Tensor:
    """The length of ``axis`` with the sign of ``sine``, for faces that need not be planar.

    Next to flat edges the direction of ``axis`` is rounding noise, and so would be the derivative of its
    length; there ``sine`` itself is as exact and has the right derivative.
    """
    size = norm(axis)
    noise = 64 * torch.finfo(axis.dtype).eps
    return torch.where(size > noise, torch.where(sine < 0, -size, size), sine)
