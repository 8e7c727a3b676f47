"""What a design waits for, and what is being dragged."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from .document import Document


@dataclass(frozen=True)
class Pending:
    """What the engine is doing.

    Attributes:
        serial: Of the request.
        what: Such as ``drag``.
        document: What there will be once it is done, but for its places; None where nothing changes.
        window, id: Whose command it is.
        busy: In words.
        extra: What else belongs to it.
    """

    serial: int
    what: str
    document: Document | None = None
    window: int | None = None
    id: int | None = None
    busy: str = ""
    extra: Any = None


@dataclass
class Drag:
    """What is being dragged.

    Attributes:
        serial: Of its requests.
        window: That drags.
        document: With handles and weights as they are now.
        began: How it was before.
    """

    serial: int
    window: int
    document: Document
    began: Document
