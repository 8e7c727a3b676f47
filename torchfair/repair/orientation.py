"""Faces turned over until neighbours agree."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .._connectivity import HalfEdges, build_half_edges, pair_half_edges
from .._graph import connected_in_two_colours
from .._names import Ints, PlacedError, few
from .soup import Bools, Soup


def oriented(soup: Soup) -> tuple[Soup, Bools]:
    """Faces that agree, and (F,) which of them were turned over.

    In each connected component (faces joined along edges) the orientation of the majority is kept, that of the lowest
    face if both are equally frequent. Every face keeps its first corner.

    Raises:
        MeshError: the surface is one-sided, or no manifold along its edges.
    """
    half = build_half_edges(soup.corners, soup.offsets, len(soup.points))
    flipped = _faces_to_flip(half)
    turned = np.flatnonzero(flipped)
    if not turned.size:
        return soup, flipped
    places = _turned_places(half, flipped)
    told = soup.saying(
        f"turned over {turned.size} of {flipped.size} faces so that neighbours agree: faces ",
        few("face", soup.faces[turned]),
        ".",
    )
    return replace(told, corners=soup.corners[places], origins=soup.origins[places]), flipped


def _faces_to_flip(half: HalfEdges) -> Bools:
    """(F,) the smallest set of faces that must turn over."""
    first, second, _ = pair_half_edges(half)
    clash = half.corners[first] == half.corners[second]
    pairs = half.faces[first], half.faces[second]
    num_faces = half.offsets.size - 1
    if not clash.any():
        return np.zeros(num_faces, bool)
    labels = connected_in_two_colours(np.stack(pairs, 1), clash, num_faces)  # as they are, and turned over
    _check_one_sided(labels)
    low = labels.min(axis=0)
    side = labels[0] == low
    _, lowest_face, component, sizes = np.unique(low, return_index=True, return_inverse=True, return_counts=True)
    on_side = np.bincount(component, weights=side)
    kept_side = np.where(2 * on_side == sizes, side[lowest_face], 2 * on_side > sizes)
    flipped: Bools = side != kept_side[component]
    return flipped


def _check_one_sided(labels: Ints) -> None:
    stuck = np.flatnonzero(labels[0] == labels[1])
    if stuck.size:
        raise PlacedError(
            f"one-sided surface (such as a Moebius strip): {stuck.size} connected face(s) cannot be oriented "
            "consistently: faces ",
            few("face", stuck),
            ". Cut the surface open or remove faces.",
        )


def _turned_places(half: HalfEdges, flipped: Bools) -> Ints:
    """Corner that comes to each place when the ``flipped`` faces turn over."""
    turn = flipped[half.faces]
    first = half.offsets[half.faces]
    local = np.arange(half.corners.size) - first
    sizes = np.diff(half.offsets)[half.faces]
    places: Ints = np.where(turn, first + (sizes - local) % sizes, first + local)
    return places
