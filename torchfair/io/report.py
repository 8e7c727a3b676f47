"""The file ``report.json``: what was asked, what came out, and with what."""

from __future__ import annotations

import os
import platform
from collections.abc import Mapping, Sequence
from typing import Any

from .atomic import atomic_write_text
from .json_text import to_json


def write_report(
    path: str | os.PathLike[str],
    *,
    energies_before: Mapping[str, float],
    energies_after: Mapping[str, float],
    residuals: Sequence[object],
    history: Sequence[object],
    settings: object,
    timings: Mapping[str, float],
    extra: Mapping[str, Any] | None = None,
    overwrite: bool = False,
) -> None:
    """Writes a report as JSON, whole or not at all.

    Keys are sorted, so that reports of equal runs differ in ``timings`` and elapsed times only. Numbers that are
    not finite are written as null. Besides the arguments the file has ``versions``.

    Args:
        path: the file.
        energies_before: value by key, the key of an energy being its module's name in snake_case.
        energies_after: likewise.
        residuals: rows of the residual table, dataclasses or mappings.
        history: one record per iteration, dataclasses or mappings, or objects with ``as_dict()``.
        settings: dataclass or mapping.
        timings: seconds by phase.
        extra: further entries (input and output file, status, ...).
        overwrite: whether an existing file may be replaced.

    Raises:
        ValueError: if ``extra`` repeats an entry.
        MeshFileError: if the file cannot be written.
    """
    entries = {
        "energies": {"before": energies_before, "after": energies_after},
        "residuals": [_row(row) for row in residuals],
        "history": [_row(record) for record in history],
        "settings": settings,
        "timings": timings,
        "versions": versions(),
    }
    repeated = sorted(entries.keys() & (extra or {}).keys())
    if repeated:
        raise ValueError(f"extra entries may not repeat {', '.join(repeated)}")
    atomic_write_text(path, to_json({**entries, **(extra or {})}), overwrite=overwrite)


def versions() -> dict[str, str]:
    """Versions of Python and of the packages that numbers depend on."""
    import numpy
    import scipy
    import torch

    from .. import __version__

    return {
        "numpy": numpy.__version__,
        "python": platform.python_version(),
        "scipy": scipy.__version__,
        "torch": torch.__version__,
        "torchfair": __version__,
    }


def _row(row: object) -> object:
    as_dict = getattr(row, "as_dict", None)
    return as_dict() if callable(as_dict) else row
