from __future__ import annotations

import enum
import json
import math
from pathlib import Path

import numpy as np
import pytest
import torch

import torchfair
from torchfair import MeshFileError
from torchfair.io import plain, to_json, versions, write_report


class Colour(enum.Enum):
    DARK_RED = "an explanation"


def report(path: Path, **entries: object) -> dict[str, object]:
    write_report(path, {"energies": {"after": {"normal_variation": math.nan}}, **entries})
    return json.loads(path.read_text())


def test_report_has_all_entries_and_versions(tmp_path: Path) -> None:
    written = report(tmp_path / "report.json", status=Colour.DARK_RED, vertices=torch.tensor([1.0]))
    assert written["energies"] == {"after": {"normal_variation": None}}
    assert (written["status"], written["vertices"]) == ("dark_red", [1.0])
    assert written["versions"] == versions()
    assert set(versions()) == {"torchfair", "torch", "numpy", "scipy", "python"}
    assert versions()["torchfair"] == torchfair.__version__
    assert written.keys() == {"energies", "status", "vertices", "versions"}


def test_report_is_sorted_strict_and_reproducible(tmp_path: Path) -> None:
    report(tmp_path / "a.json", b=1, a=2)
    report(tmp_path / "b.json", a=2, b=1)
    text = (tmp_path / "a.json").read_text()
    assert text == (tmp_path / "b.json").read_text()
    assert list(json.loads(text)) == sorted(json.loads(text))
    assert "NaN" not in text
    assert "Infinity" not in text


def test_existing_reports_are_kept(tmp_path: Path) -> None:
    path = tmp_path / "report.json"
    path.write_text("{}")
    with pytest.raises(MeshFileError, match="exists"):
        report(path)
    assert path.read_text() == "{}"
    write_report(path, {"a": 1}, overwrite=True)
    assert json.loads(path.read_text())["a"] == 1
    assert len(list(tmp_path.iterdir())) == 1


def test_entries_may_not_hide_versions(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="versions"):
        report(tmp_path / "report.json", versions=[])
    assert not list(tmp_path.iterdir())


def test_plain_values() -> None:
    value = {
        1: torch.tensor([1.0, math.nan]),
        "array": np.array([[1, 2]]),
        "scalar": np.float32(0.5),
        "tensor": torch.tensor(True),
        "path": Path("x") / "y",
        "nothing": None,
        "tuple": (1, -math.inf, "text"),
    }
    expected = {
        "1": [1.0, None],
        "array": [[1, 2]],
        "scalar": 0.5,
        "tensor": True,
        "path": str(Path("x") / "y"),
        "nothing": None,
        "tuple": [1, None, "text"],
    }
    assert plain(value) == expected
    assert json.loads(to_json(value)) == expected


def test_numpy_numbers_that_are_python_numbers_too_are_checked() -> None:
    assert plain(np.float64("nan")) is None
    assert type(plain(np.float64(2.0))) is float
    level = enum.IntEnum("Level", {"LOW": 1})
    assert type(plain(level(1))) is str


def test_other_objects_are_refused() -> None:
    with pytest.raises(TypeError, match="object"):
        plain({"x": object()})
