"""The command ``torchfair``; every subcommand is one file with ``add_parser`` and ``run``."""

from __future__ import annotations

from collections.abc import Sequence


def main(argv: Sequence[str] | None = None) -> int:
    """Runs ``torchfair``, see :func:`torchfair.cli.command.main`; Ctrl-C ends it quietly while it is loaded, too."""
    try:
        from .command import main as run
    except KeyboardInterrupt:
        return 130
    except ImportError as error:
        from .._interrupts import was_interrupted

        if not was_interrupted(error):
            raise
        return 130
    return run(argv)
