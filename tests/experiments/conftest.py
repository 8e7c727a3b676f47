"""Running experiments as the command line would."""

from __future__ import annotations

import importlib
import json
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

FOLDER = Path(__file__).parents[2] / "experiments"


@pytest.fixture
def script(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], ModuleType]:
    """Imports a script as the command line would find it."""
    monkeypatch.syspath_prepend(str(FOLDER))
    return importlib.import_module


@pytest.fixture
def run(script: Callable[[str], ModuleType], tmp_path: Path) -> Callable[..., dict[str, Any]]:
    """Runs a script in a folder and returns its JSON; the exit code must be as expected."""

    def call(name: str, *options: str, code: int = 0, folder: str = "out") -> dict[str, Any]:
        out = tmp_path / folder
        assert script(name).main(["--output", str(out), "--width", "400", *options]) == code
        result = out / "result.json"
        return json.loads(result.read_text()) if result.exists() else {}

    return call
