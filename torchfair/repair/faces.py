"""Faces that are dropped: those that occur twice, and those without area."""

from __future__ import annotations

import numpy as np

from .._names import Ints, few, few_groups
from .._sorted_keys import edge_keys, groups_of
from .soup import Bools, Soup


def without_duplicates(soup: Soup) -> Soup:
    """Every face once.

    Faces are the same if they have the same corners in the same cyclic order; in the opposite one, too, where one of
    their edges has more than two faces. Two faces back to back alone are a closed surface and stay.
    """
    first = _first_alike(soup)
    if (first == np.arange(len(first))).all():
        return soup
    keys = edge_keys(soup.corners, soup.heads, len(soup.points))
    order, _, counts = groups_of(keys)
    crowded = np.zeros(len(keys), np.bool_)
    crowded[order] = np.repeat(counts > 2, counts)
    in_crowd = np.bincount(soup.corner_faces, weights=crowded, minlength=len(first)) > 0
    again = (first != np.arange(len(first))) & (in_crowd | _same_way(soup, first))
    twice = np.flatnonzero(again)
    if not twice.size:
        return soup
    named = (
        [("face", int(soup.faces[face])), " like ", ("face", int(soup.faces[first[face]]))] for face in twice.tolist()
    )
    told = soup.saying(f"dropped {twice.size} face(s) that occur twice: faces ", few_groups(named, twice.size), ".")
    return told.keeping(~again)


def _first_alike(soup: Soup) -> Ints:
    """(F,) the first face with the same corners, in the same or in the opposite order."""
    first = np.arange(len(soup.faces))
    for size in np.unique(soup.sizes).tolist():
        faces = np.flatnonzero(soup.sizes == size)
        rows = soup.corners[soup.offsets[faces, None] + np.arange(size)]
        rows = np.take_along_axis(rows, (rows.argmin(1)[:, None] + np.arange(size)) % size, axis=1)
        turned = np.where(rows[:, 1] > rows[:, -1], 1, 0)[:, None]  # the smaller neighbour of the smallest comes next
        rows = np.where(turned, np.roll(rows[:, ::-1], 1, axis=1), rows)
        _, where, group = np.unique(rows, axis=0, return_index=True, return_inverse=True)
        first[faces] = faces[where[group.reshape(-1)]]
    return first


def _same_way(soup: Soup, first: Ints) -> Bools:
    """(F,) whether each face that is like an earlier one has its corners in the order of that one."""
    later = np.flatnonzero(first != np.arange(len(first)))
    models = np.isin(soup.corner_faces, first[later])
    steps = set(zip(*(part[models].tolist() for part in (soup.corner_faces, soup.corners, soup.heads)), strict=True))
    starts = soup.offsets[later]
    rows = zip(*(part.tolist() for part in (first[later], soup.corners[starts], soup.heads[starts])), strict=True)
    same = np.zeros(len(first), np.bool_)
    same[later] = [row in steps for row in rows]
    return same


def without_flat_faces(soup: Soup) -> Soup:
    """Faces that have an area; all of them where none has any, since then positions mean nothing."""
    flat = soup.without_area()
    if not flat.any() or flat.all():
        return soup
    dropped = soup.faces[flat]
    told = soup.saying(f"dropped {len(dropped)} face(s) without area: faces ", few("face", dropped), ".")
    return told.keeping(~flat)
