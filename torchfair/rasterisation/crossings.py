"""Segments cut where outlines pass before or behind them."""

from __future__ import annotations

import torch
from torch import Tensor

from .runs import run_chunks
from .segments import Segments, cut_items


def cut_at_crossings(segments: Segments, ends: Tensor, outline: Tensor, num_pixels: int) -> Segments:
    """The segments, cut where one of an outline and any other cross in their pixel: both of them.

    Where no triangles penetrate each other, what is seen beside an edge changes nowhere else.

    Args:
        segments: pieces of edges, ordered by pixel.
        ends: (E, 2, 2) pixel coordinates of both ends of every edge, float64.
        outline: (E,) mask of the edges where a surface ends or turns away.
        num_pixels: pixels of all pictures.
    """
    cutting = torch.nonzero(outline.index_select(0, segments.edge)).squeeze(1)
    first = torch.nn.functional.pad(torch.bincount(segments.pixel, minlength=num_pixels).cumsum(0), (1, 0))
    pixel = segments.pixel.index_select(0, cutting)
    begin = first.index_select(0, pixel)
    origin, along = ends[:, 0], ends[:, 1] - ends[:, 0]
    found, places = [cutting[:0]], [ends.new_zeros(0)]
    for item, crossed in run_chunks(begin, first.index_select(0, pixel + 1) - begin):
        cutter = cutting.index_select(0, item)
        pair = segments.edge.index_select(0, crossed), segments.edge.index_select(0, cutter)
        (ax, ay), (bx, by) = (along.index_select(0, edge).unbind(-1) for edge in pair)
        dx, dy = (origin.index_select(0, pair[1]) - origin.index_select(0, pair[0])).unbind(-1)
        turn = ax * by - ay * bx
        here, there = (dx * by - dy * bx) / turn, (dx * ay - dy * ax) / turn  # not finite if parallel
        inside = _within(segments, crossed, here) & _within(segments, cutter, there)
        found += [crossed[inside], cutter[inside]]
        places += [here[inside], there[inside]]
    item, start, stop = cut_items(segments.begin, segments.end, torch.cat(found), torch.cat(places))
    return Segments(segments.edge.index_select(0, item), segments.pixel.index_select(0, item), start, stop)


def _within(segments: Segments, number: Tensor, position: Tensor) -> Tensor:
    begin, end = segments.begin.index_select(0, number), segments.end.index_select(0, number)
    return (begin < position) & (position < end)
