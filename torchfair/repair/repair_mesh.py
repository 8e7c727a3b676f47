"""The repair of face lists."""

from __future__ import annotations

from torch import Tensor

from .._connectivity import pack_faces
from .packed import repair_packed
from .result import RepairedMesh


def repair_mesh(
    vertices: Tensor, faces: object, *, weld: bool | float = False, split_edges: bool = False
) -> RepairedMesh:
    """Makes an oriented manifold mesh of faces, says what it did, and leaves alone what is right.

    In this order:

    1. Corners that a face repeats are dropped, and faces with fewer than three different corners.
    2. With ``weld``: edges of the boundary at the same place become one edge.
    3. Ends of edges of length zero become one vertex; faces that occur twice are left once; faces without area
       (``|A| <= 4 eps sum l^2``) are dropped.
    4. Vertices of T-junctions are put into the longer edge, where that joins faces.
    5. Vertices whose faces form several fans are split, one copy per fan.
    6. Faces are turned over until neighbours agree. In each connected component (faces joined along edges) the
       orientation of the majority is kept, that of the lowest face if both are equally frequent, so that as few faces
       as possible are turned over. Inside and outside of closed surfaces are not looked at.
    7. Vertices that no face uses are dropped.

    A mesh in which no face has any area is not judged by its positions. In a batch, faces have no area and points are
    at the same place if that is so in all meshes.

    Args:
        vertices: (*batch, V, 3) positions; gradients pass through.
        faces: as for :meth:`Topology.from_faces`.
        weld: the largest distance, in the unit of the vertices, of points that are at the same place; True for 1e-6 of
            the extent or, where that is more, rounding to single precision, and never more than 1 % of the mean edge.
            Vertices that no edge of the boundary joins stay apart.
        split_edges: whether edges of more than two faces are split: their faces are put into the pairs that bend least,
            and each pair gets its own vertices.

    Returns:
        The mesh, and what became of every vertex, face and corner.

    Raises:
        ShapeError: if ``vertices`` does not end in (V, 3).
        SettingsError: if ``weld`` is no distance.
        MeshError: if the surface is one-sided (a Moebius strip), or for the faults that only the user can mend: edges
            of more than two faces (without ``split_edges``), vertex numbers out of range, faces of fewer than three
            corners.

    Example:
        >>> from torchfair.repair import repair_mesh
        >>> import torch
        >>> points = torch.tensor([[0., 0, 0], [1, 0, 0], [1, 1, .2], [0, 0, 0], [1, 1, .2], [0, 1, 0]])
        >>> mesh = repair_mesh(points, [[0, 1, 2], [3, 4, 5]], weld=True)
        >>> mesh.faces, mesh.vertex_map.tolist()
        ([[0, 1, 2], [0, 2, 3]], [0, 1, 2, 0, 2, 3])
    """
    return repair_packed(vertices, *pack_faces(faces), weld=weld, split_edges=split_edges)
