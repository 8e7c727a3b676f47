"""What a subcommand raises to end with one line on stderr."""

from __future__ import annotations


class CommandError(Exception):
    """A request that cannot be met; ends the program with its message on stderr and exit code 2.

    Attributes:
        name: the command as the user typed it, such as ``torchfair fair``; None for the one that is running.
    """

    def __init__(self, message: str, name: str | None = None) -> None:
        super().__init__(message)
        self.name = name
