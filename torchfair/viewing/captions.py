"""Numbers under pictures."""

from __future__ import annotations

from torch import Tensor

from ..energies import angle_variation, normal_variation
from ..topology import Topology


def energy_caption(
    name: str,
    vertices: Tensor,
    topology: Topology,
    reference: tuple[Tensor, Topology] | None = None,
    terms: Tensor | None = None,
) -> str:
    """``name``, E and E' of one mesh ``(V, 3)``; with a ``reference`` mesh also how E has changed, in percent.

    The ``terms`` (I,) of E' need not be worked out again where they are known.
    """
    energy = float(normal_variation(vertices, topology))
    caption = f"{literal(name)}     $E$ = {four_digits(energy)}"
    base = float(normal_variation(*reference)) if reference is not None else 0.0
    if base > 0:
        caption += f"  ({signed_percent(energy / base - 1)})"
    angles = angle_variation(vertices, topology) if terms is None else terms.sum()
    return caption + f"     $E'$ = {four_digits(float(angles))}"


def four_digits(value: float) -> str:
    """Four significant digits, zeros at the end included: ``1.200``, ``1285``, without a point behind the last."""
    return f"{value:#.4g}".rstrip(".")


def literal(words: str) -> str:
    """``words`` such that matplotlib does not take them for mathematics."""
    return words.replace("$", r"\$")


def signed_percent(change: float) -> str:
    """Such as ``-12.3 %``, with a true minus sign."""
    return f"{100 * change:+.1f} %".replace("-", "\N{MINUS SIGN}")
