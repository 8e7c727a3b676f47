"""What a type checker tells somebody who uses torchfair: mypy reads this in .ci/run, a test runs it.

``assert_type`` says what is known of results; an ignored error that is none fails the check, too.
"""

from __future__ import annotations

from typing import assert_type

import torch
from torch import Tensor

import torchfair
from torchfair import PolygonMesh, Topology, load_mesh
from torchfair.constraints import Planarity
from torchfair.energies import NormalVariation, WillmoreEnergy
from torchfair.formfinding import FairSettings, JobResult, minimise_normal_variation
from torchfair.projection import guided_projection
from torchfair.reflection import Stripes
from torchfair.shapes import PrincipalParaboloid, ShapeMesh, principal_quads


def energies(vertices: Tensor, topology: Topology) -> Tensor:
    smoothness = NormalVariation(topology, reduction="mean")
    assert_type(smoothness, NormalVariation)
    assert_type(smoothness(vertices), Tensor)
    assert_type(smoothness.per_edge(vertices), Tensor)
    assert_type(Stripes(torch.tensor([[0.0, 0.0, 1.0]]), 8.0)(vertices), Tensor)
    assert_type(torchfair.energies.normal_variation(vertices, topology), Tensor)
    assert_type(torchfair.geometry.face_normals(vertices=vertices, topology=topology), Tensor)
    return smoothness(vertices) + 0.1 * Planarity(topology)(vertices)


def job(mesh: ShapeMesh | PolygonMesh) -> Tensor:
    settings = FairSettings(boundary="glide")
    result = minimise_normal_variation(mesh.vertices, mesh.topology, settings=settings)
    assert isinstance(result, JobResult)
    assert_type(result.vertices, Tensor)
    assert_type(result.holds, bool)
    assert_type(result.before["normal_variation"], float)
    return result.vertices


def mistakes(vertices: Tensor, topology: Topology) -> None:
    FairSettings(boundary="glied")  # type: ignore[arg-type]
    NormalVariation(vertices)  # type: ignore[arg-type]
    NormalVariation(topology, reduction="all")  # type: ignore[arg-type]
    NormalVariation(topology)(topology)  # type: ignore[arg-type]
    WillmoreEnergy(topology, density="median")  # type: ignore[arg-type]
    load_mesh("roof.obj", weld="yes")  # type: ignore[arg-type]
    torchfair.geometry.face_normals(vertices, mesh=topology)  # type: ignore[call-arg]


def main() -> None:
    mesh = principal_quads(PrincipalParaboloid(1.0, -1.0), 6, 6)
    energies(mesh.vertices.requires_grad_(), mesh.topology).sum().backward()  # type: ignore[no-untyped-call]
    moved = job(mesh)
    terms = Planarity(mesh.topology).terms(weight=10.0)
    assert_type(guided_projection({"vertices": moved}, terms).blocks["vertices"], Tensor)
    assert torch.isfinite(moved).all()


if __name__ == "__main__":
    main()
