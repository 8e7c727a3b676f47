"""Batches of meshes of different connectivity: vertices side by side, with a joined topology."""

from .collating import collate as collate
from .mesh_batch import MeshBatch as MeshBatch
from .mesh_batch import mesh_from_lists as mesh_from_lists
