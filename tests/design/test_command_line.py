"""The commands that repeat a design are accepted by the program, and lead to what was on the screen."""

from __future__ import annotations

import shlex
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from design_tools import Bench

from torchfair import Topology, load_mesh, save_mesh
from torchfair.cli import fair, form, main, symmetric
from torchfair.cli.command import build_parser
from torchfair.cli.options import SettingOptions
from torchfair.design.command_line import command_line
from torchfair.design.engine.requests import Open
from torchfair.design.engine.sliders import CHOICES, SETTINGS, SLIDERS, settings_of, weight_range
from torchfair.energies import normal_variation


def told(bench: Bench) -> Any:
    return next(m for m in bench.say(type="command_line") if m["type"] == "command_line")


def pull(bench: Bench, vertex: int, outwards: float = 0.05) -> None:
    place = bench.vertices[vertex] * [1.0 + outwards, 1.0 + outwards, 1.0]
    bench.say(type="move", places=[[vertex, *map(float, place)]], release=True)
    assert not bench.errors


@pytest.mark.slow
def test_one_command_repeats_a_drag(bench: Bench, tube: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert told(bench)["text"] == "torchfair measure tube.obj"
    bench.say(type="hold", vertices=[40])
    pull(bench, 30)
    bench.say(type="weigh", weights={"fairness": 0.5}, release=True)
    message = told(bench)
    assert message["exact"]
    monkeypatch.chdir(tube.parent)
    assert main(shlex.split(message["text"])[1:]) in (0, 1)
    result = load_mesh(tube.parent / "result.obj").vertices.numpy()
    edge = bench.messages("numbers")[-1]["mean_edge"]
    assert np.linalg.norm(result[30] - bench.vertices[30]) < 0.05 * edge
    assert np.array_equal(result[40], bench.vertices[40])
    faces = bench.session.history.now.faces
    topology = Topology.from_packed_faces(faces.corners, faces.offsets, len(result))
    energies = [float(normal_variation(torch.from_numpy(x.copy()), topology)) for x in (result, bench.vertices)]
    assert energies[0] <= 1.01 * energies[1]  # the whole job, where a drag has only settled


def test_what_was_meshed_is_meshed_first(bench: Bench) -> None:
    pull(bench, 30)
    bench.say(type="mesh", kind="triangles", count=120)
    bench.say(type="mode", mode="symmetric")
    pull(bench, 20, 0.02)
    bench.say(type="subdivide")
    message = told(bench)
    commands = [shlex.split(line) for line in message["text"].splitlines()]
    assert [words[1:3] for words in commands] == [
        ["fair", "tube.obj"], ["mesh", "step1.obj"], ["symmetric", "step2.obj"]
    ]  # fmt: skip
    assert commands[0][3:5] == ["--handle", "31"]  # an OBJ file counts from 1
    assert commands[2][3:5] == ["--handle", "21"]
    assert commands[2][-4:] == ["--levels", "1", "-o", "result.obj"]
    assert not message["exact"]
    for words in commands:
        arguments, unknown = build_parser().parse_known_args(words[1:])
        assert not unknown
        assert arguments.input in (words[2], [words[2]])


@pytest.mark.parametrize("mode", list(SETTINGS))
def test_options_of_weights_and_choices_are_those_of_the_program(bench: Bench, mode: str) -> None:
    """Every slider and every choice, away from its default, comes back from the command as the same settings."""
    weights = {slider.name: 0.5 * sum(weight_range(mode, slider.name)[1:]) for slider in SLIDERS[mode]}
    choices = {choice.name: choice.values[-1][0] for choice in CHOICES[mode]}
    document = bench.session.history.now.in_mode(mode).weighing(weights).choosing(choices)
    document = replace(document, vertices=document.vertices + 1e-3)
    words = shlex.split(command_line(document)[0].splitlines()[-1])
    arguments = build_parser().parse_args(words[1:])
    command = {"fair": fair.COMMAND, "form": form.COMMAND, "symmetric": symmetric.COMMAND}[mode]
    options: SettingOptions[Any] = command.options()
    assert options.settings(arguments) == settings_of(document)


def test_vertices_of_files_that_count_from_0_are_called_so(tmp_path: Path, tube: Path) -> None:
    mesh = load_mesh(tube)
    save_mesh(tmp_path / "tube.ply", mesh.vertices, mesh.topology)
    bench = Bench(tmp_path, Open(0, str(tmp_path / "tube.ply"), None, "tube.ply"))
    pull(bench, 30)
    assert shlex.split(told(bench)["text"])[3:5] == ["--handle", "30"]


def test_fixed_vertices_are_fixed_in_every_mode(bench: Bench) -> None:
    document = bench.session.history.now.holding((30,))
    for mode in ("fair", "form", "symmetric"):
        moved = replace(document, mode=mode, vertices=document.vertices + 1e-3)
        words = shlex.split(command_line(moved)[0].splitlines()[-1])
        assert words[words.index("--fix") + 1] == "31"
        arguments, unknown = build_parser().parse_known_args(words[1:])
        assert not unknown
        assert arguments.fix
