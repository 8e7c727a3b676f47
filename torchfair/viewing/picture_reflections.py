"""Reflections as they were judged: contact sheets of all views."""

from __future__ import annotations

import os
from collections.abc import Sequence

import torch
from torch import Tensor

from ..reflection import ReflectionScore
from .shading import STRIPES_DARK, STRIPES_LIGHT
from .sheet import CAPTION, MARGIN, Sheet

_GAP = 16
_LETTER = 12  # pixels, at most, of a letter of a note
_PAPER = (1.0, 1.0, 1.0)
_LARGEST = (0.70, 0.05, 0.10)  # colour of a difference of 1
_LEFT_OUT = (0.88, 0.89, 0.91)


def mirror_colors(stripes: Tensor, coverage: Tensor) -> Tensor:
    """Colours (..., H, W, 3) of stripes (..., H, W) that were rendered on a background of 0, on white paper."""
    dark, light, paper = (stripes.new_tensor(color) for color in (STRIPES_DARK, STRIPES_LIGHT, _PAPER))
    covered = coverage[..., None]
    return dark * covered + (light - dark) * stripes[..., None] + paper * (1 - covered)


def picture_reflections(
    path: str | os.PathLike[str],
    score: ReflectionScore,
    title: str = "",
    *,
    stripes: int = 0,
    overwrite: bool = False,
) -> tuple[int, int]:
    """Writes a PNG with all views: the mesh as a mirror, what it is compared with, and the difference.

    Pixels are those that were compared; differences are white where both agree and red where they differ. Below each
    view is its score, the mean over all stripe directions.

    Args:
        path: the PNG file.
        score: result of :func:`torchfair.reflection.reflection_score`.
        title: words on top; none by default.
        stripes: number of the stripe direction that is shown.
        overwrite: whether an existing file may be replaced.

    Returns:
        Width and height of the picture in pixels.

    Raises:
        MeshFileError: if the file cannot be written.
    """
    reference = "the same mesh, smoothly shaded" if score.setup.reference is None else "reference"
    rows = {
        "mesh, every face a plane mirror": mirror_colors(score.images[:, stripes], score.coverage),
        reference: mirror_colors(score.reference_images[:, stripes], score.reference_coverage),
        "difference": _differences(score)[:, stripes],
    }
    captions = [_words(f"view {view + 1}", value) for view, value in enumerate(score.per_view.mean(-1).tolist())]
    return _write(path, title, rows, captions, overwrite)


def picture_reflection_differences(
    path: str | os.PathLike[str], score: ReflectionScore, title: str = "", *, overwrite: bool = False
) -> tuple[int, int]:
    """Writes a PNG with the differences of all views (columns) and stripe directions (rows), each below its score.

    Args:
        path: the PNG file.
        score: result of :func:`torchfair.reflection.reflection_score`.
        title: words on top; none by default.
        overwrite: whether an existing file may be replaced.

    Returns:
        Width and height of the picture in pixels.

    Raises:
        MeshFileError: if the file cannot be written.
    """
    differences = _differences(score)
    rows = {}
    for number in range(differences.shape[1]):
        rows[f"stripe direction {number + 1}"] = differences[:, number]
    captions = [_words(f"view {view + 1}", value) for view, value in enumerate(score.per_view.mean(-1).tolist())]
    return _write(path, title, rows, captions, overwrite, score.per_view.T.tolist())


def _words(name: str, value: float) -> str:
    return f"{name}:  {value:.3f}"


def _differences(score: ReflectionScore) -> Tensor:
    """Colours (views, k, H, W, 3)."""
    size = (score.images - score.reference_images).abs().clamp(0, 1)[..., None]
    paper, red, left_out = (size.new_tensor(color) for color in (_PAPER, _LARGEST, _LEFT_OUT))
    colors = torch.lerp(paper, red, size)
    covered = ((score.coverage > 0) | (score.reference_coverage > 0))[:, None, ..., None]
    outside = torch.where(covered, left_out, paper)
    return torch.where(score.window[:, None, ..., None], colors, outside)


def _write(
    path: str | os.PathLike[str],
    title: str,
    rows: dict[str, Tensor],
    captions: list[str],
    overwrite: bool,
    scores: Sequence[Sequence[float]] = (),
) -> tuple[int, int]:
    """Rows of pictures (views, H, W, 3) with a note above each row, or above pictures their scores, and captions below.

    With ``scores``, one for every picture of every row, the note stands in the line before.
    """
    views, height, width, _ = next(iter(rows.values())).shape
    above = CAPTION * (2 if scores else 1)
    line, size = height + above, min(24, width / 9)
    columns = views * width + (views - 1) * _GAP
    wide = 2 * MARGIN + max(columns, _LETTER * max(map(len, rows)))  # notes over a single picture may be wider than it
    sheet = Sheet(wide, len(rows) * line + CAPTION + MARGIN // 2, title)
    first = (wide - columns) // 2
    for number, (note, pictures) in enumerate(rows.items()):
        top = sheet.top + number * line
        sheet.note(note, MARGIN, top)
        for view, picture in enumerate(pictures):
            left = first + view * (width + _GAP)
            sheet.image(picture, left, top + above)
            if scores:
                middle = left + width / 2, top + 1.5 * CAPTION
                sheet.text(f"{scores[number][view]:.3f}", *middle, size, ha="center", va="center")
    for view, caption in enumerate(captions):
        sheet.text(
            caption, first + view * (width + _GAP) + width / 2, sheet.top + len(rows) * line + CAPTION / 2,
            size, ha="center", va="center",
        )  # fmt: skip
    return sheet.write(path, overwrite=overwrite)
