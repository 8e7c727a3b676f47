"""The program that does one request, which it reads from stdin, for a command with many inputs."""

from __future__ import annotations

import sys


def main() -> int:
    """Runs the request; the exit code, with one line on stderr if something went wrong."""
    try:
        import pickle

        from .command import guarded

        request = pickle.load(sys.stdin.buffer)
    except KeyboardInterrupt:
        return 130
    return guarded(lambda: int(request.run(request)), request.name)
