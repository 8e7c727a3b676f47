"""The page in a notebook, and the command that starts it."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest
import torch
from design_tools import ThreadEngine

from torchfair import Topology, TorchfairError
from torchfair.cli import main
from torchfair.design import view
from torchfair.design.engine import process
from torchfair.design.running import serve

VERTICES = torch.tensor([[0.0, 0, 0], [1, 0, 0], [1, 1, 0.2], [0, 1, 0]])
TOPOLOGY = Topology.from_faces([[0, 1, 2], [0, 2, 3]])


def test_a_mesh_is_shown_in_a_frame(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("websockets")
    monkeypatch.setattr(process, "EngineProcess", ThreadEngine)
    page = view(VERTICES, TOPOLOGY, folder=tmp_path, height=300, title='a<b"')
    try:
        shown = page._repr_html_()
        assert shown.startswith(f'<iframe src="{page.url}"')
        assert "height:300px" in shown
        for _ in range(200):
            if page.document is not None:
                break
            asyncio.run(asyncio.sleep(0.05))
        vertices, topology = page.mesh
        assert torch.equal(vertices, VERTICES.double())
        assert topology.face_lists() == TOPOLOGY.face_lists()
        assert page.document is not None
        assert page.document.title == 'a<b"'
    finally:
        page.close()
        page.close()


@pytest.mark.parametrize(
    ("words", "said"),
    [(["missing.obj"], "no such file"), (["--port", "70000"], "65535"), (["--port", "x"], "--port"),
     (["--loud"], "unrecognized")],
)  # fmt: skip
def test_what_cannot_be_served_is_one_line(words: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["design", *words]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert said in line


def test_without_websockets_the_way_out_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    from torchfair.design import running

    monkeypatch.setattr(running.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(TorchfairError, match=r"pip install 'torchfair\[design\]'"):
        view(VERTICES, TOPOLOGY)


@pytest.mark.parametrize("host", ["127.0.0.1", "0.0.0.0"])
def test_the_command_prints_the_address_and_warns_of_others(
    host: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("websockets")
    from torchfair.design import server

    seen: list[Any] = []

    async def short(one: server.DesignServer, ready: Any) -> None:
        def first(running: server.DesignServer) -> None:
            ready(running)
            seen.append(running.url)
            raise KeyboardInterrupt

        await serve(one, first)

    monkeypatch.setattr(process, "EngineProcess", ThreadEngine)
    monkeypatch.setattr("torchfair.design.running.serve", short)
    monkeypatch.chdir(tmp_path)
    assert main(["design", "example:roof", "--no-browser", "--host", host]) == 0
    out, err = capsys.readouterr()
    assert seen[0] in out
    assert seen[0].startswith("http://127.0.0.1:")
    assert "#token=" in seen[0]
    assert ("warning" in err) == (host != "127.0.0.1")
