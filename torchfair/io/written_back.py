"""Which attributes of a file that was read go into the file that is written."""

from __future__ import annotations

from .obj_attributes import ObjAttributes
from .rhino_parts import RhinoParts

Attributes = ObjAttributes | RhinoParts
HELD: dict[str, type] = {".obj": ObjAttributes, ".3dm": RhinoParts, ".dxf": RhinoParts}
"""What files of a format hold."""


def written_back(attributes: Attributes | None, suffix: str, *, same_faces: bool, count: int) -> Attributes | None:
    """What a file of that format holds of them; None for nothing.

    Args:
        attributes: As they were read.
        suffix: Of the file to be written, in lower case.
        same_faces: Whether it has the same faces in the same order.
        count: Of its faces.
    """
    if not isinstance(attributes, HELD.get(suffix, ())):
        return None
    return attributes if same_faces else of_other_faces(attributes, count)


def of_other_faces(attributes: Attributes | None, count: int) -> Attributes | None:
    """What is left for a mesh of so many other faces: unit, name and layer of a 3DM file."""
    return attributes.of_other_faces(count) if isinstance(attributes, RhinoParts) else None
