"""Mesh edges as lines on the screen: hidden parts removed, any width and colour per edge."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor

from ..rasterisation.planes import SeenPlanes
from ..rasterisation.quads import QuadSpans, parallelogram_spans
from ..rasterisation.scan import span_chunks
from .hiding import Hiding, may_be_seen

_LONGEST = 4096  # samples along one edge
_DEPTH_SHARE = 1e-3  # of all depths, by which lines may lie behind the surface
_PORTION = 1 << 15  # lines looked at together on a CPU: keeps temporaries near the cache
_LARGE_PORTION = 1 << 18  # elsewhere: a large mesh would need gigabytes
_MANY = 1 << 16  # lines from which on those that are hidden as a whole are told first, by blocks of pixels


@dataclass(frozen=True, eq=False)
class EdgeStyle:
    """How edges are drawn.

    Attributes:
        colors: ``(E, 3)``, or ``(3,)`` for all.
        widths: ``(E,)``, or one number for all, in pixels of the final picture; edges of width 0 are left out.
        order: ``(E,)`` numbers; where lines overlap, the edge with the larger one is on top (ties: the larger edge
            number). By default the edge number.
        opacity: 1 hides the surface under a line, 0 leaves no line.
        rim: width in pixels of a line where the mesh ends before the background, 0 for none; in the first colour. It
            follows what is seen, and so has no gaps where a surface of warped faces turns away inside of them.
    """

    colors: Tensor
    widths: Tensor | float = 0.7
    order: Tensor | None = None
    opacity: float = 1.0
    rim: float = 0.0


class Surface(NamedTuple):
    """What lines are tested against: projected points, triangles, and the triangle at each pixel."""

    points: Tensor
    triangles: Tensor
    face_index: Tensor


def visible_lines(surface: Surface, edges: Tensor, widths: Tensor, numbers: Tensor | None = None) -> Tensor:
    """Number of the line on top of each pixel, -1 where there is none, ``(height, width)`` int32.

    Of several lines the one with the largest number is on top.

    A line is tested along its middle, one sample per pixel, against the surface there; where the sample is seen,
    the line is seen in its full width. So lines on a folded or steep surface are not nibbled at, and lines behind
    do not shine through.

    Args:
        surface: the surface; its points are also the end points of the edges.
        edges: ``(E, 2)`` point numbers.
        widths: ``(E,)`` in pixels; lines of width 0 are left out.
        numbers: ``(E,)`` of the lines, at least 0 and within int32; by default their places in ``edges``.
    """
    height, width = surface.face_index.shape
    points = surface.points.detach().to(torch.float64)
    drawn = widths > 0
    finite = torch.isfinite(points).all(-1)
    if not bool(finite.all()):
        drawn &= finite[edges].all(-1)
    top = torch.full((height * width,), -1, dtype=torch.int32, device=points.device)
    if not bool(drawn.all()):
        chosen = torch.nonzero(drawn).squeeze(1)
        edges, widths, numbers = edges[chosen], widths[chosen], chosen if numbers is None else numbers[chosen]
    if edges.shape[0]:
        depths = points[:, 2][edges]
        hiding = Hiding(
            SeenPlanes.of(surface.points, surface.triangles, surface.face_index),
            _DEPTH_SHARE * float(depths.amax() - depths.amin()),
        )
        farthest = hiding.farthest_of_blocks() if edges.shape[0] >= _MANY else None
        portion = _PORTION if points.is_cpu else _LARGE_PORTION
        for begin in range(0, edges.shape[0], portion):
            some = slice(begin, begin + portion)
            ends = points.index_select(0, edges[some].reshape(-1)).view(-1, 2, 3)
            number = torch.arange(begin, begin + len(ends), device=points.device) if numbers is None else numbers[some]
            lines = _Lines(ends, widths[some].to(torch.float64), number.to(torch.int32))
            _put_lines(top, hiding, lines if farthest is None else lines.where(may_be_seen(farthest, ends)))
    return top.view(height, width)


class _Lines(NamedTuple):
    """Lines on the screen.

    Attributes:
        ends: (n, 2, 3), float64.
        widths: (n,), float64.
        numbers: (n,), int32.
    """

    ends: Tensor
    widths: Tensor
    numbers: Tensor

    def where(self, mask: Tensor) -> _Lines:
        """Some of them."""
        chosen = torch.nonzero(mask).squeeze(1)
        return _Lines(*(part.index_select(0, chosen) for part in self))


def _put_lines(top: Tensor, hiding: Hiding, lines: _Lines) -> None:
    """Puts lines on top of the pixels that have none, or one with a smaller number."""
    steps = _lengths(lines.ends).ceil().clamp(1, _LONGEST).to(torch.int64)
    seen, first = hiding.samples(lines.ends, steps)
    count = _seen_of_each(seen, first, steps + 1)
    _put_whole(top, hiding.seen.number.shape, lines.where(count > steps))
    partly = (count > 0) & (count <= steps)
    _put_seen(top, hiding.seen.number.shape, lines.where(partly), (seen, first[partly], steps[partly]))


def _put_whole(top: Tensor, shape: torch.Size, lines: _Lines) -> None:
    """The same of lines that are seen from end to end."""
    spans = _ribbons(lines, shape)
    first_pixel, number = spans.row * shape[1] + spans.start, lines.numbers.index_select(0, spans.quad)
    for span, pixel in span_chunks(spans.length, first_pixel):
        top.scatter_reduce_(0, pixel, number.index_select(0, span), "amax")


def _put_seen(top: Tensor, shape: torch.Size, lines: _Lines, samples: tuple[Tensor, Tensor, Tensor]) -> None:
    """The same where samples are seen: whether each is, the number of the first of each line, and that of the last."""
    seen, first, steps = samples
    spans = _ribbons(lines, shape)
    line = spans.quad
    sample, sample_step = _positions(lines.ends, steps, spans)
    first_sample, last_sample = first[line], (first + steps)[line]
    first_pixel, number = spans.row * shape[1] + spans.start, lines.numbers[line]
    for span, offset in span_chunks(spans.length):
        place = sample.index_select(0, span) + sample_step.index_select(0, span) * offset
        place = place.clamp_(min=0).to(torch.int64) + first_sample.index_select(0, span)
        place = torch.minimum(place, last_sample.index_select(0, span))
        key = torch.where(seen.index_select(0, place), number.index_select(0, span), -1)
        top.scatter_reduce_(0, first_pixel.index_select(0, span) + offset, key, "amax")


def _lengths(ends: Tensor) -> Tensor:
    """(n,) of lines (n, 2, 3) on the screen."""
    lengths: Tensor = torch.linalg.vector_norm(ends[:, 1, :2] - ends[:, 0, :2], dim=-1)
    return lengths


def _seen_of_each(seen: Tensor, first: Tensor, counts: Tensor) -> Tensor:
    """(n,) how many of so many samples of a line are seen."""
    before = torch.cat([seen.new_zeros(1, dtype=torch.int64), seen.cumsum(0)])
    return before[first + counts] - before[first]


def _positions(ends: Tensor, steps: Tensor, spans: QuadSpans) -> tuple[Tensor, Tensor]:
    """Number of the sample beside the first pixel of each span, and how it changes from pixel to pixel."""
    along, lengths = ends[:, 1, :2] - ends[:, 0, :2], _lengths(ends)
    tiny = torch.finfo(torch.float64).tiny
    rate = (along * (steps / (lengths**2).clamp(min=tiny))[:, None])[spans.quad]
    offset = torch.stack([spans.start, spans.row], dim=1) + 0.5 - ends[spans.quad, 0, :2]
    return (offset * rate).sum(-1), rate[:, 0]


def _ribbons(lines: _Lines, shape: torch.Size) -> QuadSpans:
    """Runs of the pixels of each line, a rectangle around its middle, lengthened by half its width at both ends."""
    (x0, y0, _), (x1, y1, _) = (end.T.unbind(0) for end in lines.ends.unbind(1))
    share = lines.widths / (2 * _lengths(lines.ends).clamp(min=1e-12))
    across, down = (x1 - x0) * share, (y1 - y0) * share
    left, top, right, bottom = x0 - across, y0 - down, x1 + across, y1 + down
    x = torch.stack([left + down, right + down, right - down, left - down])
    y = torch.stack([top - across, bottom - across, bottom + across, top + across])
    return parallelogram_spans(x, y, shape[1], shape[0])
