"""The Levenberg-Marquardt parameter: how it follows the gain of each step (Nielsen 1999)."""

from __future__ import annotations

from dataclasses import dataclass

LARGEST = 1e16
SMALLEST = 1e-16


@dataclass
class Damping:
    """Falls smoothly after steps that did what the model said, rises ever faster after rejected ones."""

    value: float
    _growth: float = 2.0

    def accept(self, gain: float) -> None:
        """After an accepted step whose actual over predicted decrease is ``gain``."""
        self.value = max(self.value * max(1.0 / 3.0, 1.0 - (2.0 * min(gain, 1.0) - 1.0) ** 3), SMALLEST)
        self._growth = 2.0

    def reject(self) -> bool:
        """After a rejected step or a singular system; False when there is no larger value to try."""
        self.value *= self._growth
        self._growth *= 2.0
        return self.value <= LARGEST
