"""How a file may be read that cannot be read as it is."""

from __future__ import annotations

from collections.abc import Mapping

AS_IT_IS, CANCEL = "as_it_is", "cancel"
KEPT, FILE = "kept", "file"
CELLS = (10, 20, 40)
"""By which surfaces are sampled, in each direction."""
REPAIRS: Mapping[str, tuple[tuple[str, ...], str]] = {
    "weld": (("weld",), "weld edges at the same place"),
    "repair": (("repair",), "repair"),
    "repair_and_weld": (("repair", "weld"), "repair, and weld edges at the same place"),
    "split_edges": (("repair", "split_edges"), "repair, and split edges of more than two faces"),
    **{f"surfaces_{n}": ((f"surfaces={n}",), f"sample its surfaces, {n} by {n} cells each") for n in CELLS},
    **{f"surfaces_{n}_weld": ((f"surfaces={n}", "weld"), f"{n} by {n} cells each, and weld them") for n in CELLS},
}
"""Answers, what they mean for reading the file (see ``torchfair/_reading_words.py``), and words."""


def kept_question(name: str) -> tuple[str, tuple[tuple[str, str], ...]]:
    """Whether to go on with edits of a file that were never saved: the sentence, and value and words of each answer."""
    sentence = f"there are edits of {name} that were not saved"
    return sentence, ((KEPT, "go on with them"), (FILE, "open the file without them"), (CANCEL, "open nothing"))


def answers(*values: str, as_it_is: bool = False) -> tuple[tuple[str, str], ...]:
    """Value and words of each answer; the last one changes nothing."""
    own = ((AS_IT_IS, "open it as it is"),) if as_it_is else ()
    return (*((value, REPAIRS[value][1]) for value in values), *own, (CANCEL, "don't open it"))
