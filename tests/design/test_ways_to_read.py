"""How a file is read: as words of the command line, in questions of the page, in histories; surfaces and drawings."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from design_tools import Bench
from hypothesis import given
from hypothesis import strategies as st

from torchfair import MeshError, load_mesh, save_mesh
from torchfair._reading_words import cells_of, distance_of, options_of, words_of
from torchfair.cli.command import build_parser
from torchfair.design.command_line import command_line
from torchfair.design.effects import Store
from torchfair.design.engine.requests import Open
from torchfair.design.questions import CELLS
from torchfair.design.states import DesignState
from torchfair.io import RhinoParts
from torchfair.shapes import hybrid_roof

FLAGS = st.sampled_from([False, True])
DISTANCES = st.one_of(FLAGS, st.floats(0.0, 1e300))
GRIDS = st.one_of(st.none(), st.integers(1, 999), st.tuples(st.integers(1, 999), st.integers(1, 999)))


@given(st.fixed_dictionaries({"repair": FLAGS, "weld": DISTANCES, "split_edges": FLAGS, "surfaces": GRIDS}))
def test_words_say_what_options_say(options: dict[str, Any]) -> None:
    said = options_of(words_of(options))
    assert said == {name: value for name, value in options.items() if value is not None and value is not False}
    arguments = build_parser().parse_args(["design", "a.obj", *(f"--{w.replace('_', '-')}" for w in words_of(options))])
    assert {name: getattr(arguments, name) for name in options} == options


OTHERS = [
    "mend",
    "repair=1",
    "weld=wide",
    "weld=-1",
    "weld=auto",
    "surfaces",
    "surfaces=0",
    "surfaces=1,2,3",
    "surfaces=x",
    f"surfaces={'9' * 5000}",
]


@pytest.mark.parametrize("word", [*OTHERS, ""])
def test_other_words_are_refused(word: str) -> None:
    with pytest.raises(MeshError, match="no way to read"):
        options_of([word])


@pytest.mark.parametrize("of", [cells_of, distance_of])
def test_long_words_are_refused_by_a_short_sentence_of_ours(of: Callable[[str], Any]) -> None:
    """Python has a sentence of its own for numbers of thousands of digits."""
    with pytest.raises(ValueError, match=r"^expected .* of at least .*, got '9{40}'\.\.\.$"):
        of("9" * 5000)


def surfaces(path: Path, *boxes: bool) -> Path:
    """A sphere, or for each box one of six plane faces."""
    rhino = pytest.importorskip("rhino3dm")
    model = rhino.File3dm()
    if not boxes:
        model.Objects.AddSurface(rhino.Sphere(rhino.Point3d(0, 0, 0), 2.0).ToNurbsSurface())
    for _ in boxes:
        box = rhino.Box(rhino.BoundingBox(rhino.Point3d(0, 0, 0), rhino.Point3d(1, 1, 1)))
        model.Objects.AddBrep(rhino.Brep.CreateFromBox(box))
    model.Write(str(path), 7)
    return path


def opened(path: Path, *words: str) -> Bench:
    return Bench(path.parent, Open(0, str(path), None, path.name, words, bool(words)))


def test_surfaces_are_sampled_as_a_person_chooses(tmp_path: Path) -> None:
    bench = opened(surfaces(tmp_path / "ball.3dm"))
    asked = bench.messages("question")[-1]
    assert asked["sentence"].startswith("ball.3dm: has no visible meshes: 1 NurbsSurface")
    assert "--" not in asked["sentence"]
    assert [choice["value"] for choice in asked["choices"]] == ["surfaces_10", "surfaces_20", "surfaces_40", "cancel"]
    bench.say(type="answer", question=asked["question"], choice="surfaces_20")
    assert bench.session.state is DesignState.READY
    now = bench.session.history.now
    exact = load_mesh(tmp_path / "ball.3dm", surfaces=20)
    assert torch.equal(torch.from_numpy(now.vertices), exact.vertices)
    assert command_line(now)[0] == "torchfair measure ball.3dm --surfaces=20"


def test_faces_of_a_polysurface_are_welded(tmp_path: Path) -> None:
    bench = opened(surfaces(tmp_path / "box.3dm", True))
    asked = bench.messages("question")[-1]
    assert [choice["value"] for choice in asked["choices"]] == [*(f"surfaces_{n}_weld" for n in CELLS), "cancel"]
    bench.say(type="answer", question=asked["question"], choice="surfaces_10_weld")
    assert bench.session.history.now.count == 6 * 100 + 2  # V = F + 2 of quads on a sphere
    assert bench.session.history.now.history[0]["repair"] == ["surfaces=10", "weld"]


def test_the_command_says_how_surfaces_are_read(tmp_path: Path) -> None:
    bench = opened(surfaces(tmp_path / "ball.3dm"), "surfaces=8,4")
    assert not bench.messages("question")
    assert bench.session.history.now.count == 8 * 3 + 2


def test_a_distance_of_welding_is_heeded(tmp_path: Path) -> None:
    """Two squares whose sides are .01 apart."""
    path = tmp_path / "gap.obj"
    places = ["0 0 0", "1 0 0", "1 1 0", "0 1 0", "1.01 0 0", "2 0 1", "2 1 1", "1.01 1 0"]
    path.write_text("".join(f"v {place}\n" for place in places) + "f 1 2 3 4\nf 5 6 7 8\n")
    assert opened(path, "weld=0.02").session.history.now.count == 6
    assert opened(path, "weld=0.001").session.history.now.count == 8


def test_drawings_are_opened_and_saved(tmp_path: Path) -> None:
    path = tmp_path / "roof.dxf"
    vertices, topology = hybrid_roof()
    layer = RhinoParts("Millimeters", (("", "glass"),), np.zeros(topology.num_faces, np.int64))
    save_mesh(path, vertices, topology, attributes=layer)
    bench = opened(path)
    assert {"name": "roof.dxf", "kind": "mesh"}.items() <= bench.session._core.files_message()["files"][0].items()
    start = load_mesh(path)
    bench.say(type="save", format="dxf", to="folder", name="again")
    (tmp_path / "again.dxf").write_bytes(next(e for e in bench.stored if isinstance(e, Store)).content())
    again = load_mesh(tmp_path / "again.dxf")
    assert torch.equal(again.vertices, start.vertices)
    assert again.topology == start.topology
    assert again.attributes.objects == (("", "glass"),)
