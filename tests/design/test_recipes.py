"""When a live session can be put where another document stands."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from torchfair.design.document import Document, Faces
from torchfair.design.engine.recipes import same_job

PLACES = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0.1], [0, 1, 0]])
FACES = Faces(np.array([0, 1, 2, 0, 2, 3]), np.array([0, 3, 6]))
LABELS = np.array([True, False, True, False, True])


def document() -> Document:
    return Document("sheet", "symmetric", FACES, PLACES, PLACES, principal=LABELS)


@pytest.mark.parametrize(
    "other",
    [
        document().moved({2: (1.0, 1.0, 0.5)}),
        document().holding((0, 1)),
        document().weighing({"fairness": 0.3}),
        replace(document(), vertices=PLACES + 0.1, title="another", words="pull", names=np.arange(4)),
        replace(document(), faces=Faces(FACES.corners.copy(), FACES.offsets.copy()), start=PLACES.copy()),
        replace(document(), principal=LABELS.copy()),
    ],
)
def test_places_handles_and_weights_belong_to_the_same_job(other: Document) -> None:
    assert same_job(document(), other)
    assert same_job(other, document())


@pytest.mark.parametrize(
    "other",
    [
        replace(document(), mode="fair"),
        replace(document(), principal=~LABELS),
        replace(document(), principal=None),
        replace(document(), start=PLACES + 0.1),
        replace(document(), faces=Faces(np.array([0, 1, 3, 1, 2, 3]), FACES.offsets)),
        document().choosing({"boundary": "free"}),
        replace(document(), coarse=document()),
    ],
)
def test_mode_labels_choices_start_faces_and_levels_make_another_job(other: Document) -> None:
    assert not same_job(document(), other)
    assert not same_job(other, document())


def test_finer_levels_belong_together_where_their_coarse_meshes_stand_alike() -> None:
    coarse = document()
    fine = replace(coarse, coarse=coarse)
    assert same_job(fine, replace(fine, coarse=document()))
    assert same_job(fine, replace(fine, coarse=coarse.weighing({"fairness": 0.3})))
    assert not same_job(fine, replace(fine, coarse=replace(coarse, vertices=PLACES + 0.1)))
    assert not same_job(fine, replace(fine, coarse=replace(coarse, mode="fair")))
