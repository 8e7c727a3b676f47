"""Messages of hostile pages."""

from __future__ import annotations

import json
import random
from typing import Any

from torchfair.design.commands import COMMANDS

RIGHT: dict[str, dict[str, list[Any]]] = {
    "hello": {"token": ["abc"], "protocol": [1]},
    "ack": {"frame": [0, 7]},
    "open": {"source": ["roof.obj"], "typed": [True, False]},
    "answer": {"question": [1], "choice": ["weld"]},
    "move": {"places": [[[3, 0, 0.5, -1e6]]], "release": [True], "count": [0, 65535]},
    "weigh": {"weights": [{"fairness": 0}], "release": [False]},
    "release": {"back": [True]},
    "hold": {"vertices": [[0, 1]]},
    "free": {"vertices": [[0]]},
    "choose": {"choices": [{"boundary": "free"}]},
    "mode": {"mode": ["fair", "form", "symmetric"]},
    "pause": {"on": [True]},
    "mesh": {"kind": ["quads", "triangles"], "count": [4, 20000]},
    "label": {"edges": [[], [0]], "principal": [True]},
    "watch": {"views": [[], ["stars"], ["deviation", "planarity"]]},
    "worst": {"count": [0, 100]},
    "camera": {"camera": [{"position": [0, 0, 1], "target": [0, 0, 0], "up": [0, 1, 0], "fov": 40.0,
                           "orthographic": True}]},
    "save": {"format": ["obj"], "to": ["download", "folder"], "name": ["a.obj"], "typed": [False],
             "overwrite": [True]},
}  # fmt: skip


def hostile(source: random.Random, depth: int = 0) -> Any:
    """Anything that JSON can hold, and more."""
    kind = source.randrange(12 if depth < 3 else 8)
    if kind == 0:
        return source.choice(
            [None, True, False, "", "\0", "../../etc/passwd", "example:roof", "constructor", "__class__"]
        )
    if kind == 1:
        return source.choice([0, -1, 1, 2**31, 2**63, -(2**64), 10**400])
    if kind == 2:
        return source.choice([0.0, -0.0, 1e-300, 1e308, -1e16, float("nan"), float("inf")])
    if kind == 3:
        return "".join(chr(source.randrange(0x11000)) for _ in range(source.randrange(20)))
    if kind < 8:
        return source.choice([3, 0.5, "fair", "quads", "obj", "stars"])
    if kind < 10:
        return [hostile(source, depth + 1) for _ in range(source.randrange(5))]
    return {str(hostile(source, 9)): hostile(source, depth + 1) for _ in range(source.randrange(4))}


def message(source: random.Random) -> dict[str, Any]:
    """A command with some fields right and some hostile."""
    kind = source.choice(sorted(COMMANDS))
    fields = {name: source.choice(RIGHT[kind][name]) if kind in RIGHT else "x" for name in COMMANDS[kind]}
    for name in list(fields):
        if source.random() < 0.4:
            fields[name] = hostile(source)
    if source.random() < 0.1:
        fields[str(hostile(source, 9))] = hostile(source)
    if source.random() < 0.2:
        fields["id"] = hostile(source)
    return {"type": kind if source.random() < 0.9 else hostile(source), **fields}


def texts(count: int, seed: int = 0) -> list[str]:
    """Messages as a hostile page sends them: commands, half commands, and noise."""
    source = random.Random(seed)
    found = []
    for _ in range(count):
        text = json.dumps(message(source))
        if source.random() < 0.2:
            cut = source.randrange(len(text) + 1)
            text = text[:cut] + chr(source.randrange(0x3000)) + text[cut + source.randrange(3) :]
        found.append(text)
    return found
