"""What hides lines in a picture: the planes of the triangles that are seen, at samples along lines and by blocks."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from ..rasterisation.planes import SeenPlanes

_BLOCK = 16  # pixels along each side
_SLOPES = 1.5  # pixels over which the surface may fall away before it hides a line


class Hiding(NamedTuple):
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
        depths = torch.nn.functional.pad(depths, (0, 1), value=torch.inf)  # -1 picks the last
        rows = []
        for strip in torch.split(number, _BLOCK):
            shown = torch.nn.functional.pad(depths[strip], (0, -number.shape[1] % _BLOCK), value=-torch.inf)
            rows.append(shown.amax(0).view(-1, _BLOCK).amax(1))
        return torch.nn.functional.max_pool2d(torch.stack(rows)[None], 3, stride=1, padding=1)[0]

    def samples(self, ends: Tensor, steps: Tensor) -> tuple[Tensor, Tensor]:
        """Which of ``steps + 1`` samples along each line lie on or before the surface, and the first of each line.

        Args:
            ends: (n, 2, 3) ends of lines.
            steps: (n,) at least 1.
        """
        counts = steps + 1
        first = counts.cumsum(0) - counts
        line = torch.repeat_interleave(counts)
        number = torch.arange(line.shape[0], device=line.device) - first.index_select(0, line)
        position = (number / steps.to(ends).index_select(0, line))[:, None]
        both = ends.reshape(-1, 6).index_select(0, line)
        places = torch.lerp(both[:, :3], both[:, 3:], position)
        height, width = self.seen.number.shape
        column = places[:, 0].floor().clamp_(0, width - 1)
        row = places[:, 1].floor().clamp_(0, height - 1)
        behind = self.seen.number.flatten().index_select(0, (row * width + column).to(torch.int64))
        seen = behind < 0
        over = torch.nonzero(~seen).squeeze(1)
        if over.shape[0]:
            places = places.index_select(0, over)
            depth, slope = self.seen.planes.at(behind.index_select(0, over), places)
            seen[over] = places[:, 2] <= depth + (_SLOPES * slope + self.tolerance)
        return seen, first


def may_be_seen(farthest: Tensor, ends: Tensor) -> Tensor:
    """(n,) whether lines (n, 2, 3) are longer than a block of pixels, or not behind all that is seen around them.

    The first is what :meth:`Hiding.farthest_of_blocks` gives.
    """
    rows, columns = farthest.shape
    start, stop = ends.unbind(1)
    across, down, _ = (stop - start).abs().unbind(1)
    column = (start[:, 0] / _BLOCK).clamp(0, columns - 1).to(torch.int64)
    row = (start[:, 1] / _BLOCK).clamp(0, rows - 1).to(torch.int64)
    around = farthest.flatten().index_select(0, row * columns + column)
    return (torch.maximum(across, down) > _BLOCK) | (torch.minimum(start[:, 2], stop[:, 2]) <= around)
