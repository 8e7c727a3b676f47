"""Where flat strips cover themselves, and where to cut them."""

from __future__ import annotations

import numpy as np

from ._unroll import Floats, Ints, quads_of

_TOUCHING = 1e-6  # of the size of a quad: closed rings touch where they are cut


def overlaps(flat: Floats) -> Ints:
    """Pairs (k, 2) of quads, the smaller number first, that are not neighbours and have a common part.

    Quads that only touch do not overlap; convex quads are compared exactly, by separating lines.
    """
    from scipy.spatial import cKDTree

    quads = quads_of(flat)
    centres = quads.mean(1)
    radii = np.linalg.norm(quads - centres[:, None], axis=2).max(1)
    pairs = cKDTree(centres).query_pairs(2 * radii.max(), output_type="ndarray")
    pairs = np.sort(pairs, axis=1).astype(np.int64)
    i, j = pairs.T
    near = np.linalg.norm(centres[i] - centres[j], axis=1) < radii[i] + radii[j]
    i, j = pairs[near & (j - i > 1)].T
    tolerance = _TOUCHING * np.minimum(radii[i], radii[j])
    apart = np.zeros(len(i), np.bool_)
    for own, other in ((quads[i], quads[j]), (quads[j], quads[i])):
        for corner in range(4):
            side = own[:, (corner + 1) % 4] - own[:, corner]
            outward = np.stack([side[:, 1], -side[:, 0]], axis=1) / np.linalg.norm(side, axis=1, keepdims=True)
            depth = ((other - own[:, corner, None]) * outward[:, None]).sum(2).min(1)
            apart |= depth > -tolerance
    return np.stack([i, j], axis=1)[~apart]


def pieces(flat: Floats) -> list[int]:
    """Quads at which to cut, from 0 to the number of quads, so that no piece overlaps itself.

    Pieces are of equal length where that does, and else as long as they can be.
    """
    size = len(flat) - 1
    pairs = overlaps(flat)
    if not len(pairs):
        return [0, size]
    first = np.full(size, -1)  # the last quad before each one that it overlaps
    np.maximum.at(first, pairs[:, 1], pairs[:, 0])
    cuts, start = [0], 0
    for quad, before in enumerate(first.tolist()):
        if before >= start:
            start = quad
            cuts.append(quad)
    count = len(cuts)
    even = [round(size * part / count) for part in range(count + 1)]
    begins = np.repeat(even[:-1], np.diff(even))
    return even if (first < begins).all() else [*cuts, size]
