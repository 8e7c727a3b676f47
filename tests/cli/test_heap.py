"""Memory that commands keep until they end."""

from __future__ import annotations

import subprocess
import sys

import pytest

from torchfair import _memory
from torchfair.cli import command

_COUNT = """
import resource, numpy
from torchfair._memory import keep_freed_memory
def faults():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(5): numpy.ones(4_000_000)
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before
before, kept = faults(), keep_freed_memory()
faults()
print(int(kept), before, faults())
"""


def test_kept_memory_is_not_taken_from_the_system_again() -> None:
    """Pages of an array are touched for the first time only once; on systems without that, nothing happens."""
    words = subprocess.run([sys.executable, "-c", _COUNT], capture_output=True, text=True, check=True).stdout.split()
    kept, before, after = map(int, words)
    if not kept:
        pytest.skip("not the GNU C library")
    assert after < before / 4


def test_pieces_below_the_bound_are_kept_from_the_start() -> None:
    """Where nothing was freed before, the library would still take pieces of this size from the system one by one."""
    count = _COUNT.replace("before, kept = faults(), keep_freed_memory()", "before, kept = 0, keep_freed_memory()")
    words = subprocess.run([sys.executable, "-c", count], capture_output=True, text=True, check=True).stdout.split()
    kept, _, after = map(int, words)
    if not kept:
        pytest.skip("not the GNU C library")
    assert after < 64


def test_threads_use_what_others_have_freed() -> None:
    count = _COUNT.replace("print(", "from concurrent.futures import ThreadPoolExecutor as Pool\nprint(")
    count = count.replace("before, faults())", "before, Pool(1).submit(faults).result())")
    words = subprocess.run([sys.executable, "-c", count], capture_output=True, text=True, check=True).stdout.split()
    kept, before, after = map(int, words)
    if not kept:
        pytest.skip("not the GNU C library")
    assert after < before / 4


@pytest.mark.parametrize("name", ["measure", "diagnose", "reflect"])
def test_processes_of_their_own_keep_memory(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The program does, a call of ``main`` in another program does not."""
    calls = []
    monkeypatch.setattr(command, "keep_freed_memory", lambda: calls.append(1))
    monkeypatch.setattr(command, "_run", lambda arguments: 0)
    assert command.main([name, "a.ply"]) == 0
    assert not calls
    monkeypatch.setattr(sys, "argv", ["torchfair", name, "a.ply"])
    assert command.main() == 0
    assert calls == [1]


def test_other_systems_are_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", "darwin")
    assert not _memory.keep_freed_memory()
