"""What the program says to those who called it."""

from __future__ import annotations

EXIT_OK = 0
EXIT_NOT_REACHED = 1
EXIT_ERROR = 2
EXIT_INTERRUPTED = 130
EXIT_BROKEN_PIPE = 141  # what a shell reports for a program ended by SIGPIPE

IN_WORDS = (
    "exit codes: 0 done, and all that was promised holds; 1 something that was asked for was not reached (files are "
    "written, the last line says what); 2 wrong usage, unreadable input, existing output or unsuitable mesh (one line "
    "on stderr says what); 130 interrupted (the best found until then is written, if there is any)"
)
