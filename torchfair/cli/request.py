"""What a job is to do, and how files are made of what came of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from torch import Tensor

    from ..io import PolygonMesh
    from ..viewing import ViewDirection


@dataclass
class Request:
    """What a job is to do.

    Attributes:
        mesh: Where it starts.
        options: Arguments of the function that does it, by name, beside settings and callback.
        start: Its first arguments; by default vertices and topology of the mesh.
        notes: What was decided while reading, in words.
        warnings: What is likely to fail, and what to do instead; said before it is tried.
        marks: Marked edges (E,) of the mesh, which go with it; None for none.
        settings: To solve with; by default those that options ask for.
        report: Entries of the report beside those that all jobs have.
        missed: What was asked for beside the job and is not there, in words.
        interrupted: Whether the job was interrupted too late for that to change it, or what comes after it was.
        view: From where pictures are taken; None for the usual direction.
    """

    mesh: PolygonMesh
    options: dict[str, Any]
    start: Sequence[Any] = ()
    notes: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    settings: Any = None
    marks: Tensor | None = None
    report: dict[str, Any] = field(default_factory=dict)
    missed: list[str] = field(default_factory=list)
    interrupted: bool = False
    view: ViewDirection | None = None


Writer = Callable[[Path, Any, Any, bool], object]
"""Writes one file from its path, the request, the result, and whether it may replace a file."""
Report = Callable[[], Mapping[str, Any]]
"""Makes the entries of a report."""
