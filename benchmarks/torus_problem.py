"""The problem that the engine's benchmarks solve: a noisy torus is made smooth near the exact one."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from torchfair import Topology
from torchfair.constraints import interior_fairness_terms, normal_variation_terms
from torchfair.projection import ElementTerm

SMOOTHING, CLOSENESS, FAIRNESS, NOISE = 1e-2, 100.0, 0.3, 0.15


def plane_distance(x: Tensor, foot: Tensor, normal: Tensor) -> Tensor:
    """Signed distance of the vertex ``x`` (1, 3) from a fixed plane."""
    return torch.dot(normal, x[0] - foot)


def torus_problem(size: int, dtype: torch.dtype = torch.float64) -> tuple[dict[str, Tensor], list[ElementTerm]]:
    """Blocks and terms: E, umbrella fairness, closeness to tangent planes of the exact torus.

    Args:
        size: Wanted number of vertices; the torus grid takes the nearest one with nearly square cells.
        dtype: Of the vertices.

    Returns:
        The start, a triangle mesh of unit mean edge length with noise, and the terms.
    """
    minor = round((size / 3.2) ** 0.5)
    major = round(size / minor)
    i, j = np.meshgrid(np.arange(major), np.arange(minor), indexing="ij")
    here, right, up = (grid.ravel() for grid in _neighbours(i, j, major, minor))
    diagonal = (((i + 1) % major) * minor + (j + 1) % minor).ravel()
    faces = np.concatenate([np.stack([here, right, diagonal], 1), np.stack([here, diagonal, up], 1)])
    phi, theta = 2 * np.pi * i.ravel() / major, 2 * np.pi * j.ravel() / minor
    outward = np.stack([np.cos(theta) * np.cos(phi), np.cos(theta) * np.sin(phi), np.sin(theta)], 1)
    ring = np.stack([np.cos(phi), np.sin(phi), np.zeros_like(phi)], 1)
    exact = major / (2 * np.pi) * ring + minor / (2 * np.pi) * outward
    topology = Topology.from_faces(faces)
    length = np.linalg.norm(exact[topology.edges[:, 1]] - exact[topology.edges[:, 0]], axis=1).mean()
    noise = np.random.default_rng(0).uniform(-NOISE, NOISE, exact.shape)
    feet, normals, start = (
        torch.from_numpy(array).to(dtype) for array in (exact / length, outward, exact / length + noise)
    )
    each = torch.arange(exact.shape[0])[:, None]
    terms = [
        *normal_variation_terms(topology, smoothing=SMOOTHING),
        *interior_fairness_terms(topology, weight=FAIRNESS),
        ElementTerm("closeness", plane_distance, [("vertices", each)], (feet, normals), weight=CLOSENESS, linear=True),
    ]
    return {"vertices": start}, terms


def _neighbours(i: np.ndarray, j: np.ndarray, major: int, minor: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return i * minor + j, (i + 1) % major * minor + j, i * minor + (j + 1) % minor
