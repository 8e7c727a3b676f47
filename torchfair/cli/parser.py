"""The parser of the command line."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Callable
from typing import Any, NoReturn

from .chosen_vertices import joined_places
from .errors import CommandError
from .reading import with_default_tolerance


class CommandParser(argparse.ArgumentParser):
    """Parser that raises :class:`CommandError` where argparse would print its usage and exit.

    Args:
        fill: Adds the arguments, once they are asked for: options that are made from settings of the library would
            otherwise import it for every other command.
    """

    def __init__(self, *args: Any, fill: Callable[[CommandParser], None] | None = None, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        # argparse takes -0.5 for a number but -5e-1 for an option; coordinates may be written either way
        self._negative_number_matcher = re.compile(r"-(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?$")
        self._fill = fill

    def parse_known_args(self, *args: Any, **kwargs: Any) -> Any:
        """See argparse."""
        fill, self._fill = self._fill, None
        if fill is not None:
            fill(self)
        words = list(sys.argv[1:] if not args or args[0] is None else args[0])
        parsed: Any = super().parse_known_args(joined_places(with_default_tolerance(words)), *args[1:], **kwargs)
        if not hasattr(parsed[0], "options"):  # those of a command come first
            parsed[0].options = tuple(self._option_string_actions)
        return parsed

    def error(self, message: str) -> NoReturn:
        """Refuses the arguments."""
        raise CommandError(f"{message} ({self.prog} --help lists the options)", self.prog)
