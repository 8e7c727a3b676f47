"""What was not saved is kept: soon, whole, once, and nowhere else than beside the mesh."""

from __future__ import annotations

from pathlib import Path

from torchfair.design.autosave import Keeper, autosave_path


def test_the_newest_state_is_kept_at_the_end_at_the_latest(tmp_path: Path) -> None:
    keeper, made = Keeper(tmp_path, pause=3600.0), []

    def content(text: bytes) -> bytes:
        made.append(text)
        return text

    for text in (b"one", b"two", b"three"):
        keeper.keep("roof", lambda text=text: content(text))
    assert list(tmp_path.iterdir()) == []
    keeper.finish()
    keeper.finish()
    assert made == [b"three"]
    assert autosave_path(tmp_path, "roof").read_bytes() == b"three"
    keeper.keep("roof", lambda: content(b"four"))
    keeper.keep("roof", None)
    keeper.finish()
    assert made == [b"three"]
    assert list(tmp_path.iterdir()) == []


def test_titles_lead_nowhere_else(tmp_path: Path) -> None:
    for title in ("../../etc/passwd", "/etc/passwd", "..", "", "a\0b", "x" * 500):
        path = autosave_path(tmp_path, title)
        assert path.parent == tmp_path
        assert path.name.startswith(".")
        assert len(path.name) < 120


def test_a_folder_that_cannot_be_written_to_is_no_reason_to_stop(tmp_path: Path) -> None:
    keeper = Keeper(tmp_path / "nowhere", pause=3600.0)
    keeper.keep("roof", lambda: b"one")
    keeper.finish()
