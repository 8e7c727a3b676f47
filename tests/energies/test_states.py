"""What modules keep: parameters, reductions, states that belong to one mesh, pickles that are safe to load."""

from __future__ import annotations

import copy
import io
import pickle
from collections.abc import Callable

import pytest
import torch
from helpers import DOUBLE, wavy_grid
from torch import nn

from torchfair import Topology, TorchfairError, energies, reflection, stars

VERTICES, TOPOLOGY = wavy_grid(5, 5, triangles=True)
FLIPPED = Topology.from_faces([face[1:] + face[:1] for face in reversed(TOPOLOGY.face_lists())])
WEIGHTS = torch.linspace(0, 1, TOPOLOGY.num_interior_edges, dtype=DOUBLE)


def score(topology: Topology, **options: object) -> energies.MeshModule:
    return reflection.ReflectionLoss(topology, wavy_grid(5, 5), size=24, **options)


MAKERS: list[Callable[..., energies.MeshModule]] = [
    energies.NormalVariation,
    energies.AngleVariation,
    energies.TotalMeanCurvature,
    energies.TotalAbsoluteCurvature,
    lambda t, **options: energies.TotalFrobeniusCurvature(t, boundary="extrapolated", **options),
    energies.WillmoreEnergy,
    energies.UmbrellaFairness,
    energies.PolylineFairness,
    stars.PyramidPenalty,
    stars.SaddlePenalty,
    reflection.ReflectionVariation,
    score,
]
every = pytest.mark.parametrize("make", MAKERS)


@every
def test_reductions(make):
    batch = torch.stack([VERTICES, 1.1 * VERTICES.roll(1, 1), VERTICES.square()]).view(3, 1, -1, 3)
    values = make(TOPOLOGY)(batch)
    assert values.shape == (3, 1)
    for reduction in ("none", "mean", "sum"):
        module = make(TOPOLOGY, reduction=reduction)
        expected = values if reduction == "none" else getattr(values, reduction)()
        torch.testing.assert_close(module(batch), expected)
        assert ("reduction" in repr(module)) == (reduction != "none")
    with pytest.raises(TorchfairError, match='"none", "mean" or "sum", got \'max\''):
        make(TOPOLOGY, reduction="max")


@every
def test_safe_to_load(make):
    """Whole modules, used before, with ``weights_only=True``; they compile without breaks as new ones do."""
    module = make(TOPOLOGY)
    value = module(VERTICES)
    buffer = io.BytesIO()
    torch.save(module, buffer)
    buffer.seek(0)
    loaded = torch.load(buffer, weights_only=True)
    assert type(loaded) is type(module)
    assert all(name in vars(loaded.topology) for name in loaded.needs)
    torch.testing.assert_close(loaded(VERTICES), value)


def test_weights_that_are_parameters_are_trained():
    weights = nn.Parameter(WEIGHTS.clone())
    module = energies.NormalVariation(TOPOLOGY, weights)
    assert [*module.parameters()] == [weights]
    assert list(module.state_dict()) == ["edge_weights"]
    module(VERTICES).backward()
    torch.testing.assert_close(weights.grad, energies.normal_variation_per_edge(VERTICES, TOPOLOGY))
    assert [*energies.NormalVariation(TOPOLOGY, WEIGHTS).parameters()] == []


def test_weights_are_said():
    assert repr(energies.AngleVariation(TOPOLOGY, WEIGHTS)).endswith("faces), edge_weights (40,))")
    assert "trained edge_weights (40,)" in repr(energies.AngleVariation(TOPOLOGY, nn.Parameter(WEIGHTS)))
    shares = torch.ones(6, 40, dtype=DOUBLE)
    assert "visibility (6, 40)" in repr(reflection.ReflectionVariation(TOPOLOGY, visibility=shares))


@pytest.mark.parametrize(
    "make",
    [
        lambda t: energies.NormalVariation(t, WEIGHTS),
        lambda t: reflection.ReflectionVariation(t, visibility=torch.ones(6, 40)),
        score,
    ],
)
def test_states_of_another_mesh_are_refused(make):
    """As many edges, in another order: weights would go to the wrong ones. Inside of other modules and files, too."""
    assert FLIPPED.num_interior_edges == TOPOLOGY.num_interior_edges
    buffer = io.BytesIO()
    torch.save(nn.Sequential(make(TOPOLOGY)).state_dict(), buffer)
    buffer.seek(0)
    state = torch.load(buffer, weights_only=True)
    nn.Sequential(make(Topology.from_faces(TOPOLOGY.face_lists()))).load_state_dict(state)
    with pytest.raises(RuntimeError, match="0: the state was saved for a mesh of other faces"):
        nn.Sequential(make(FLIPPED)).load_state_dict(state)


def test_states_without_anything_of_a_mesh_go_anywhere():
    """A network with an energy inside is trained on one mesh and refined on another."""
    state = nn.Sequential(energies.NormalVariation(TOPOLOGY), nn.Linear(1, 1)).state_dict()
    nn.Sequential(energies.NormalVariation(FLIPPED), nn.Linear(1, 1)).load_state_dict(state)


def test_topologies_copy_without_their_tables():
    before = copy.deepcopy(vars(TOPOLOGY))
    TOPOLOGY.edge_flaps  # noqa: B018
    energies.normal_variation(VERTICES, TOPOLOGY)
    for other in (copy.deepcopy(TOPOLOGY), pickle.loads(pickle.dumps(TOPOLOGY))):
        assert not vars(other).keys() & {"edge_flaps", "_normal_variation_tables", "fingerprint"}
        assert other.fingerprint == TOPOLOGY.fingerprint != FLIPPED.fingerprint
        assert vars(other).keys() - {"fingerprint"} <= before.keys()


def test_pickles_of_scores_hold_no_pictures():
    vertices, topology = wavy_grid(17, 17)
    loss = reflection.ReflectionLoss(topology, (vertices, topology), size=64)
    moved = vertices + 0.01 * vertices.roll(1, 0)
    size = len(pickle.dumps(loss))
    assert size < 2 * len(pickle.dumps((topology, topology, vertices, vertices)))
    for other in (pickle.loads(pickle.dumps(loss)), copy.deepcopy(loss)):
        torch.testing.assert_close(other(moved), loss(moved), rtol=0, atol=0)
