"""Files that come from windows and go to them, and those that are written."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from .._atomic import atomic_write_bytes
from .commands import Command, CommandRefused
from .containers import pack, unpack
from .effects import Deliver, Store
from .formats import FORMATS


def upload_command(data: bytes) -> Command:
    """The command of a binary message.

    Raises:
        CommandRefused: it is no upload.
    """
    try:
        message, arrays = unpack(data)
    except ValueError as error:
        raise CommandRefused(str(error)) from None
    number, name = message.get("id"), message.get("name")
    number = number if isinstance(number, int) and not isinstance(number, bool) else None
    if message.get("type") != "upload" or set(arrays) != {"bytes"} or arrays["bytes"].dtype.itemsize != 1:
        raise CommandRefused("a binary message has to be an upload of bytes", "upload", number)
    if not isinstance(name, str) or not 0 < len(name) <= 255 or not name.isprintable():
        raise CommandRefused("upload: name: expected the name of a file", "upload", number)
    return Command("upload", {"name": name, "bytes": arrays["bytes"].tobytes()}, number)


def download_message(effect: Deliver) -> bytes:
    """The container ``download``."""
    media = next((media for suffix, _, media in FORMATS.values() if effect.name.lower().endswith(suffix)), "")
    message = {"type": "download", "name": effect.name, "media": media or "application/octet-stream", "id": effect.id}
    return pack(message, {"bytes": np.frombuffer(effect.content(), np.uint8)})


def store(effect: Store) -> dict[str, Any]:
    """Writes a file; the message ``saved``.

    Raises:
        MeshFileError: it cannot be written, or exists.
    """
    content = effect.content()
    atomic_write_bytes(effect.path, content, overwrite=effect.overwrite)
    name = Path(effect.path).name
    return {"type": "saved", "id": effect.id, "name": name, "sentence": f"{name} is saved, {len(content)} bytes"}
