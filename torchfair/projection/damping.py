"""The Levenberg-Marquardt parameter: how it follows the gain of each step (Nielsen 1999), or that it does not."""

from __future__ import annotations

import math
from dataclasses import dataclass

LARGEST = 1e20
SMALLEST = 1e-60  # from far starts the largest stiffness met is many powers of ten above that at the minimum
_FASTEST_FALL = 1.0 / 3.0
_OVERSHOT, _FASTEST_RISE = 10.0, 1e4


@dataclass(frozen=True)
class Damping:
    """Falls smoothly after steps that did what the model said, rises ever faster after rejected ones.

    Attributes:
        value: The parameter.
        growth: Factor of the next rise.
    """

    value: float
    growth: float = 2.0

    def accepted(self, gain: float) -> Damping:
        """After an accepted step whose actual over predicted decrease is ``gain``."""
        return Damping(max(self.value * max(_FASTEST_FALL, 1.0 - (2.0 * min(gain, 1.0) - 1.0) ** 3), SMALLEST))

    def shortened(self, halvings: int) -> Damping:
        """After an accepted step that had to be halved so often: what keeps the next one as short, about."""
        return Damping(self.value * 4.0**halvings)

    def rejected(self, gain: float = 0.0) -> Damping:
        """After a rejected step of that ``gain``, or a singular system.

        A merit that rises by many times what was promised to fall says that the step is far too long: on a parabola
        the best one is ``1 / (2 - gain)`` as long. Waiting for doublings would cost a solve each. A tenth of that is
        made up at once: all of it leads to runs of short steps, which are taken for the end.
        """
        overshot = min(-gain / _OVERSHOT, _FASTEST_RISE) if math.isfinite(gain) and gain < -_OVERSHOT else 0.0
        return Damping(self.value * max(self.growth, overshot), 2.0 * self.growth)

    @property
    def exhausted(self) -> bool:
        """Whether there is no larger value to try."""
        return self.value > LARGEST


@dataclass(frozen=True)
class ConstantDamping(Damping):
    """Stays what it is after every step, the paper's ``w_reg``; rises only where the system is singular."""

    def accepted(self, gain: float) -> ConstantDamping:
        """Itself, whatever the step gained."""
        return self

    def rejected(self, gain: float = 0.0) -> ConstantDamping:
        """After a singular system."""
        return ConstantDamping(self.value * self.growth, 2.0 * self.growth)
