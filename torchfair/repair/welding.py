"""Vertices at the same place that are made one along seams."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .._graph import connected
from .._names import Ints, few_groups
from ..errors import SettingsError
from .corners import without_repeated_corners
from .pairing import joined_ends, paired_corners
from .soup import Floats, Soup

_OF_EXTENT = 1e-6  # default tolerance: six digits of a text file
_SINGLE = 2.0**-21  # of the largest coordinate: four units in the last place of single precision
_OF_EDGES = 0.01  # of the mean edge length: the largest default


def weld_tolerance(soup: Soup) -> float:
    """The default: 1e-6 of the extent or rounding to single precision, at most 1 % of the mean edge length.

    Like all distances here, in the unit of the soup.
    """
    if not len(soup.corners):
        return 0.0
    largest = float(np.abs(soup.points[soup.corners]).max())
    mean = float(np.linalg.norm(soup.points[soup.heads] - soup.points[soup.corners], axis=-1).mean())
    return min(max(_OF_EXTENT * soup.extent, _SINGLE * largest), _OF_EDGES * mean)


def checked_tolerance(weld: bool | float, soup: Soup) -> float:
    """The tolerance that is asked for; True asks for the default.

    Raises:
        SettingsError: it is no number of at least 0, or infinite.
    """
    if weld is True:
        return weld_tolerance(soup)
    if isinstance(weld, bool | int | float) and 0.0 <= weld < float("inf"):
        return float(weld) / soup.unit
    raise SettingsError(f"weld must be True or a finite distance of at least 0, got {weld!r}")


def welded(soup: Soup, tolerance: float, *, split_edges: bool = False) -> Soup:
    """Seams closed: edges of the boundary at the same place become one edge.

    Vertices elsewhere stay as they are, and so do vertices at the same place that no common edge joins. Where more than
    two edges of the boundary are at the same place, all their ends become one, or, with ``split_edges``, pairs of them.
    """
    seams = find_seams(soup, tolerance, split_edges=split_edges)
    names = seams.names
    moved = np.flatnonzero(names != np.arange(len(names)))
    if not moved.size:
        return soup
    farthest = soup.unit * float(np.linalg.norm(soup.points[moved] - soup.points[names[moved]], axis=-1).max())
    named = (
        [("vertex", int(soup.vertices[v])), " to ", ("vertex", int(soup.vertices[names[v]]))] for v in moved.tolist()
    )
    told = soup.saying(
        f"welded {moved.size} vertex(es) to others at the same place, at most {farthest:.2g} away: vertices ",
        few_groups(named, moved.size),
        ".",
    )
    return without_repeated_corners(told.renaming(names))


class Seams(NamedTuple):
    """Edges of the boundary that are at the same place as others.

    Attributes:
        names: (V,) vertex that each vertex is the same as.
        pairs: (n, 2) corners from which two faces traverse edges at the same place.
    """

    names: Ints
    pairs: Ints


def find_seams(soup: Soup, tolerance: float, *, split_edges: bool = False) -> Seams:
    """Where edges of the boundary coincide within ``tolerance``."""
    single, places = soup.rim, rim_places(soup, tolerance)
    short = single[places[soup.corners[single]] == places[soup.heads[single]]]
    long = np.setdiff1d(single, short, assume_unique=True)
    pairs = paired_corners(soup, places, long, split=split_edges)
    glued = soup.corners[joined_ends(soup, pairs, places)]
    collapsed = np.stack([soup.corners[short], soup.heads[short]], 1)
    labels = connected(np.concatenate([glued, collapsed]), len(soup.points))
    _, first = np.unique(labels, return_index=True)
    return Seams(first[labels], pairs)


def rim_places(soup: Soup, tolerance: float) -> Ints:
    """(V,) the first vertex at the same place as each, among those of the boundary."""
    rim, places = soup.rim_vertices, np.arange(len(soup.points))
    if rim.size:
        places[rim] = rim[_places(soup.points[rim].reshape(rim.size, -1), tolerance)]
    return places


def _places(points: Floats, tolerance: float) -> Ints:
    """(n,) the first point at the same place as each, within ``tolerance`` from one to the next."""
    order = np.lexsort(points.T)
    new = np.append(True, (np.diff(points[order], axis=0) != 0).any(axis=1))
    group = np.empty(len(points), np.int64)
    group[order] = np.cumsum(new) - 1
    first = order[new]  # the sort is stable, so this is the first of them
    if tolerance > 0.0 and len(first) > 1:
        from scipy.spatial import cKDTree

        near = cKDTree(points[first]).query_pairs(tolerance, output_type="ndarray")
        labels = connected(near, len(first))
        lowest = np.full(labels.max() + 1, len(points))
        np.minimum.at(lowest, labels, first)
        first = lowest[labels]
    found: Ints = first[group]
    return found
