"""Files of a training run: events for TensorBoard where it is installed, and states that are checked."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch

from torchfair import TorchfairError


class EventLog:
    """Numbers of logged steps for TensorBoard; nothing at all where that is not installed.

    Args:
        folder: for the event files.
        wanted: whether to write them.
    """

    def __init__(self, folder: Path, wanted: bool) -> None:
        self._writer: Any = None
        if wanted:
            try:
                from torch.utils.tensorboard import SummaryWriter
            except ImportError:
                return
            self._writer = SummaryWriter(str(folder))

    def add(self, record: Mapping[str, float]) -> None:
        """The numbers of one step."""
        if self._writer is not None:
            for key, value in record.items():
                if key not in ("step", "seconds"):
                    self._writer.add_scalar(key, value, int(record["step"]))

    def close(self) -> None:
        """Writes what is left."""
        if self._writer is not None:
            self._writer.close()


def checked_state(path: Path, device: str) -> dict[str, Any]:
    """What ``torch.save`` wrote.

    Raises:
        TorchfairError: if it is something else.
    """
    try:
        state: dict[str, Any] = torch.load(path, map_location=device, weights_only=True)
    except Exception as error:  # torch raises all kinds of errors for files that are not its own
        raise TorchfairError(f"{path} is no checkpoint ({type(error).__name__}). Start again with --force.") from None
    return state
