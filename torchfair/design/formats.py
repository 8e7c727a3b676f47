"""Formats that a design is saved in."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .session_file import SUFFIX

SESSION = "session"
FORMATS: Mapping[str, tuple[str, str, str]] = {
    SESSION: (SUFFIX, "session file, with everything", "application/zip"),
    "obj": (".obj", "OBJ, principal edges as lines", "text/plain"),
    "ply": (".ply", "PLY", "text/plain"),
    "off": (".off", "OFF", "text/plain"),
    "glb": (".glb", "GLB, triangles in single precision", "model/gltf-binary"),
    "stl": (".stl", "STL, triangles in single precision", "model/stl"),
    "3dm": (".3dm", "3DM", "application/octet-stream"),
    "dxf": (".dxf", "DXF, MESH entities", "image/vnd.dxf"),
    "strips": (".svg", "strips laid flat, SVG", "image/svg+xml"),
}
"""Suffix, words and media type by name."""


def formats_message() -> list[dict[str, Any]]:
    """All of them, for the page."""
    return [{"format": name, "suffix": suffix, "words": words} for name, (suffix, words, _) in FORMATS.items()]
