"""What can be turned and chosen in each mode: weights with their ranges, and words."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any, NamedTuple

from ...errors import SettingsError
from ...formfinding import FairSettings, FormSettings, SymmetricSettings
from ..document import Document

SETTINGS: Mapping[str, type[Any]] = {"fair": FairSettings, "form": FormSettings, "symmetric": SymmetricSettings}
_RANGE = 1e3
"""A weight goes up to so many times its default."""


class Slider(NamedTuple):
    """A weight.

    Attributes:
        name: As of :meth:`torchfair.formfinding.Session.weigh`.
        words: For people.
        most: Where the default is 0; else a thousand times the default.
    """

    name: str
    words: str
    most: float = 0.0


class Choice(NamedTuple):
    """A word to choose.

    Attributes:
        name: Field of the settings.
        words: For people.
        values: Value and words of each.
    """

    name: str
    words: str
    values: tuple[tuple[str, str], ...]


SLIDERS: Mapping[str, tuple[Slider, ...]] = {
    "fair": (
        Slider("energy", "lower E"),
        Slider("fairness", "fair polylines"),
        Slider("closeness", "close to the reference"),
        Slider("handle", "pull of handles"),
        Slider("quality", "well shaped faces"),
        Slider("planarity", "planar panels"),
        Slider("free_boundary", "free boundary near its curves"),
    ),
    "form": (
        Slider("curvature", "lower C"),
        Slider("coarse_fairness", "fairness while dragging"),
        Slider("fairness", "fairness at rest"),
        Slider("tangential_fairness", "even triangles", 10.0),
        Slider("handle", "pull of handles"),
    ),
    "symmetric": (
        Slider("constraint", "principal symmetry"),
        Slider("fairness", "fair displacements"),
        Slider("anchor", "how near handles reach"),
        Slider("evenness", "even stars", 30.0),
        Slider("energy", "lower E", 10.0),
        Slider("saddle", "saddle sides"),
        Slider("handle", "pull of handles"),
    ),
}
_BOUNDARY = {"fixed": "stays", "glide": "glides on its curves", "free": "is free"}


def _boundary(*values: str) -> Choice:
    return Choice("boundary", "boundary", tuple((value, _BOUNDARY[value]) for value in values))


CHOICES: Mapping[str, tuple[Choice, ...]] = {
    "fair": (
        _boundary("glide", "fixed", "free"),
        Choice(
            "planar",
            "planarity",
            (("keep", "keep planar faces"), ("quads", "all faces planar"), ("none", "none")),
        ),
        Choice("flat", "flat panels", (("keep", "keep panels"), ("all", "keep all flat edges"), ("none", "none"))),
        Choice("directions", "directions of edges", (("free", "free"), ("keep", "keep"))),
    ),
    "form": (_boundary("fixed", "glide"),),
    "symmetric": (_boundary("free", "fixed"),),
}


@cache
def weight_range(mode: str, name: str) -> tuple[float, float, float]:
    """Default, least and most of a weight.

    Raises:
        SettingsError: there is no such slider.
    """
    known = {slider.name: slider for slider in SLIDERS[mode]}
    if name not in known:
        raise SettingsError(f"weights of the mode {mode} are {', '.join(known)}, got {name[:40]!r}")
    default = float(getattr(SETTINGS[mode](), f"{name}_weight"))
    least = 1e-3 * default if (mode, name) == ("symmetric", "constraint") else 0.0
    return default, least, known[name].most or _RANGE * default


def settings_of(document: Document) -> Any:
    """The settings of a document in its mode.

    Raises:
        SettingsError: a weight or a choice is none, or out of its range.
    """
    mode = document.mode
    weights = document.weights.get(mode, {})
    for name, value in weights.items():
        _, least, most = weight_range(mode, name)
        if not least <= value <= most:
            raise SettingsError(f"the weight {name} goes from {least:g} to {most:g}, got {value:g}")
    chosen = document.choices.get(mode, {})
    offered = {choice.name: [value for value, _ in choice.values] for choice in CHOICES[mode]}
    for name, word in chosen.items():
        if word not in offered.get(name, ()):
            raise SettingsError(f"choices of the mode {mode} are {offered}, got {name[:40]!r}: {word[:40]!r}")
    return SETTINGS[mode](**chosen, **{f"{name}_weight": value for name, value in weights.items()})


def settings_message(document: Document) -> dict[str, Any]:
    """What can be turned and chosen, and where it stands, for the page."""
    mode, settings = document.mode, settings_of(document)
    weights = []
    for slider in SLIDERS[mode]:
        default, least, most = weight_range(mode, slider.name)
        value = getattr(settings, f"{slider.name}_weight")
        weights.append({"name": slider.name, "words": slider.words, "value": value, "default": default,
                        "least": least, "most": most})  # fmt: skip
    choices = [
        {
            "name": choice.name,
            "words": choice.words,
            "value": getattr(settings, choice.name),
            "values": [{"value": value, "words": words} for value, words in choice.values],
        }
        for choice in CHOICES[mode]
    ]
    return {"type": "settings", "mode": mode, "weights": weights, "choices": choices}
