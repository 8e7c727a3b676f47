"""Reports: what was asked, what came out, and with what."""

from __future__ import annotations

import os
import platform
from collections.abc import Mapping
from typing import Any

from .._atomic import atomic_write_text
from .json_text import to_json


def write_report(path: str | os.PathLike[str], entries: Mapping[str, Any], *, overwrite: bool = False) -> None:
    """Writes a report as JSON, whole or not at all, with ``versions`` beside the entries.

    Keys are sorted, so that reports of equal runs differ in times only. Numbers that are not finite become null.

    Args:
        path: The file.
        entries: Of dictionaries, lists, tensors, dataclasses, words and numbers; such as
            :func:`~torchfair.formfinding.job_report`.
        overwrite: Whether an existing file may be replaced.

    Raises:
        ValueError: the entries have ``versions`` themselves.
        TypeError: an entry cannot be written as JSON.
        MeshFileError: the file cannot be written.
    """
    if "versions" in entries:
        raise ValueError("versions are added here: leave them out")
    atomic_write_text(path, to_json({**entries, "versions": versions()}), overwrite=overwrite)


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
