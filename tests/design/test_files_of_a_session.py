"""Files of a design: meshes, the session, and what is kept safe after every edit."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from design_steps import drag, last
from design_tools import Bench

from torchfair import load_mesh
from torchfair.design.effects import Autosave, Deliver


def test_meshes_are_saved_as_they_are(bench: Bench, tmp_path: Path) -> None:
    drag(bench)
    bench.say(type="save", format="obj", to="download", name="shape", id=7)
    delivered = next(e for e in bench.stored if isinstance(e, Deliver))
    assert delivered.name == "shape.obj"
    path = tmp_path / "again.obj"
    path.write_bytes(delivered.content())
    assert np.array_equal(load_mesh(path).vertices.numpy(), bench.vertices)


def test_a_session_file_brings_everything_back(bench: Bench, tmp_path: Path) -> None:
    bench.say(type="hold", vertices=[3])
    drag(bench)
    bench.say(type="subdivide")
    bench.say(type="hold", vertices=[5])
    bench.say(type="undo")
    camera = {
        "position": [0.0, 0.0, 5.0], "target": [0.0, 0.0, 0.0], "up": [0.0, 1.0, 0.0], "fov": 40.0,
        "orthographic": False,
    }  # fmt: skip
    bench.say(type="camera", camera=camera)
    assert not last(bench, "state")["saved"]
    bench.say(type="save", format="session", to="download", id=7)
    assert last(bench, "state")["saved"]
    data = next(e for e in bench.stored if isinstance(e, Deliver)).content()
    again = Bench(tmp_path)
    again.say(type="upload", name="tube.torchfair", bytes=data)
    assert again.errors == []
    old, new = bench.session.history, again.session.history
    assert (len(new.states), new.position) == (len(old.states), old.position)
    for one, other in zip(old.states, new.states, strict=True):
        assert np.array_equal(one.vertices, other.vertices)
        assert (one.handles, one.held, one.weights, one.words) == (
            other.handles,
            other.held,
            other.weights,
            other.words,
        )
    assert json.dumps(last(again, "camera")["camera"]) == json.dumps(camera)
    assert last(again, "state")["saved"]
    again.say(type="redo")
    assert np.array_equal(again.frames[-1].vertices, old.states[-1].vertices)
    assert again.session.history.now.held[:2] == (3, 5)


def test_every_edit_is_kept_safe_until_it_is_saved(bench: Bench) -> None:
    assert not [e for e in bench.stored if isinstance(e, Autosave)]
    drag(bench)
    assert bench.stored[-1].content is not None  # type: ignore[union-attr]
    bench.say(type="save", format="session", to="download")
    assert bench.stored[-1] == Autosave(None)
