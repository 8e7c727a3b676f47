"""Edges of the boundary that lie on each other: seams where a mesh is not welded."""

from __future__ import annotations

import numpy as np
from torch import Tensor

from .._names import Sentence, few_groups, sentence
from ..topology import Topology
from .soup import Soup
from .welding import find_seams, weld_tolerance


def coincident_edges(vertices: Tensor, topology: Topology) -> Sentence | None:
    """What is to be said of edges of the boundary of a mesh (V, 3) that coincide; None if there are none.

    Edges coincide within the default distance of ``weld`` of :func:`~torchfair.repair_mesh`.
    """
    if topology.num_edges == topology.num_interior_edges:
        return None
    points = vertices.detach().to("cpu").double().numpy()[:, None]
    soup = Soup.of(points, topology.corners.cpu().numpy(), topology.face_offsets.cpu().numpy())
    pairs = find_seams(soup, weld_tolerance(soup)).pairs
    if not len(pairs):
        return None
    heads = soup.heads
    ends = np.stack([soup.corners[pairs], heads[pairs]], -1)  # (n, 2, 2)
    named = (
        ["(", ("vertex", a), ", ", ("vertex", b), ") and (", ("vertex", c), ", ", ("vertex", d), ")"]
        for (a, b), (c, d) in ends.tolist()
    )
    return sentence(
        f"not welded: {len(pairs)} pair(s) of boundary edges lie on each other and count as boundary, edges ",
        few_groups(named, len(pairs)),
        ".",
    )
