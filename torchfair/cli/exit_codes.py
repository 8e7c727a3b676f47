"""What the program says to those who called it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..projection import Status

EXIT_OK = 0
EXIT_NOT_REACHED = 1
EXIT_ERROR = 2
EXIT_INTERRUPTED = 130
EXIT_SIGNAL = 128  # and the number of another signal, as shells have it: 143 for SIGTERM
EXIT_BROKEN_PIPE = 141  # what a shell reports for a program ended by SIGPIPE

IN_WORDS = (
    "exit codes: 0 done, and all that was promised holds; 1 something that was asked for was not reached (files are "
    "written, the last line says what); 2 wrong usage, unreadable input, existing output or unsuitable mesh, or a "
    "result that could not be written where it was to go (one line on stderr says what, and where the result is); 130 "
    "interrupted, 143 by SIGTERM, 129 by SIGHUP (the best found until then is written, if there is any)"
)


def exit_code(status: Status | None, missed: Sequence[str], *, interrupted: bool = False) -> int:
    """That of a job that ended with a status, if it solved anything, and missed some promises.

    ``interrupted`` says whether what came after the solve was.
    """
    if status is not None:
        from ..projection import Status

        interrupted = interrupted or status is Status.INTERRUPTED
    if interrupted:
        return EXIT_INTERRUPTED
    return EXIT_NOT_REACHED if missed else EXIT_OK
