"""The normal variation of large triangle meshes by compiled loops, where the optional package numba is there."""

from __future__ import annotations

import importlib.util
import itertools
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import torch
from torch import Tensor

from ..geometry._unit import unit_of
from ..geometry.normals import DEGENERACY
from ..topology import Topology
from ._normal_variation_blocks import neighbours_of
from ._normal_variation_memory import Memory, Scratch, shared_scratch

FEWEST_FACES = 50_000
"""Below that, compiling (seconds, once on a machine) and importing numba (0.4 s) are not worth a millisecond."""

_MOST_PARTS = 8  # each has forces of its own for all vertices
_CACHE = "_normal_variation_triangles"


@dataclass(frozen=True)
class _Triangles:
    """Corners and the triangles behind the sides (F, 3), as numpy arrays, and memory to work in."""

    corners: Any
    behind: Any
    scratch: Scratch

    @classmethod
    def of(cls, topology: Topology) -> _Triangles:
        """Those of a topology, remembered by it."""
        known: _Triangles | None = topology.__dict__.get(_CACHE)
        if known is None:
            corners, behind = (
                part.numpy().astype(np.uint32).reshape(-1, 3) for part in (topology.corners, neighbours_of(topology))
            )
            known = cls(corners, behind, shared_scratch(corners.size) or Scratch())
            topology.__dict__[_CACHE] = known
        return known


@cache
def is_installed() -> bool:
    """Whether numba can be imported."""
    return importlib.util.find_spec("numba") is not None


def compiled_serves(vertices: Tensor, edge_weights: Tensor | None, topology: Topology) -> bool:
    """Whether :func:`compiled_energy_and_gradient` may and should be called."""
    return (
        topology.num_faces >= FEWEST_FACES
        and vertices.dtype == torch.float64
        and vertices.is_cpu
        and type(vertices) in (Tensor, torch.nn.Parameter)
        and edge_weights is None
        and topology.is_triangular
        and not topology.is_joined
        and is_installed()
    )


def compiled_energy_and_gradient(vertices: Tensor, topology: Topology, gradient: Tensor | None) -> Tensor:
    """Like ``energy_and_gradient``, for what :func:`compiled_serves`: energies (B,) of ``vertices`` (B, V, 3)."""
    triangles = _Triangles.of(topology)
    energies = [
        _one(mesh, triangles, None if gradient is None else gradient[number])
        for number, mesh in enumerate(vertices.detach().contiguous())
    ]
    return torch.stack(energies) if energies else vertices.new_empty(0)


def _one(vertices: Tensor, triangles: _Triangles, gradient: Tensor | None) -> Tensor:
    """Of one mesh (V, 3)."""
    from ._normal_variation_triangles import add_forces, write_normals

    unit = unit_of(vertices)
    points, scale = vertices.numpy(), 1.0 / float(unit)
    limits = torch.finfo(torch.float64)
    bounds = ((2 * DEGENERACY * limits.eps) ** 2, limits.tiny**-0.5, limits.max**0.75)
    face_count = triangles.corners.shape[0]
    parts = _parts(face_count)
    shapes = (face_count, 4), (len(parts), *points.shape)
    with triangles.scratch.lend(vertices, sum(Memory.size(*shape) for shape in shapes)) as memory:
        normals, forces = (memory.take(*shape).numpy() for shape in shapes)

        def normals_of(part: int) -> None:
            write_normals(points, scale, triangles.corners, *parts[part], bounds, normals)

        def forces_of(part: int) -> tuple[float, int, int]:
            start, stop = parts[part]
            corners = triangles.corners[start:stop]
            first, last = int(corners.min()), int(corners.max()) + 1
            forces[part, first:last] = 0.0
            energy = add_forces(points, scale, triangles.corners, triangles.behind, start, stop, normals, forces[part])
            return energy, first, last

        _each(normals_of, range(len(parts)))
        done = _each(forces_of, range(len(parts)))
        if gradient is not None:
            slope = gradient.zero_().numpy()
            for own, (_, first, last) in zip(forces, done, strict=True):
                slope[first:last] += own[first:last]
    total: float = sum(energy for energy, _, _ in done)
    return unit * (0.5 * total)


def _parts(face_count: int) -> list[tuple[int, int]]:
    """First face and the one behind the last of as many parts as there are threads."""
    number = min(torch.get_num_threads(), _MOST_PARTS)
    ends = [face_count * part // number for part in range(number + 1)]
    return list(itertools.pairwise(ends))


def _each(function: Callable[[int], Any], parts: Iterable[int]) -> list[Any]:
    """Values of a function that lets other threads run, at every part at once."""
    numbers = list(parts)
    if len(numbers) == 1:
        return [function(0)]
    with ThreadPoolExecutor(len(numbers)) as pool:
        return list(pool.map(function, numbers))
