"""How a command ended: exit code and one line for every error."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from .._interrupts import was_interrupted
from ..errors import TorchfairError
from .errors import CommandError
from .exit_codes import EXIT_ERROR, EXIT_INTERRUPTED, EXIT_NOT_REACHED, EXIT_OK


@dataclass(frozen=True)
class Outcome:
    """How a command ended.

    Attributes:
        code: Its exit code.
        error: What went wrong, in words; empty where there is nothing to say.
        name: The command that says so.
    """

    code: int
    error: str = ""
    name: str = ""

    @property
    def line(self) -> str:
        """For stderr, one line; empty where there is nothing to say."""
        words = self.error if self.code == EXIT_INTERRUPTED or not self.error else f"error: {self.error}"
        return " ".join(f"{self.name}: {words}".split()) if words else ""

    def told(self, what: str) -> str:
        """How it ended for one of many, whose name stands before it."""
        if self.error:
            return f"{what}: {' '.join(self.error.split()).removeprefix(f'{what}: ')}"
        known = {
            EXIT_OK: "done",
            EXIT_NOT_REACHED: "something that was asked for was not reached",
            EXIT_INTERRUPTED: "interrupted",
        }
        return f"{what}: {known.get(self.code, f'ended with code {self.code}')}"


def outcome_of(run: Callable[[], int], name: str) -> Outcome:
    """Runs a command; errors that its user can mend become words. A reader that went away raises BrokenPipeError."""
    try:
        return Outcome(int(run()), name=name)
    except BrokenPipeError:
        raise
    except KeyboardInterrupt:
        return Outcome(EXIT_INTERRUPTED, "interrupted", name)
    except ImportError as error:
        if not was_interrupted(error):
            raise
        return Outcome(EXIT_INTERRUPTED, "interrupted", name)
    except SystemExit as stop:  # argparse, after printing help
        return Outcome(stop.code if isinstance(stop.code, int) else EXIT_OK, name=name)
    except CommandError as error:
        return Outcome(EXIT_ERROR, str(error), error.name or name)
    except TorchfairError as error:
        return Outcome(EXIT_ERROR, str(error), name)
    except OSError as error:
        place = f"{error.filename}: " if error.filename is not None else ""
        return Outcome(EXIT_ERROR, f"{place}{error.strerror or error}", name)
