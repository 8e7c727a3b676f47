"""Mesh edges as lines on the screen: hidden parts removed, any width and colour per edge."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor

from ..rasterisation.planes import SeenPlanes
from ..rasterisation.scan import Spans, span_chunks, triangle_spans

_LONGEST = 4096  # samples along one edge
_DEPTH_SHARE = 1e-3  # of all depths, by which lines may lie behind the surface
_PORTION = 1 << 18  # lines looked at together: a large mesh would need gigabytes
_MANY = 1 << 16  # lines from which on those that are hidden as a whole are told first, by blocks of pixels
_BLOCK = 16  # pixels along each side
_SLOPES = 1.5  # pixels over which the surface may fall away before it hides a line


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


def visible_lines(surface: Surface, edges: Tensor, widths: Tensor) -> Tensor:
    """Number of the line on top of each pixel, -1 where there is none, ``(height, width)`` int32.

    Of several lines the one with the largest number is on top.

    A line is tested along its middle, one sample per pixel, against the surface there; where the sample is seen,
    the line is seen in its full width. So lines on a folded or steep surface are not nibbled at, and lines behind
    do not shine through.

    Args:
        surface: the surface; its points are also the end points of the edges.
        edges: ``(E, 2)`` point numbers.
        widths: ``(E,)`` in pixels; lines of width 0 are left out.
    """
    height, width = surface.face_index.shape
    depths = surface.points.detach()[:, 2].to(torch.float64)[edges]
    finite = torch.isfinite(surface.points.detach()).all(-1)[edges].all(-1)
    drawn = torch.nonzero((widths > 0) & finite).squeeze(1)
    top = torch.full((height * width,), -1, dtype=torch.int32, device=surface.points.device)
    if drawn.shape[0]:
        tolerance = _DEPTH_SHARE * float(depths[drawn].amax() - depths[drawn].amin())
        hiding = _Hiding(SeenPlanes.of(surface.points, surface.triangles, surface.face_index), tolerance)
        farthest = hiding.farthest_of_blocks() if drawn.shape[0] >= _MANY else None
        for some in torch.split(drawn, _PORTION):
            ends = surface.points.detach()[edges[some]].to(torch.float64)
            if farthest is not None:
                before = torch.nonzero(_may_be_seen(farthest, ends)).squeeze(1)
                ends, some = ends[before], some[before]
            _put_lines(top, hiding, ends, widths[some], some)
    return top.view(height, width)


class _Hiding(NamedTuple):
    """What hides lines.

    Attributes:
        seen: The planes that are seen.
        tolerance: Depth by which a line may lie behind them.
    """

    seen: SeenPlanes
    tolerance: float

    def farthest_of_blocks(self) -> Tensor:
        """Largest depth at which a line may be seen in each block of pixels or beside it, infinite where nothing is."""
        number, planes = self.seen
        depths = planes.farthest() + (_SLOPES * planes.slopes() + self.tolerance)
        depths = torch.nn.functional.pad(depths, (0, 1), value=torch.inf)[number]  # -1 picks the last
        height, width = depths.shape
        depths = torch.nn.functional.pad(depths, (0, -width % _BLOCK, 0, -height % _BLOCK), value=-torch.inf)
        rows, columns = (size // _BLOCK for size in depths.shape)
        blocks = depths.view(rows, _BLOCK, columns, _BLOCK).amax(3).amax(1)
        return torch.nn.functional.max_pool2d(blocks[None], 3, stride=1, padding=1)[0]


def _may_be_seen(farthest: Tensor, ends: Tensor) -> Tensor:
    """(n,) whether lines (n, 2, 3) are longer than a block of pixels, or not behind all that is seen around them."""
    rows, columns = farthest.shape
    column, row = (ends[:, 0, :2] / _BLOCK).floor().clamp(min=0).unbind(1)
    block = (row.clamp(max=rows - 1) * columns + column.clamp(max=columns - 1)).to(torch.int64)
    long = ((ends[:, 1] - ends[:, 0])[:, :2].abs() > _BLOCK).any(1)
    return long | (ends[..., 2].amin(1) <= farthest.flatten()[block])


def _put_lines(top: Tensor, hiding: _Hiding, ends: Tensor, widths: Tensor, numbers: Tensor) -> None:
    """Puts lines (n, 2, 3) with these numbers on top of the pixels that have none, or one with a smaller number."""
    height, width = hiding.seen.number.shape
    widths, numbers = widths.to(torch.float64), numbers.to(torch.int32)
    steps = _lengths(ends).ceil().clamp(1, _LONGEST).to(torch.int64)
    seen, first = _seen_samples(hiding, ends, steps)
    visible = torch.nonzero(_any_of_each(seen, first, steps + 1)).squeeze(1)
    ends, widths, numbers, steps, first = (part[visible] for part in (ends, widths, numbers, steps, first))
    along, lengths = ends[:, 1, :2] - ends[:, 0, :2], _lengths(ends)
    quads, triangles = _ribbons(ends, along, lengths, widths)
    spans = triangle_spans(quads, triangles, width, height)
    line = spans.triangle // 2
    sample, sample_step = _positions(ends, along, lengths, steps, spans, line)
    first_sample, last_sample = first[line], first[line] + steps[line]
    first_pixel, number = spans.row * width + spans.start, numbers[line]
    for span, offset in span_chunks(spans):
        place = sample.index_select(0, span) + sample_step.index_select(0, span) * offset
        place = place.clamp_(min=0).to(torch.int64) + first_sample.index_select(0, span)
        place = torch.minimum(place, last_sample.index_select(0, span))
        key = torch.where(seen.index_select(0, place), number.index_select(0, span), -1)
        top.scatter_reduce_(0, first_pixel.index_select(0, span) + offset, key, "amax")


def _lengths(ends: Tensor) -> Tensor:
    """(n,) of lines (n, 2, 3) on the screen."""
    lengths: Tensor = torch.linalg.vector_norm(ends[:, 1, :2] - ends[:, 0, :2], dim=-1)
    return lengths


def _any_of_each(seen: Tensor, first: Tensor, counts: Tensor) -> Tensor:
    """(n,) whether any of so many samples of a line is seen."""
    before = torch.cat([seen.new_zeros(1, dtype=torch.int64), seen.cumsum(0)])
    return before[first + counts] > before[first]


def _positions(
    ends: Tensor, along: Tensor, lengths: Tensor, steps: Tensor, spans: Spans, line: Tensor
) -> tuple[Tensor, Tensor]:
    """Number of the sample beside the first pixel of each span, and how it changes from pixel to pixel."""
    tiny = torch.finfo(torch.float64).tiny
    rate = (along * (steps / (lengths**2).clamp(min=tiny))[:, None])[line]
    offset = torch.stack([spans.start, spans.row], dim=1) + 0.5 - ends[line, 0, :2]
    return (offset * rate).sum(-1), rate[:, 0]


def _seen_samples(hiding: _Hiding, ends: Tensor, steps: Tensor) -> tuple[Tensor, Tensor]:
    """Which of ``steps + 1`` samples along each line lie on or before the surface, and the first of each line."""
    counts = steps + 1
    first = counts.cumsum(0) - counts
    line = torch.repeat_interleave(counts)
    number = torch.arange(line.shape[0], device=line.device) - first[line]
    position = (number / steps[line].to(ends))[:, None]
    places = torch.lerp(ends[line, 0], ends[line, 1], position)
    height, width = hiding.seen.number.shape
    column = places[:, 0].floor().clamp(0, width - 1).to(torch.int64)
    row = places[:, 1].floor().clamp(0, height - 1).to(torch.int64)
    behind = hiding.seen.number[row, column]
    seen = behind < 0
    over = torch.nonzero(~seen).squeeze(1)
    if over.shape[0]:
        depth, slope = hiding.seen.planes.at(behind[over], places[over, :2])
        seen[over] = places[over, 2] <= depth + (_SLOPES * slope + hiding.tolerance)
    return seen, first


def _ribbons(ends: Tensor, along: Tensor, lengths: Tensor, widths: Tensor) -> tuple[Tensor, Tensor]:
    """Each line as two triangles around its middle, lengthened by half its width at both ends."""
    forward = torch.where(lengths[:, None] > 0, along / lengths.clamp(min=1e-12)[:, None], 0)
    forward = forward * (widths / 2)[:, None]
    sideways = torch.stack([-forward[:, 1], forward[:, 0]], dim=-1)
    start, stop = ends[:, 0, :2] - forward, ends[:, 1, :2] + forward
    corners = torch.stack([start - sideways, stop - sideways, stop + sideways, start + sideways], dim=1)
    quads = torch.nn.functional.pad(corners.reshape(-1, 2), (0, 1))
    base = 4 * torch.arange(ends.shape[0], device=ends.device)[:, None]
    triangles = torch.cat([base, base + 1, base + 2, base, base + 2, base + 3], dim=1)
    return quads, triangles.view(-1, 3)
