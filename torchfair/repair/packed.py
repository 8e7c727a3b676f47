"""Repairs one after the other, for packed faces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch
from torch import Tensor

from .._half_edges import check_faces
from .._names import Ints, Names, PlacedError, few
from ..errors import ShapeError
from ..topology import Topology
from .corners import without_repeated_corners, without_zero_edges
from .faces import without_duplicates, without_flat_faces
from .fans import with_fans_apart
from .orientation import oriented
from .result import RepairedMesh
from .soup import Bools, Floats, Soup
from .t_junctions import with_t_junctions_joined
from .welding import checked_tolerance, weld_tolerance, welded


def repair_packed(
    vertices: Tensor, corners: Ints, offsets: Ints, *, weld: bool | float = False, split_edges: bool = False
) -> RepairedMesh:
    """:func:`repair_mesh` of vertices (*batch, V, 3) for packed faces."""
    soup = _soup(vertices, corners, offsets)
    soup = without_repeated_corners(soup)
    tolerance = weld_tolerance(soup) if weld is False else checked_tolerance(weld, soup)
    if weld is not False:
        soup = welded(soup, tolerance, split_edges=split_edges)
    soup = without_zero_edges(soup)
    soup = without_duplicates(soup)
    soup = without_flat_faces(soup)
    joined = with_t_junctions_joined(soup, tolerance, by_place=weld is not False)
    if weld is not False and joined is not soup:
        joined = welded(joined, tolerance, split_edges=split_edges)
    soup = joined
    soup = with_fans_apart(soup, split_edges=split_edges)
    try:
        soup, flipped = oriented(soup)
    except PlacedError as error:
        raise _in_old_numbers(error, soup) from None
    used = np.zeros(len(soup.points), bool)
    used[soup.corners] = True
    unused = np.setdiff1d(np.flatnonzero(~used), _merged_away(soup))
    if unused.size:
        soup = soup.saying(
            f"dropped {unused.size} unused vertex(es) and renumbered the others: vertices ", few("vertex", unused), "."
        )
    return _result(vertices, soup, flipped, used)


def weld_packed(vertices: Tensor, corners: Ints, offsets: Ints, weld: bool | float) -> RepairedMesh:
    """Seams closed and nothing else; vertices (*batch, V, 3) that were not merged into others stay, used or not."""
    soup = _soup(vertices, corners, offsets)
    soup = welded(soup, checked_tolerance(weld, soup), split_edges=False)
    kept = np.ones(len(soup.points), bool)
    kept[_merged_away(soup)] = False
    return _result(vertices, soup, np.zeros(len(soup.faces), bool), kept)


def weld_soup(points: Floats, corners: Ints, offsets: Ints, tolerance: float) -> Soup:
    """Seams of packed faces closed, which may be no manifold; points (V, 3), tolerance in their unit."""
    soup = Soup.of(points[:, None], corners, offsets)
    return welded(soup, tolerance / soup.unit)


def _soup(vertices: Tensor, corners: Ints, offsets: Ints) -> Soup:
    if not isinstance(vertices, Tensor) or vertices.ndim < 2 or vertices.shape[-1] != 3:
        shape = tuple(vertices.shape) if isinstance(vertices, Tensor) else type(vertices).__name__
        raise ShapeError("vertices", "a tensor (*batch, V, 3)", shape)
    count = vertices.shape[-2]
    points = vertices.detach().to("cpu", torch.float64).reshape(-1, count, 3).transpose(0, 1).numpy()
    check_faces(corners, offsets, count)
    return Soup.of(points, corners, offsets)


def _merged_away(soup: Soup) -> Ints:
    """Vertices in whose place others are used."""
    return np.flatnonzero(soup.merged != np.arange(len(soup.merged)))


def _in_old_numbers(error: PlacedError, soup: Soup) -> PlacedError:
    old = Names(vertices=soup.vertices, faces=soup.faces)
    parts = (
        part if isinstance(part, str) else (part[0], int(getattr(old, part[0])(part[1])))
        for part in error.sentence.parts
    )
    return PlacedError(*parts)


def _result(vertices: Tensor, soup: Soup, flipped: Bools, used: Bools) -> RepairedMesh:
    """The vertices that are used, numbered anew."""
    numbers = np.where(used, np.cumsum(used) - 1, -1)
    try:
        topology = Topology.from_packed_faces(numbers[soup.corners], soup.offsets, int(used.sum()))
    except PlacedError as error:
        raise _in_old_numbers(error, replace(soup, vertices=soup.vertices[used])) from None
    device = vertices.device
    kept = torch.from_numpy(soup.vertices[used]).to(device)
    return RepairedMesh(
        vertices=vertices[..., kept, :],
        topology=topology.to(device),
        kept_vertices=kept,
        kept_faces=torch.from_numpy(soup.faces).to(device),
        kept_corners=torch.from_numpy(soup.origins).to(device),
        vertex_map=torch.from_numpy(numbers[soup.merged[: vertices.shape[-2]]]).to(device),
        flipped_faces=torch.from_numpy(soup.faces[flipped]).to(device),
        sentences=soup.said,
    )
