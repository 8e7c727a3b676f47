"""The topology message: all that a page has to know of a mesh but where its vertices are."""

from __future__ import annotations

import numpy as np
import torch

from ...creases import crease_edges
from ...geometry import edge_lengths
from ...settings.fair_settings import FairSettings
from ...topology import Topology
from ..containers import pack
from ..document import Document
from .recipes import tensor_of

PRINCIPAL, BOUNDARY, CREASE = 1, 2, 4
"""Bits of the labels of edges."""


def topology_message(document: Document, topology: Topology, number: int) -> bytes:
    """The container ``topology`` of a document.

    Args:
        document: The mesh.
        topology: Its connectivity.
        number: Of the topology.
    """
    start = tensor_of(document.start)
    size = document.start.max(0) - document.start.min(0)
    message = {
        "type": "topology",
        "topology": number,
        "title": document.title,
        "vertices": topology.num_vertices,
        "faces": topology.num_faces,
        "edges": topology.num_edges,
        "interior_edges": topology.num_interior_edges,
        "origin": document.origin.tolist(),
        "size": float(np.linalg.norm(size)),
        "mean_edge": float(edge_lengths(start, topology).mean()),
        "triangular": topology.is_triangular,
        "boundary_loops": topology.loop_offsets.shape[0] - 1,
        "has_names": document.names is not None,
        "principal_edges": 0 if document.principal is None else int(document.principal.sum()),
    }
    arrays = {
        "corners": topology.corners.numpy().astype(np.uint32),
        "offsets": topology.face_offsets.numpy().astype(np.uint32),
        "edges": topology.edges.numpy().astype(np.uint32),
        "edge_faces": _edge_faces(topology),
        "labels": _labels(document, start, topology),
        "boundary": topology.is_boundary_vertex.numpy().astype(np.uint8),
        "start": (document.start - document.origin).astype(np.float32),
    }
    if document.names is not None:
        arrays["vertex_names"] = document.names.astype(np.int32)
    return pack(message, arrays)


def _edge_faces(topology: Topology) -> np.ndarray:
    """(E, 2) left and right face, -1 where there is none."""
    result = np.full((topology.num_edges, 2), -1, np.int32)
    count = topology.num_interior_edges
    result[:count] = topology.interior_edge_faces.numpy()
    edges, faces = topology.corner_edges.numpy(), topology.corner_faces.numpy()
    outer = edges >= count
    result[edges[outer], 0] = faces[outer]
    return result


def _labels(document: Document, start: torch.Tensor, topology: Topology) -> np.ndarray:
    labels = np.zeros(topology.num_edges, np.uint8)
    if document.principal is not None:
        labels[document.principal] |= PRINCIPAL
    labels[topology.num_interior_edges :] |= BOUNDARY
    labels[crease_edges(start, topology, FairSettings.crease_angle).numpy()] |= CREASE
    return labels
