"""Vertices that faces touch in several fans become several vertices."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .._graph import connected
from .._names import few
from .pairing import joined_ends, paired_corners
from .soup import Soup


def with_fans_apart(soup: Soup, *, split_edges: bool = False) -> Soup:
    """One copy of a vertex for every fan of faces around it, the first fan keeps the vertex.

    With ``split_edges``, faces around an edge of more than two faces hang together in pairs only, the pairs that bend
    least; so its vertices get copies, too.
    """
    places = np.arange(len(soup.points))
    pairs = paired_corners(soup, places, np.arange(len(soup.corners)), split=split_edges)
    fans = connected(joined_ends(soup, pairs, places), len(soup.corners))
    _, first, fan = np.unique(fans, return_index=True, return_inverse=True)
    owners = soup.corners[first]  # vertex of each fan
    by_age = np.argsort(first)  # fans by their first corner
    _, oldest = np.unique(owners[by_age], return_index=True)
    is_copy = np.ones(len(first), np.bool_)
    is_copy[by_age[oldest]] = False
    if not is_copy.any():
        return soup
    names = owners.copy()
    copies = by_age[is_copy[by_age]]
    names[copies] = len(soup.points) + np.arange(len(copies))
    added = owners[copies]
    vertices = np.unique(soup.vertices[added])
    result = replace(
        soup,
        points=np.concatenate([soup.points, soup.points[added]]),
        corners=names[fan.reshape(-1)],
        vertices=np.concatenate([soup.vertices, soup.vertices[added]]),
        merged=np.concatenate([soup.merged, len(soup.points) + np.arange(len(added))]),
    )
    return result.saying(
        f"split {vertices.size} vertex(es), one copy for each fan of faces, {len(added)} more in all: vertices ",
        few("vertex", vertices),
        ".",
    )
