"""Requests in processes of their own, several at a time."""

from __future__ import annotations

import argparse
import os
import pickle
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import IO, Any

from .._interrupts import deferred_interrupts
from .exit_codes import EXIT_INTERRUPTED
from .outcomes import Outcome

_WAIT = 0.05  # seconds between looks


class _Process:
    """One request in a process."""

    def __init__(self, request: argparse.Namespace, threads: int) -> None:
        self.request = request
        self._out, self._err = _printed(), _printed()
        request.quiet = True
        # A session of its own: Ctrl-C at the terminal reaches this process alone, which hands it on once.
        self._process = subprocess.Popen(
            _worker(),
            stdin=subprocess.PIPE,
            stdout=self._out,
            stderr=self._err,
            env={**os.environ, "OMP_NUM_THREADS": str(threads), "PYTHONIOENCODING": "utf-8"},
            start_new_session=os.name != "nt",
        )
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(pickle.dumps(request))
            self._process.stdin.close()
        except BrokenPipeError:
            pass  # it has ended; its code says how

    @property
    def runs(self) -> bool:
        """Whether it has not ended."""
        return self._process.poll() is None

    def interrupt(self) -> None:
        """Hands an interrupt on."""
        if self.runs and os.name != "nt":  # there the terminal does it
            self._process.send_signal(signal.SIGINT)

    def kill(self) -> None:
        """Ends it at once."""
        if self.runs:
            self._process.kill()
        self._process.wait()

    def ended(self) -> tuple[Outcome, str]:
        """How it ended, and what it printed."""
        texts = []
        for file in (self._out, self._err):
            file.seek(0)
            texts.append(file.read())
            file.close()
        *others, last = texts[1].splitlines() or [""]
        code, name = self._process.returncode, self.request.name
        if code == -signal.SIGINT:
            code = EXIT_INTERRUPTED
        mark = f"{name}: error: "
        error = last.removeprefix(mark) if last.startswith(mark) else ""
        for line in others if error or code == EXIT_INTERRUPTED else texts[1].splitlines():
            print(f"{self.request.input}: {line}", file=sys.stderr)
        if code < 0:
            error = f"its process was ended by signal {-code}, by lack of memory, say"
        return Outcome(code, error, name), texts[0]


def run_in_processes(
    requests: Sequence[argparse.Namespace], jobs: int, kept: bool
) -> Iterator[tuple[argparse.Namespace, Outcome, str]]:
    """Runs requests in processes, so many at a time, and hands on what came of them in their order.

    Processors are shared out among them. Ctrl-C is handed on: each ends with the best it has found, and no other is
    begun; a second one makes them give up.
    """
    threads = max(1, _processors() // jobs)
    ended: dict[int, tuple[Outcome, str]] = {}
    running: dict[int, _Process] = {}
    begun, done, told, stopped = 0, 0, 0, False
    with deferred_interrupts() as interrupts, _all_ended(running):
        while told < len(requests):
            try:
                interrupts.check()
                while begun < len(requests) and (stopped or len(running) < jobs):
                    number, begun = begun, begun + 1
                    if stopped:
                        ended[number] = Outcome(EXIT_INTERRUPTED, "not begun", requests[number].name), ""
                    else:
                        running[number] = _Process(requests[number], threads)
                for number in [number for number, process in running.items() if not process.runs]:
                    ended[number] = running.pop(number).ended()
                    stopped = stopped or ended[number][0].code == EXIT_INTERRUPTED
                    done += 1
                    _say(done, requests, number, ended[number][0])
                if told not in ended:
                    time.sleep(_WAIT)
            except KeyboardInterrupt:
                stopped = True
                for process in running.values():
                    process.interrupt()
            while told in ended:
                outcome, printed = ended[told]
                if not kept and printed:
                    print(f"== {requests[told].input}\n{printed}", end="", flush=True)
                yield requests[told], outcome, printed
                told += 1


def _worker() -> list[str]:
    """The program that does a request; it finds modules where this one does, and not in the working folder first."""
    lines = [f"sys.path[:] = {sys.path!r}", "from torchfair.cli.worker import main", "sys.exit(main())"]
    return [sys.executable, "-c", "; ".join(["import sys", *lines])]


def _printed() -> IO[str]:
    """What a process prints; pipes would make it wait for this one."""
    return tempfile.TemporaryFile("w+", encoding="utf-8", errors="backslashreplace")


@contextmanager
def _all_ended(running: dict[int, _Process]) -> Iterator[None]:
    """Leaves no process behind."""
    try:
        yield
    finally:
        for process in running.values():
            process.kill()


def _say(count: int, requests: Sequence[Any], number: int, outcome: Outcome) -> None:
    print(f"[{count}/{len(requests)}] {outcome.told(requests[number].input)}", file=sys.stderr, flush=True)


def _processors() -> int:
    """How many threads torch would take."""
    allowed = os.environ.get("OMP_NUM_THREADS", "")
    if allowed.isdigit() and int(allowed) > 0:
        return int(allowed)
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
