"""What bad stars need: proposals are tried, and are what they say."""

from __future__ import annotations

import re

import pytest
import torch
from helpers import DOUBLE
from torch import Tensor

from torchfair import Topology
from torchfair._names import Names
from torchfair.geometry import edge_lengths
from torchfair.measuring import diagnose_mesh, layout_advice, pattern_words, remedies, star_remedies, star_remedy
from torchfair.measuring import remedies as remedies_module
from torchfair.shapes import Catenoid, Hyperboloid, Torus, icosphere, principal_triangles, rotated_lattice

Mesh = tuple[Tensor, Topology]


def lattice() -> Mesh:
    mesh = principal_triangles(Catenoid(), 8, 12, along="v")
    return mesh.vertices, mesh.topology


def bad_around(vertices: Tensor, topology: Topology, vertex: int) -> int:
    """Bad stars among a vertex and its neighbours, in the whole mesh."""
    found = diagnose_mesh(vertices, topology)
    names = found.class_names()
    own = topology.edges[(topology.edges == vertex).any(1)].flatten().unique().tolist()
    wrong = [names[v] == "neither" or (names[v] == "saddle" and not bool(found.classes.good[v])) for v in own]
    return sum(w or bool(found.crossings[v] > 0) for w, v in zip(wrong, own, strict=True))


def test_a_slide_that_is_proposed_leaves_as_many_bad_stars_as_it_says() -> None:
    vertices, topology = lattice()
    generator = torch.Generator().manual_seed(1)
    noise = torch.randn(vertices.shape, generator=generator, dtype=DOUBLE)
    noisy = vertices + 0.03 * edge_lengths(vertices, topology).mean() * noise
    seen = 0
    for row in diagnose_mesh(noisy, topology).worst_vertices(8):
        remedy = star_remedy(noisy, topology, row["vertex"])
        if remedy is None or not remedy.words.startswith("slide"):
            continue
        assert bad_around(noisy, topology, row["vertex"]) == remedy.bad_before
        slid = noisy.clone()
        slid[row["vertex"]] = torch.tensor([float(x) for x in remedy.words.split(" to ")[1].split()], dtype=DOUBLE)
        assert bad_around(slid, topology, row["vertex"]) == remedy.bad_after < remedy.bad_before
        seen += 1
    assert seen >= 2


def test_several_vertices_are_told_what_each_is_told_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    vertices, topology = lattice()
    generator = torch.Generator().manual_seed(2)
    noisy = vertices + 0.02 * torch.randn(vertices.shape, generator=generator, dtype=DOUBLE)
    chosen = [row["vertex"] for row in diagnose_mesh(noisy, topology).worst_vertices(9)]
    alone = [star_remedy(noisy, topology, vertex) for vertex in chosen]
    assert len({None if remedy is None else remedy.words for remedy in alone}) > 3
    assert star_remedies(noisy, topology, chosen) == alone
    monkeypatch.setattr(remedies_module, "_TOGETHER", 4)
    assert star_remedies(noisy, topology, chosen) == alone
    assert star_remedies(noisy, topology, []) == []


@pytest.mark.parametrize("first", [0, 1])
def test_a_flipped_edge_is_flipped_back(first: int) -> None:
    vertices, topology = lattice()
    inner = ~topology.is_boundary_vertex
    number = next(
        i
        for i, (f, g) in enumerate(topology.interior_edge_faces.tolist())
        if bool(inner[topology.triangles[[f, g]].flatten()].all())
    )
    (f, g), (v, w) = topology.interior_edge_faces[number].tolist(), topology.edges[number].tolist()
    a, b = ((set(topology.triangles[face].tolist()) - {v, w}).pop() for face in (f, g))
    faces = [face for i, face in enumerate(topology.face_lists()) if i not in (f, g)]
    flipped = Topology.from_faces([*faces, [v, b, a], [b, w, a]])
    remedies = [star_remedy(vertices, flipped, vertex, names=Names(first)) for vertex in (v, w, a, b)]
    words = [remedy.words for remedy in remedies if remedy is not None]
    numbers = [set(map(int, re.findall(r"\d+", text))) for text in words if text.startswith("flip")]
    assert {v + first, w + first, a + first, b + first} in numbers


def test_good_stars_need_nothing() -> None:
    vertices, topology = lattice()
    assert star_remedy(vertices, topology, 50) is None
    assert layout_advice(vertices, topology, diagnose_mesh(vertices, topology)) == []


def test_layouts_are_judged_by_principal_directions() -> None:
    mesh = rotated_lattice(Hyperboloid(), 10, 14, 0.25)
    (first, *_) = layout_advice(mesh.vertices, mesh.topology, diagnose_mesh(mesh.vertices, mesh.topology))
    v, w = map(int, re.findall(r"--seed (\d+) (\d+)", first)[0])
    assert bool((mesh.topology.edges.sort(1).values == torch.tensor(sorted([v, w]))).all(1).any())
    quads = rotated_lattice(Torus(), 12, 24, 0.4, kind="quads")
    advice = layout_advice(quads.vertices, quads.topology, diagnose_mesh(quads.vertices, quads.topology))
    assert all("--seed" not in sentence for sentence in advice)
    sphere = icosphere(2)
    assert layout_advice(sphere.vertices, sphere.topology, diagnose_mesh(sphere.vertices, sphere.topology)) == []


def test_layouts_of_large_meshes_are_judged_by_directions_at_some_vertices(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same family, as far off as by all fits, within a degree."""
    for mesh in (rotated_lattice(Hyperboloid(), 20, 28, 0.25), rotated_lattice(Torus(), 20, 60, 0.1)):
        diagnosis = diagnose_mesh(mesh.vertices, mesh.topology)
        everywhere = layout_advice(mesh.vertices, mesh.topology, diagnosis)
        monkeypatch.setattr(remedies, "_LARGE", 0)
        sampled = layout_advice(mesh.vertices, mesh.topology, diagnosis)
        monkeypatch.undo()
        off, near = (int(re.findall(r"is (\d+) degrees off", words[0])[0]) for words in (everywhere, sampled))
        assert abs(off - near) <= 1
        assert re.findall(r"--seed \d+ \d+", sampled[0]) == re.findall(r"--seed \d+ \d+", everywhere[0]) != []


def test_patterns_in_words() -> None:
    assert pattern_words((2, 2, 1, 1)) == "two up, two down, one up, one down"
    assert pattern_words((1, 2, 1, 2), 6) == "one up, two down, one up, two down"
    assert pattern_words((1, 1, 1, 1), 6) == "one up, one down, one up, one down, two in the plane"
    assert pattern_words((6,)) == "all six on one side"
    assert pattern_words((4,), 6) == "four on one side, two in the plane"
    assert pattern_words((13, 1)) == "13 up, one down"
    assert pattern_words(()) == "no plane"
