"""Charts on a :class:`torchfair.viewing.sheet.Sheet`, all in one style."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from torchfair.viewing.sheet import FAINT_TEXT, TEXT, Sheet, points

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito: tell each other apart with any kind of colour vision, and in grey by their order.
BLUE, ORANGE, GREEN, RED, PURPLE, SKY, GREY = (
    "#0072B2",
    "#E69F00",
    "#009E73",
    "#D55E00",
    "#CC79A7",
    "#56B4E9",
    "#5b6472",
)
DASHES = (0, (4, 3))


def add_chart(
    sheet: Sheet, left: float, top: float, width: float, height: float, *, title: str = "", x: str = "", y: str = ""
) -> Axes:
    """Axes whose frame fills the given rectangle of the sheet (pixels); labels and ticks lie outside of it."""
    axes = sheet.axes(left, top, width, height)
    axes.set_title(title, fontsize=points(26), color=TEXT, pad=points(14))
    axes.set_xlabel(x, fontsize=points(23), color=TEXT, labelpad=points(8))
    axes.set_ylabel(y, fontsize=points(23), color=TEXT, labelpad=points(8))
    axes.tick_params(which="both", labelsize=points(19), colors=TEXT, width=points(1), length=points(5))
    axes.grid(which="major", color="#e3e7ec", linewidth=points(1))
    axes.set_axisbelow(True)
    for side, spine in axes.spines.items():
        spine.set_visible(side in ("left", "bottom"))
        spine.set(color=FAINT_TEXT, linewidth=points(1.2))
    return axes


def label(axes: Axes, words: str, x: float, y: float, color: str = TEXT, **style: Any) -> None:
    """Words inside a chart, in data coordinates."""
    axes.text(x, y, words, fontsize=points(20), color=color, **style)


def add_legend(place: Axes | Figure, **where: Any) -> None:
    """The legend of a chart or of a whole figure, without a frame."""
    place.legend(frameon=False, fontsize=points(20), labelcolor=TEXT, handlelength=1.8, **where)
