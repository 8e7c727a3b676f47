"""Samples of a data set as one batch, whatever their connectivity."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from torch.utils.data import default_collate

from ..topology import Topology
from .mesh_batch import MeshBatch, taken_apart


def collate(samples: Sequence[Any]) -> Any:
    """What ``DataLoader(..., collate_fn=collate)`` makes of samples with meshes in them.

    Meshes, that is pairs ``(vertices (V, 3), topology)``, objects with these two attributes and batches, become one
    :class:`MeshBatch`; topologies alone are joined. Dictionaries, tuples and lists are gone through, with meshes at any
    depth; all else is left to ``torch.utils.data.default_collate``.

    Raises:
        MeshError: if topologies cannot be joined.
        ShapeError: if vertices do not go together.

    Example:
        >>> from torchfair.batches import collate
        >>> from torchfair.shapes import icosphere
        >>> samples = [{"mesh": icosphere(1), "label": 3}, {"mesh": icosphere(2), "label": 5}]
        >>> batch = collate(samples)
        >>> len(batch["mesh"]), batch["label"]
        (2, tensor([3, 5]))
    """
    first = samples[0]
    if isinstance(first, MeshBatch):
        return MeshBatch.of(mesh for batch in samples for mesh in batch)
    if isinstance(first, Topology):
        return Topology.join(samples)
    if not isinstance(first, list) and taken_apart(first) is not None:
        return MeshBatch.of(samples)
    if isinstance(first, Mapping):
        return {key: collate([sample[key] for sample in samples]) for key in first}
    if isinstance(first, tuple) and hasattr(first, "_fields"):
        return type(first)(*(collate(column) for column in zip(*samples, strict=True)))
    if isinstance(first, tuple | list):
        return [collate(column) for column in zip(*samples, strict=True)]
    return default_collate(list(samples))
