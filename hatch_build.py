"""The README of the packages: index pages show it without the files beside it, so links to them would lead nowhere."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

try:
    from hatchling.metadata.plugin.interface import MetadataHookInterface
except ModuleNotFoundError:  # only builds have it
    MetadataHookInterface = object

HOME = ""
"""Where the files of a version lie on the network, such as ``https://.../blob/v0.2.0/``; empty while it has no home."""
RELATIVE = r"\((?!https?://|#)([^()\s]+)\)"


def readme_of_packages(text: str, home: str = HOME) -> str:
    """The README with absolute links; without a home, links are words and pictures are left out."""
    if home:
        return re.sub(r"\]" + RELATIVE, lambda found: f"]({home.rstrip('/')}/{found[1]})", text)
    text = re.sub(r"!\[[^\]]*\]" + RELATIVE + r"\n*", "", text)
    return re.sub(r"\[([^\]]*)\]" + RELATIVE, r"\1", text)


class ReadmeHook(MetadataHookInterface):
    """Called by hatchling for the sdist and the wheel."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Sets the field ``readme``."""
        text = (Path(self.root) / "README.md").read_text(encoding="utf-8")
        metadata["readme"] = {"content-type": "text/markdown", "text": readme_of_packages(text)}
