"""Objects of other libraries, known by their attributes."""

from __future__ import annotations

from typing import Any

from ..errors import TorchfairError


def read(thing: object, library: str, *names: str) -> list[Any]:
    """The attributes of an object, none of which may be None.

    Raises:
        TorchfairError: naming those that it lacks.
    """
    missing = [name for name in names if getattr(thing, name, None) is None]
    if missing:
        raise TorchfairError(f"{type(thing).__name__} is not a mesh of {library}: it has no {' and no '.join(missing)}")
    return [getattr(thing, name) for name in names]
