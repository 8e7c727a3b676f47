from __future__ import annotations

import argparse
from collections.abc import Callable

import pytest

from torchfair.cli.arguments import count, non_negative, positive_count


def test_numbers_in_range() -> None:
    assert count("0") == 0
    assert positive_count("12") == 12
    assert non_negative("1e-3") == 1e-3


@pytest.mark.parametrize(
    ("convert", "texts"),
    [
        (count, ["-1", "1.5", "", "x"]),
        (positive_count, ["0", "-3", "2.0", "x"]),
        (non_negative, ["-1e-9", "nan", "inf", "x", ""]),
    ],
)
def test_everything_else_is_refused_with_what_was_expected(convert: Callable[[str], float], texts: list[str]) -> None:
    for text in texts:
        with pytest.raises(argparse.ArgumentTypeError, match=r"expected a .*number of at least .*, got"):
            convert(text)
