"""Vertices that lie inside a longer edge of the face beside them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .._names import few
from .._sorted_keys import edge_keys
from .soup import Soup
from .welding import rim_places

_LEAST = 1e-9  # of an edge: nearer to its ends, a vertex is no T-junction


def with_t_junctions_joined(soup: Soup, tolerance: float, *, by_place: bool = False) -> Soup:
    """Vertices of the boundary put into edges of the boundary on which they lie, where that joins faces.

    It joins faces where an edge between two neighbours among the ends of the long edge and the vertices inside of it is
    an edge of the boundary, too; with ``by_place``, an edge at the same place. Nothing is done where no face has any
    area.
    """
    count, single = len(soup.points), soup.rim
    if not single.size or soup.without_area().all():
        return soup
    tails, heads = soup.corners, soup.heads
    places = rim_places(soup, tolerance) if by_place else np.arange(count)
    known = set(edge_keys(places[tails[single]], places[heads[single]], count).tolist())
    inserted: dict[int, list[int]] = {}
    for corner, found in _candidates(soup, tolerance):
        inside = list({int(places[vertex]): vertex for vertex in found}.values())
        chain = places[[tails[corner], *inside, heads[corner]]]
        if known & set(edge_keys(chain[:-1], chain[1:], count).tolist()):
            inserted[corner] = inside
    if not inserted:
        return soup
    behind = np.array([corner + 1 for corner, inside in inserted.items() for _ in inside])
    added = np.array([vertex for inside in inserted.values() for vertex in inside])
    sizes = soup.sizes.copy()
    np.add.at(sizes, soup.corner_faces[behind - 1], 1)
    result = replace(
        soup,
        corners=np.insert(soup.corners, behind, added),
        origins=np.insert(soup.origins, behind, -1),
        offsets=np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64),
    )
    faces = np.unique(soup.faces[soup.corner_faces[list(inserted)]])
    return result.saying(
        f"put {len(added)} vertex(es) of T-junctions into the edges on which they lie: vertices ",
        few("vertex", soup.vertices[added]),
        "; faces ",
        few("face", faces),
        ".",
    )


def _candidates(soup: Soup, tolerance: float) -> list[tuple[int, list[int]]]:
    """Corners from which edges of the boundary run, with the vertices of the boundary inside of them, in order."""
    from scipy.spatial import cKDTree

    single, rim = soup.rim, soup.rim_vertices
    places = soup.points[rim].reshape(len(rim), -1)
    tree = cKDTree(places)
    tails = soup.points[soup.corners[single]].reshape(len(single), -1)
    ways = soup.points[soup.heads[single]].reshape(len(single), -1) - tails
    lengths = np.linalg.norm(ways, axis=1)
    near = tree.query_ball_point(tails + 0.5 * ways, 0.5 * lengths + tolerance, return_sorted=True)
    owners = soup.corner_faces[single].tolist()
    found = []
    for row, hits in enumerate(near):
        if len(hits) < 3:  # its own ends
            continue
        away = places[hits] - tails[row]
        share = away @ ways[row] / max(lengths[row] ** 2, 1e-300)
        gap = np.linalg.norm(away - share[:, None] * ways[row], axis=1)
        least = max(_LEAST, 2.0 * tolerance / max(lengths[row], 1e-300))
        inside = np.flatnonzero((gap <= tolerance) & (share > least) & (share < 1.0 - least))
        own = set(soup.corners[soup.offsets[owners[row]] : soup.offsets[owners[row] + 1]].tolist())
        ordered = [int(rim[hits[i]]) for i in inside[np.argsort(share[inside])].tolist()]
        ordered = [vertex for vertex in ordered if vertex not in own]
        if ordered:
            found.append((int(single[row]), ordered))
    return found
