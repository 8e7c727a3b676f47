from __future__ import annotations

import enum
import json
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import torch

import torchfair
from torchfair import MeshFileError
from torchfair.io import plain, to_json, versions, write_report


class Colour(enum.Enum):
    DARK_RED = "an explanation"


@dataclass
class Row:
    name: str
    mean: float


class Record:
    def as_dict(self) -> dict[str, object]:
        return {"iteration": 1, "merit": math.inf}


def report(path: Path, **changes: object) -> dict[str, object]:
    entries = {
        "energies_before": {"normal_variation": 2.0},
        "energies_after": {"normal_variation": 1.0, "angle_variation": math.nan},
        "residuals": [Row("closeness", 0.5)],
        "history": [Record()],
        "settings": {"weight": 1.0},
        "timings": {"total": 0.25},
    }
    write_report(path, **{**entries, **changes})
    return json.loads(path.read_text())


def test_report_has_all_entries(tmp_path: Path) -> None:
    written = report(tmp_path / "report.json", extra={"status": Colour.DARK_RED})
    assert written["energies"]["before"] == {"normal_variation": 2.0}
    assert written["energies"]["after"] == {"normal_variation": 1.0, "angle_variation": None}
    assert written["residuals"] == [{"name": "closeness", "mean": 0.5}]
    assert written["history"] == [{"iteration": 1, "merit": None}]
    assert written["settings"] == {"weight": 1.0}
    assert written["timings"] == {"total": 0.25}
    assert written["status"] == "dark_red"
    assert written["versions"] == versions()
    assert set(versions()) == {"torchfair", "torch", "numpy", "scipy", "python"}
    assert versions()["torchfair"] == torchfair.__version__


def test_report_is_sorted_strict_and_reproducible(tmp_path: Path) -> None:
    report(tmp_path / "a.json", extra={"b": 1, "a": 2})
    report(tmp_path / "b.json", extra={"a": 2, "b": 1})
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
    report(path, overwrite=True)
    assert len(json.loads(path.read_text())) > 4
    assert len(list(tmp_path.iterdir())) == 1


def test_extra_entries_may_not_hide_others(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="history"):
        report(tmp_path / "report.json", extra={"history": []})
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
    assert type(plain(enum.IntEnum("Level", {"LOW": 1}).LOW)) is str


def test_other_objects_are_refused() -> None:
    with pytest.raises(TypeError, match="object"):
        plain({"x": object()})
