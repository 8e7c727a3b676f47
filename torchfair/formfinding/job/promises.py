"""What a job promises, measured on what it made."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from ..._names import FROM_ZERO, Names, Sentence

HANDLE_REACHED = 0.05  # mean edge lengths


@dataclass(frozen=True)
class Promise:
    """A bound that a result was asked to keep.

    Attributes:
        name: What is bounded, in words.
        asked: The bound.
        reached: What the result has.
        sense: ``"at most"`` or ``"at least"``.
        unit: Of both numbers, empty where there is none.
        remedy: What to change where it does not hold.
        of_settings: What the settings ask for, where the start of a level falls short of it; None where that is the
            bound.
        where: Which elements do not keep it, in words; empty where they all do, or where it is not known.
        slack: Relative allowance for rounding.
    """

    name: str
    asked: float
    reached: float
    sense: Literal["at most", "at least"] = "at most"
    unit: str = ""
    remedy: str = ""
    of_settings: float | None = None
    where: str | Sentence = ""
    slack: float = 1e-6

    @property
    def holds(self) -> bool:
        """Whether the result keeps the bound; False where it is no number."""
        allowance = self.slack * abs(self.asked)
        if self.sense == "at most":
            return self.reached <= self.asked + allowance
        return self.reached >= self.asked - allowance

    def __str__(self) -> str:
        return self.told()

    def told(self, names: Names = FROM_ZERO) -> str:
        """As text, with faces and vertices called by their names."""
        unit = f" {self.unit}" if self.unit else ""
        bound = f"{self.sense} {self.asked:.3g}"
        if self.of_settings is None or self.of_settings == self.asked:
            words = f"{self.name} {self.reached:.3g}{unit}, {bound} asked for"
        else:
            words = f"{self.name} {self.reached:.3g}{unit}, {bound} as at the start ({self.of_settings:.3g} asked for)"
        if self.holds:
            return words
        return "; ".join(filter(None, (f"{words}: NOT REACHED", self._where(names), self.remedy)))

    def as_dict(self) -> dict[str, object]:
        """For reports."""
        return {
            "name": self.name,
            "asked": self.asked,
            "reached": self.reached,
            "sense": self.sense,
            "unit": self.unit,
            "holds": self.holds,
            "of_settings": self.of_settings,
            "where": self._where(),
        }

    def _where(self, names: Names = FROM_ZERO) -> str:
        return self.where if isinstance(self.where, str) else self.where.told(names)


def handle_promise(away: float, edge: float, *, remedy: str, unit: str = "") -> Promise:
    """Handles are within a twentieth of a mean edge of their targets.

    Args:
        away: Largest distance of a handle from its target.
        edge: Mean edge length in the same unit.
        remedy: What to change where they are not.
        unit: Of both, empty for that of the input.
    """
    return Promise("distance of a handle from its target", HANDLE_REACHED * edge, away, unit=unit, remedy=remedy)
