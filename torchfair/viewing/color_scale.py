"""Colours of values from zero to an end, and the bar that explains them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import torch
from torch import Tensor

from .sheet import CAPTION, MARGIN, Sheet, points

if TYPE_CHECKING:
    from matplotlib.colors import ListedColormap

BAR = 150  # room for the colour bar, in pixels
_LEFT, _WIDE = 44, 26  # of it beside the bar, and of the bar
_CLEAR = 4  # between pictures and the title of the bar


@dataclass(frozen=True)
class ColorScale:
    """A sequential scale from 0, light, to ``limit``, dark.

    Attributes:
        label: Of the bar, may hold mathematics between dollar signs.
        limit: Value of the darkest colour.
        clipped: Whether some values lie beyond it; the bar then ends in an arrow.
        color_map: Name of a colour map of matplotlib.
        lightest: Start in the colour map, 0 to 1.
    """

    label: str
    limit: float
    clipped: bool
    color_map: str
    lightest: float

    @classmethod
    def of(cls, values: Tensor, label: str, *, color_map: str, lightest: float = 0.0) -> ColorScale:
        """Ends at the largest value, or at the 98 % quantile where the largest is more than 1.5 times that."""
        if values.shape[0] == 0:
            return cls(label, 1.0, False, color_map, lightest)
        values = values.to("cpu", torch.float64)
        largest = float(values.max())
        usual = float(values[:: max(1, values.shape[0] // 1_000_000)].quantile(0.98))
        clipped = largest > 1.5 * usual > 0
        return cls(label, (usual if clipped else largest) or 1.0, clipped, color_map, lightest)

    def colors(self, values: Tensor) -> Tensor:
        """Colours ``(N, 3)`` (float32, on the CPU) of ``values`` (N,); what lies beyond the end is as dark as that."""
        table = torch.from_numpy(self._table()(torch.linspace(0, 1, 256).numpy())[:, :3]).to(torch.float32)
        return table[(values.detach().cpu() / self.limit * 255).round().clamp(0, 255).to(torch.int64)]

    def _table(self) -> ListedColormap:
        import matplotlib
        from matplotlib.colors import ListedColormap

        base = matplotlib.colormaps[self.color_map]
        return ListedColormap(base(torch.linspace(self.lightest, 1, 256).numpy()))

    def draw_bar(self, sheet: Sheet, body: int) -> None:
        """Draws the scale at the right of a sheet, halfway down a body of that many pixels."""
        from matplotlib.cm import ScalarMappable
        from matplotlib.colors import Normalize

        height = min(round(0.75 * (body - CAPTION)), 520)
        top = (
            sheet.top + CAPTION + (body - CAPTION - height) // 2 + 0.25
        )  # not on the edge of a pixel, where rounding decides
        axes = sheet.axes(sheet.width - MARGIN - BAR + _LEFT, top, _WIDE, height)
        scale = ScalarMappable(Normalize(0, self.limit), self._table())
        bar = sheet.figure.colorbar(scale, cax=axes, extend="max" if self.clipped else "neither", extendfrac=0.04)
        bar.outline.set_linewidth(points(1))
        bar.ax.tick_params(labelsize=points(19), width=points(1), length=points(5))
        title = bar.ax.set_title(self.label, fontsize=points(26), pad=points(16))
        room = 2 * (_LEFT + _WIDE / 2 - _CLEAR)  # around the middle of the bar: pictures would cover the rest
        wide = title.get_window_extent().width
        title.set_fontsize(points(26) * min(1.0, room / wide))
