from __future__ import annotations

from types import SimpleNamespace

import pytest
import torch
from helpers import cube
from torch import Tensor

from torchfair import Topology
from torchfair.energies import EdgeEnergy, MeshModule


class Lengths(MeshModule):
    needs = ("rings_by_valence",)


class Count(EdgeEnergy):
    def per_edge(self, vertices: Tensor) -> Tensor:
        return vertices.new_ones((*vertices.shape[:-2], self.topology.num_interior_edges))


def test_fills_the_tables_it_needs():
    _, topology = cube()
    assert "rings_by_valence" not in vars(Topology.from_faces(topology.face_lists()))
    assert "rings_by_valence" in vars(Lengths(Topology.from_faces(topology.face_lists())).topology)


def test_fills_them_again_when_it_moves(monkeypatch):
    """The other device is pretended, and so is the topology on it."""
    module = Lengths(cube()[1])
    elsewhere = Topology.from_faces(cube()[1].face_lists())
    asked = []
    monkeypatch.setattr(Topology, "to", lambda self, device: asked.append(device) or elsewhere)
    cuda = torch.device("cuda", 0)
    module._apply(lambda tensor: SimpleNamespace(device=cuda))
    assert asked == [cuda]
    assert module.topology is elsewhere
    assert "rings_by_valence" in vars(elsewhere)


def test_edge_energies_must_define_their_terms():
    with pytest.raises(TypeError, match="per_edge"):
        EdgeEnergy(cube()[1])
    vertices, topology = cube()
    assert Count(topology)(vertices.expand(4, 8, 3)).tolist() == [12.0] * 4


def test_topology_is_no_part_of_the_state():
    module = Count(cube()[1])
    assert module.state_dict() == {}
    assert list(module.buffers()) == []
