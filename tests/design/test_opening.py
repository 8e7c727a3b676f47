"""Files that are opened: what could be mended is asked first, what cannot is a sentence, sessions hold no surprises."""

from __future__ import annotations

import io
import json
import os
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from design_tools import Bench, triangle_document

from torchfair import MeshFileError
from torchfair.design.autosave import Keeper, autosave_path
from torchfair.design.document import Faces
from torchfair.design.effects import Autosave
from torchfair.design.engine.requests import Open
from torchfair.design.session_file import read_session
from torchfair.design.session_writing import session_bytes
from torchfair.design.states import DesignState

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 .1\nv 0 1 0\n"
TURNED = SQUARE + "f 1 2 3\nf 1 2 4\n"  # an edge that is traversed twice in one direction: faces must be turned over
SEAM = SQUARE + "v 0 0 0\nv 1 1 .1\nf 1 2 3\nf 5 6 4\n"
THREE = SQUARE + "v .5 .5 2\nf 1 2 3\nf 1 3 4\nf 3 1 5\n"  # three faces at an edge
BROKEN = SQUARE + "f 1 2 9\n"


def question(bench: Bench) -> Any:
    return bench.messages("question")[-1]


def opened(tmp_path: Path, text: str, name: str = "mesh.obj") -> Bench:
    path = tmp_path / name
    path.write_text(text)
    return Bench(tmp_path, Open(0, str(path), None, name))


@pytest.mark.parametrize(
    ("text", "words", "choices"),
    [
        (TURNED, "", ["repair", "cancel"]),
        (SEAM, "lie on each other", ["weld", "as_it_is", "cancel"]),
        (THREE, "three|more than two", ["split_edges", "cancel"]),
    ],
    ids=["turned", "seam", "three"],
)
def test_repairs_are_asked_never_done_silently(tmp_path: Path, text: str, words: str, choices: list[str]) -> None:
    bench = opened(tmp_path, text)
    assert bench.session.state is DesignState.OPENING
    asked = question(bench)
    assert [choice["value"] for choice in asked["choices"]] == choices
    assert any(word in asked["sentence"] for word in words.split("|"))
    assert "=True" not in asked["sentence"]
    assert "--" not in asked["sentence"]
    bench.say(type="answer", question=asked["question"], choice="nothing of these")
    assert bench.session.state is DesignState.OPENING
    bench.say(type="answer", question=asked["question"], choice=choices[0])
    assert bench.session.state is DesignState.READY
    assert bench.messages("notice")
    assert bench.session.history.now.history[0]["repair"]


def test_a_mesh_may_be_opened_as_it_is_or_not_at_all(tmp_path: Path) -> None:
    bench = opened(tmp_path, SEAM)
    number = question(bench)["question"]
    bench.say(type="answer", question=number, choice="as_it_is")
    assert bench.session.history.now.count == 6
    (tmp_path / "other.obj").write_text(TURNED)
    bench.say(type="open", source="other.obj")
    bench.say(type="answer", question=number, choice="cancel")
    assert bench.session.state is DesignState.OPENING
    bench.say(type="answer", question=question(bench)["question"], choice="cancel")
    assert bench.session.state is DesignState.READY
    assert bench.session.history.now.count == 6


def test_what_cannot_be_read_is_said_and_what_was_open_stays(bench: Bench) -> None:
    now = bench.session.history.now
    bench.say(type="upload", name="broken.obj", bytes=BROKEN.encode())
    assert bench.errors[-1].startswith("broken.obj")
    assert "9" in bench.errors[-1]
    for name in ("a.exe", "noextension", "x.torchfair", "x.glb"):
        bench.say(type="upload", name=name, bytes=b"\x00\x01 nothing")
        assert name in bench.errors[-1] or "torchfair" in bench.errors[-1] or "glb" in bench.errors[-1]
    bench.say(type="open", source="example:nowhere")
    assert "no example" in bench.errors[-1]
    assert len(bench.errors) == 6
    assert bench.session.history.now is now
    assert bench.session.state is DesignState.READY


def test_an_upload_becomes_the_mesh_and_begins_a_new_history(bench: Bench) -> None:
    bench.say(type="hold", vertices=[1])
    bench.say(type="upload", name="C:\\meshes\\square.obj", bytes=(SQUARE + "f 1 2 3 4\n").encode())
    assert bench.session.title == "square"
    assert bench.session.history.position == 0
    assert bench.session.history.now.names.tolist() == [1, 2, 3, 4]
    message, arrays = bench.messages("topology")[-1]
    assert message["has_names"]
    assert arrays["vertex_names"].tolist() == [1, 2, 3, 4]


def test_edits_that_were_not_saved_are_offered_again(bench: Bench, tube: Path) -> None:
    bench.say(type="hold", vertices=[1])
    content = next(effect for effect in bench.stored[::-1] if isinstance(effect, Autosave)).content
    assert content is not None
    keeper = Keeper(tube.parent, pause=3600.0)
    keeper.keep("tube", content)
    keeper.finish()
    os.utime(tube, (0, 0))
    assert [file["name"] for file in bench.session._core.folder.listing()] == ["tube.obj"]
    for choice, held, saved in (("kept", (1,), False), ("file", (), False)):
        again = Bench(tube.parent, Open(0, str(tube), None, tube.name))
        asked = question(again)
        assert [option["value"] for option in asked["choices"]] == ["kept", "file", "cancel"]
        again.say(type="answer", question=asked["question"], choice=choice)
        assert again.session.history.now.held == held
        assert again.messages("state")[-1]["saved"] == saved
        assert again.session.title == "tube"
    keeper.keep("tube", None)
    assert not autosave_path(tube.parent, "tube").exists()
    assert Bench(tube.parent, Open(0, str(tube), None, tube.name)).session.state is DesignState.READY


# ---- session files ---------------------------------------------------------------------------------------------------


def changed(data: bytes, **parts: Any) -> bytes:
    """A session file with other entries of its first mesh, or of itself."""
    source, target = zipfile.ZipFile(io.BytesIO(data)), io.BytesIO()
    with zipfile.ZipFile(target, "w") as file:
        for name in source.namelist():
            content = source.read(name)
            if name == "design.json":
                head = json.loads(content)
                for key, value in parts.items():
                    (head if key in head else head["documents"][0])[key] = value
                content = json.dumps(head).encode()
            file.writestr(name, content)
    return target.getvalue()


def test_what_was_stored_is_read_back(tmp_path: Path) -> None:
    document = triangle_document()
    path = tmp_path / "two.torchfair"
    path.write_bytes(session_bytes([document, document], 0))
    stored = read_session(path)
    assert stored.documents[0] is stored.documents[1]
    assert np.array_equal(stored.documents[0].vertices, document.vertices)
    assert stored.documents[0].faces.same(document.faces)
    assert stored.documents[0].history == ({"do": "open", "source": "two"},)


@pytest.mark.parametrize(
    "parts",
    [{"torchfair": 99}, {"now": 5}, {"now": -1}, {"now": True}, {"history": [7]}, {"history": []}, {"documents": []},
     {"coarse": 0}, {"mode": "strange"}, {"handles": [[9, 0, 0, 0]]}, {"handles": [[0, 0, 0]]}, {"held": [-1]},
     {"handles": [[0, 1e999, 0, 0]]}, {"start": "array99"}, {"corners": None}, {"vertices": "array0"},
     {"principal": "array0"}, {"names": "array0"}, {"camera": {"fov": 1}}, {"weights": {"fair": {"fairness": "x"}}},
     {"steps": 3}, {"corners": "array2"}, {"offsets": "array0"}],
    ids=str,
)  # fmt: skip
def test_session_files_that_are_wrong_are_refused(tmp_path: Path, parts: dict[str, Any]) -> None:
    path = tmp_path / "two.torchfair"
    path.write_bytes(changed(session_bytes([triangle_document()], 0), **parts))
    with pytest.raises(MeshFileError, match="is no session file"):
        read_session(path)


FIRST: dict[str, Any] = {"do": "open", "source": "two"}
JOB: dict[str, Any] = {"do": "fair", "handles": [[0, 0.0, 0, 1]], "held": [1], "weights": {"energy": 2.0},
                       "choices": {"boundary": "fixed"}, "levels": 0}  # fmt: skip


@pytest.mark.parametrize(
    "parts",
    [{"steps": [FIRST | {"repair": words}]} for words in
       (["output=/etc/x"], ["force"], ["repair\n"], [3], 3, ["weld=x"])]
    + [{"steps": steps} for steps in ([], [JOB], [FIRST | {"do": "fair"}], [FIRST | {"source": 3}], [FIRST, FIRST])]
    + [{"steps": [FIRST, JOB | part]} for part in (
        {"do": "reflect"}, {"do": "--force"}, {"handles": [["--force", 0, 0, 0]]}, {"handles": [[0, 0, 0]]},
        {"held": ["--force"]}, {"weights": {"output": 1.0}}, {"weights": {"energy": "x"}}, {"levels": "1"},
        {"choices": {"boundary": "--force"}}, {"choices": {"output": "x"}})]
    + [{"steps": [FIRST, {"do": "mesh", "kind": kind, "count": count}]} for kind, count in
       (("force", 9), ("quads", "--force"), ("quads", True))]
    + [{"weights": {"form": {"output": 1.0}}}, {"choices": {"fair": {"boundary": "--force"}}},
       {"weights": {"force": {}}}],
    ids=str,
)  # fmt: skip
def test_histories_that_no_design_leads_to_are_refused(tmp_path: Path, parts: dict[str, Any]) -> None:
    """Command lines are made of them, which people copy: no option may come from the file."""
    path = tmp_path / "two.torchfair"
    path.write_bytes(changed(session_bytes([triangle_document()], 0), **parts))
    bench = Bench(tmp_path, Open(0, str(path), None, path.name))
    assert any("is no session file" in str(error) for error in bench.errors)
    assert bench.session.state is DesignState.EMPTY


def test_histories_of_designs_are_read(tmp_path: Path) -> None:
    steps = [FIRST | {"repair": ["weld=0.01", "surfaces=3,5", "split_edges"], "source": "-o.obj"},
             {"do": "mesh", "kind": "quads", "count": 9}, JOB]  # fmt: skip
    path = tmp_path / "two.torchfair"
    path.write_bytes(changed(session_bytes([triangle_document()], 0), steps=steps))
    bench = Bench(tmp_path, Open(0, str(path), None, path.name))
    bench.say(type="command_line", id=1)
    first = bench.messages("command_line")[-1]["text"].splitlines()[0]
    assert first.startswith("torchfair mesh ./-o.obj ")
    assert "--weld=0.01 --surfaces=3,5 --split-edges -o step1.obj" in first


def test_session_files_hold_no_code_and_no_faces_of_nowhere(tmp_path: Path) -> None:
    path = tmp_path / "two.torchfair"
    document = triangle_document()
    for faces in (Faces(np.array([0, 1, 9]), np.array([0, 3])), Faces(np.array([0, 1]), np.array([0, 2])),
                  Faces(np.array([0, 1, -1]), np.array([0, 3]))):  # fmt: skip
        path.write_bytes(session_bytes([type(document)("x", "fair", faces, document.start, document.start)], 0))
        with pytest.raises(MeshFileError, match="no faces of its vertices"):
            read_session(path)
    buffer = io.BytesIO()
    np.save(buffer, np.array([print], dtype=object), allow_pickle=True)
    data = session_bytes([document], 0)
    with zipfile.ZipFile(io.BytesIO(data)) as source, zipfile.ZipFile(path, "w") as target:
        for name in source.namelist():
            target.writestr(name, buffer.getvalue() if name == "array0.npy" else source.read(name))
    with pytest.raises(MeshFileError, match="no session file"):
        read_session(path)


def test_bytes_that_are_no_session_are_refused(tmp_path: Path) -> None:
    data = bytearray(session_bytes([triangle_document()], 0))
    source, path = np.random.default_rng(0), tmp_path / "x.torchfair"
    for _ in range(300):
        copy = bytearray(data)
        for place in source.integers(0, len(data), 4):
            copy[place] = source.integers(256)
        path.write_bytes(bytes(copy[: source.integers(1, len(data) + 1)]))
        try:
            found = read_session(path)
        except MeshFileError:
            continue
        assert np.isfinite(found.documents[found.now].vertices).all()
