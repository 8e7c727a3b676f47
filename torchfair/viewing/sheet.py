"""A page that pictures and words are put on, pixel by pixel, and written as a PNG file."""

from __future__ import annotations

import io
import os
import warnings
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from .._atomic import atomic_write_bytes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TEXT = "#1b2230"
FAINT_TEXT = "#6b7280"
MARGIN = 36  # around the page, in pixels
GAP = 32  # between columns
CAPTION = 52  # height of a line of captions
_TITLE = 56
_DPI = 144


class Sheet:
    """A white page with a title and room for pictures; positions are pixels from the top left corner.

    matplotlib is imported here and nowhere at import time; its global state (pyplot, rcParams) is not touched.

    Args:
        width: columns of pixels.
        body: rows of pixels below the title.
        title: words on top, taken literally; without them no room is left for a title.

    Attributes:
        top: first row of the body.
    """

    def __init__(self, width: int, body: int, title: str = "") -> None:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        self.top = _TITLE if title else 0
        self.width, self.height = width, self.top + body
        self.figure = Figure(figsize=(width / _DPI, self.height / _DPI), dpi=_DPI, facecolor="white")
        self.canvas = FigureCanvasAgg(self.figure)
        self._images: list[tuple[npt.NDArray[np.uint8], int, int]] = []
        self._labels: list[tuple[str, float, float, float]] = []
        if title:
            size = min(30, 1.5 * width / len(title))  # long ones smaller, so that they fit
            style: dict[str, Any] = {"ha": "center", "va": "center", "weight": "bold", "parse_math": False}
            self.text(title, width / 2, 0.6 * _TITLE, size, **style)

    def image(self, picture: Tensor, left: int, top: int) -> None:
        """Puts ``picture`` (rows, columns, 3) in 0..1 with its corner at ``(left, top)``, over everything else."""
        pixels = (picture.clamp(0, 1) * 255).round().to("cpu", torch.uint8).numpy()
        self._images.append((pixels, left, top))

    def text(self, words: str, x: float, y: float, size: float = 22, color: str = TEXT, **style: Any) -> None:
        """Words at ``(x, y)``; ``size`` in pixels, ``style`` as for ``matplotlib.text.Text`` (``ha``, ``va``)."""
        self.figure.text(x / self.width, 1 - y / self.height, words, fontsize=size * 72 / _DPI, color=color, **style)

    def label(self, words: str, x: float, y: float, size: float = 18) -> None:
        """Words at ``(x, y)`` over pictures, on a light ground."""
        self._labels.append((words, x, y, size))

    def caption(self, words: str, left: float, top: float, width: float) -> None:
        """Words in the middle of a line of captions, smaller where they would not fit into the width."""
        self.text(words, left + width / 2, top + CAPTION / 2, 26, ha="center", va="center")
        written = self.figure.texts[-1]
        share = width / max(written.get_window_extent().width, 1.0)
        written.set_fontsize(float(written.get_fontsize()) * min(1.0, share))

    def note(self, words: str, left: float, top: float) -> None:
        """Small faint words at the left of a line of captions."""
        self.text(words, left, top + CAPTION / 2, 20, FAINT_TEXT, va="center")

    def axes(self, left: float, top: float, width: float, height: float) -> Axes:
        """Axes that fill the given rectangle."""
        bottom = self.height - top - height
        rectangle = (left / self.width, bottom / self.height, width / self.width, height / self.height)
        return self.figure.add_axes(rectangle)

    def pixels(self) -> npt.NDArray[np.uint8]:
        """The page as ``(height, width, 3)``."""
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message="Glyph", category=UserWarning)  # in file names used as titles
            self.canvas.draw()  # type: ignore[no-untyped-call]
        page = np.ascontiguousarray(np.asarray(self.canvas.buffer_rgba(), np.uint8)[..., :3])  # type: ignore[no-untyped-call]
        for picture, left, top in self._images:
            page[top : top + picture.shape[0], left : left + picture.shape[1]] = picture
        return self._with_labels(page) if self._labels else page

    def _with_labels(self, page: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
        """The page with its labels over it."""
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        figure = Figure(figsize=(self.width / _DPI, self.height / _DPI), dpi=_DPI, facecolor="none")
        canvas = FigureCanvasAgg(figure)
        ground = {"boxstyle": "round,pad=0.12", "facecolor": "white", "edgecolor": "none", "alpha": 0.72}
        for words, x, y, size in self._labels:
            place = x / self.width, 1 - y / self.height
            figure.text(*place, words, fontsize=size * 72 / _DPI, color=TEXT, ha="center", va="center", bbox=ground)
        canvas.draw()  # type: ignore[no-untyped-call]
        over = np.asarray(canvas.buffer_rgba(), np.float64)  # type: ignore[no-untyped-call]
        share = over[..., 3:] / 255.0
        return np.asarray((page * (1.0 - share) + over[..., :3] * share).round(), np.uint8)

    def write(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> tuple[int, int]:
        """Writes the page as a PNG file, whole or not at all; returns its width and height.

        Raises:
            MeshFileError: if the file cannot be written, or exists and ``overwrite`` is false.
        """
        from PIL import Image

        data = io.BytesIO()
        Image.fromarray(self.pixels()).save(data, "png", compress_level=4)
        atomic_write_bytes(path, data.getvalue(), overwrite=overwrite)
        return self.width, self.height


def points(pixels: float) -> float:
    """Typographic points (for matplotlib's line widths and marker sizes) of a length in pixels of a sheet."""
    return pixels * 72 / _DPI
