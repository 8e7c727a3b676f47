"""What a star is does not depend on place, size, numbering, orientation or handedness."""

from __future__ import annotations

import numpy as np
import torch
from helpers import random_rotation
from hypothesis import given, settings
from hypothesis import strategies as st
from star_tools import Star, random_arms, stars_of

from torchfair import Topology
from torchfair.stars import StarClasses, classify_stars

COUNT = 12
seeds = st.integers(0, 10**6)
valences = st.integers(3, 8)


def random_stars(valence: int, seed: int) -> Star:
    return stars_of(random_arms(COUNT, valence, seed, height=0.4, saddle=0.3))


def centres(valence: int) -> torch.Tensor:
    return torch.arange(COUNT) * (valence + 1)


def summary(classes: StarClasses, vertices: torch.Tensor) -> list[object]:
    """Everything that must not change, star by star."""
    counts = classes.inflection_counts
    return [
        (
            int(classes.kinds[v]),
            bool(classes.good[v]),
            classes.pattern(v),
            classes.pattern(v, ordinary=True),
            int(counts[v]),
            int(classes.defect_signs[v]),
        )
        for v in vertices.tolist()
    ]


@settings(max_examples=15, deadline=None)
@given(valences, seeds, st.floats(1e-3, 1e3), st.booleans())
def test_similarities_and_reflections(valence: int, seed: int, scale: float, mirrored: bool) -> None:
    vertices, topology = random_stars(valence, seed)
    rotation = random_rotation(seed)
    moved = scale * (vertices @ rotation.T + torch.tensor([0.3, -0.2, 0.5], dtype=vertices.dtype))
    before = classify_stars(vertices, topology)
    if mirrored:  # the same shape in a mirror: faces turned round to keep their outside
        moved = moved * torch.tensor([1.0, 1, -1], dtype=moved.dtype)
        topology = Topology.from_faces([face[::-1] for face in topology.face_lists()])
    after = classify_stars(moved, topology)
    assert summary(before, centres(valence)) == summary(after, centres(valence))


@settings(max_examples=8, deadline=None)
@given(valences, seeds)
def test_orientation(valence: int, seed: int) -> None:
    vertices, topology = random_stars(valence, seed)
    turned = Topology.from_faces([face[::-1] for face in topology.face_lists()])
    after = classify_stars(vertices, turned)
    assert summary(classify_stars(vertices, topology), centres(valence)) == summary(after, centres(valence))


@settings(max_examples=8, deadline=None)
@given(valences, seeds)
def test_relabelling(valence: int, seed: int) -> None:
    vertices, topology = random_stars(valence, seed)
    random = np.random.default_rng(seed)
    order = random.permutation(len(vertices))  # new number n is old vertex order[n]
    number = np.empty_like(order)
    number[order] = np.arange(len(order))
    faces = number[topology.corners.numpy().reshape(-1, 3)]
    faces = np.stack([np.roll(face, int(random.integers(3))) for face in random.permutation(faces)])
    relabelled = classify_stars(vertices[torch.from_numpy(order)], Topology.from_faces(faces))
    new = torch.from_numpy(number)[centres(valence)]
    assert summary(classify_stars(vertices, topology), centres(valence)) == summary(relabelled, new)
