"""Meshes named on the command line."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .errors import CommandError

if TYPE_CHECKING:
    from ..io import PolygonMesh


def read_input(name: str, repair: bool) -> PolygonMesh:
    """A mesh file, or a built-in example ``example:NAME``."""
    from ..io import PolygonMesh, load_mesh

    if not name.startswith("example:"):
        return load_mesh(name, repair=repair)
    from ..shapes import EXAMPLES, builtin_mesh

    example = name.removeprefix("example:")
    if example not in EXAMPLES:
        raise CommandError(f"there is no example '{example}': choose {', '.join(sorted(EXAMPLES))}")
    return PolygonMesh(*builtin_mesh(example))
