"""Windows of the browser: to each the newest frame, and never two that it has not drawn."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass
class FrameGate:
    """What one window gets of the frames.

    Attributes:
        under_way: Number of the frame that was sent and not yet acknowledged; None for none.
        waiting: The newest frame that could not be sent, with its number.
    """

    under_way: int | None = None
    waiting: tuple[int, bytes] | None = field(default=None, repr=False)

    def offer(self, number: int, frame: bytes) -> bytes | None:
        """A newer frame; what has to be sent now, if anything."""
        if self.under_way is not None:
            self.waiting = number, frame
            return None
        self.under_way, self.waiting = number, None
        return frame

    def acknowledged(self, number: int) -> bytes | None:
        """A frame was drawn; what has to be sent now, if anything. Others than the one under way do not count."""
        if number != self.under_way:
            return None
        self.under_way = None
        return self.offer(*self.waiting) if self.waiting is not None else None
