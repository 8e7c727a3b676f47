"""Settings of all tests."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator

import pytest
import torch
from hypothesis import settings
from pretended_device import PRETENDED, PretendedDevice

settings.register_profile("torchfair", deadline=None)  # how long an example takes says more about the machine
settings.load_profile("torchfair")

if "PYTEST_XDIST_WORKER" in os.environ:  # workers share the cores: threads of each would wait for those of others
    torch.set_num_threads(1)
    os.environ.setdefault("OMP_NUM_THREADS", "1")  # of programs that tests start

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # as shells set it for jobs in the background: tests press Ctrl-C
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--device",
        default="pretended",
        help="of tests that ask for a device: cuda, or another one of torch; by default one that is pretended",
    )


@pytest.fixture
def device(request: pytest.FixtureRequest) -> Iterator[torch.device]:
    """Another device than the CPU, real or pretended; see the option ``--device``."""
    name = request.config.getoption("--device")
    if name != "pretended":
        yield torch.empty(0, device=name).device  # with its number
        return
    with PretendedDevice():
        yield PRETENDED
