"""Pictures and ranking agree with an independent physically based renderer, Mitsuba 3 (skipped where it is missing)."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch

from torchfair import Topology
from torchfair.reflection import OrthographicCamera, SmoothReference, Stripes, render_reflection
from torchfair.reflection._comparison import comparison_window, dissimilarity
from torchfair.shapes import (
    PrincipalParaboloid,
    irregular_triangles,
    parameter_triangles,
    principal_triangles,
    rotated_lattice,
)

mi = pytest.importorskip("mitsuba")

SADDLE = PrincipalParaboloid(0.44, -0.28)  # so shallow that it does not mirror itself
ROWS, SIZE, FREQUENCY, HALF_WIDTH = 32, 200, 2.5, 1.25
WAVES = torch.tensor([[1.0, 0.2, 0], [0.3, 1, 0]], dtype=torch.float64)
VIEW = torch.tensor([0.25, -0.15, -1.0], dtype=torch.float64)
LAYOUTS = {
    "principal-symmetric": lambda: principal_triangles(SADDLE, ROWS, ROWS, along="v"),
    "turned 15 degrees": lambda: rotated_lattice(SADDLE, ROWS, ROWS, math.radians(15)),
    "irregular": lambda: irregular_triangles(SADDLE, (ROWS + 1) ** 2),
    "split squares": lambda: rotated_lattice(SADDLE, ROWS, ROWS, math.pi / 4, kind="split"),
}


def panorama(stripes: Stripes) -> np.ndarray:
    """The surroundings as Mitsuba looks them up."""
    height, width = 1024, 2048
    theta = (np.arange(height)[:, None] + 0.5) * np.pi / height
    phi = (np.arange(width) + 0.5) * 2 * np.pi / width
    directions = np.stack([np.sin(phi) * np.sin(theta), np.cos(theta) + 0 * phi, -np.cos(phi) * np.sin(theta)], -1)
    values = stripes(torch.from_numpy(directions))
    return values.expand(-1, -1, 3).to(torch.float32).contiguous().numpy()


def mitsuba_mesh(vertices: torch.Tensor, topology: Topology, normals: torch.Tensor | None) -> object:
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict({"type": "twosided", "mirror": {"type": "conductor", "material": "none"}})
    properties["face_normals"] = normals is None
    mesh = mi.Mesh("mesh", len(vertices), topology.num_faces, has_vertex_normals=normals is not None, props=properties)
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = vertices.to(torch.float32).ravel().numpy()
    parameters["faces"] = topology.triangles.to(torch.int32).ravel().numpy()
    if normals is not None:
        parameters["vertex_normals"] = normals.to(torch.float32).ravel().numpy()
    parameters.update()
    return mesh


def mitsuba_picture(mesh: object, camera: OrthographicCamera, surroundings: np.ndarray) -> torch.Tensor:
    direction, up = camera.directions[0].tolist(), camera.axes[0, 1].tolist()
    origin = [-4 * x for x in direction]
    view = mi.ScalarTransform4f().look_at(origin=origin, target=[0, 0, 0], up=up)
    sensor = {
        "type": "orthographic",
        "to_world": view @ mi.ScalarTransform4f().scale([HALF_WIDTH, HALF_WIDTH, 1]),
        "sampler": {"type": "stratified", "sample_count": 36},
        "film": {"type": "hdrfilm", "width": SIZE, "height": SIZE, "rfilter": {"type": "box"}, "pixel_format": "rgb",
                 "component_format": "float32"},
    }  # fmt: skip
    scene = mi.load_dict({
        "type": "scene", "integrator": {"type": "path", "max_depth": 2}, "sensor": sensor, "mesh": mesh,
        "light": {"type": "envmap", "bitmap": mi.Bitmap(surroundings)},
    })  # fmt: skip
    return torch.from_numpy(np.array(mi.render(scene))[..., 0].astype(np.float64))


@pytest.fixture(scope="module")
def pictures() -> dict[str, list[tuple[torch.Tensor, torch.Tensor, torch.Tensor]]]:
    """For every mesh and stripe direction: their picture, ours, and our coverage."""
    mi.set_variant("scalar_rgb")
    camera = OrthographicCamera(VIEW, half_widths=HALF_WIDTH)
    fine = parameter_triangles(SADDLE, 200, 200)
    meshes = {name: (mesh.vertices, mesh.topology, None) for name, mesh in ((n, make()) for n, make in LAYOUTS.items())}
    smooth = SmoothReference(fine.vertices, fine.topology, fine.normals)
    meshes["reference"] = (smooth.vertices, smooth.topology, smooth.normals)
    found: dict[str, list[tuple[torch.Tensor, torch.Tensor, torch.Tensor]]] = {}
    around = [Stripes(wave, FREQUENCY) for wave in WAVES]
    panoramas = [panorama(stripes) for stripes in around]
    for name, (vertices, topology, normals) in meshes.items():
        theirs = mitsuba_mesh(vertices, topology, normals)
        for stripes, surroundings in zip(around, panoramas, strict=True):
            ours = render_reflection(vertices, topology, camera, stripes, size=SIZE, supersampling=6,
                                     shading="flat" if normals is None else "smooth", normals=normals)  # fmt: skip
            row = (mitsuba_picture(theirs, camera, surroundings), ours.image[0, 0], ours.coverage[0])
            found.setdefault(name, []).append(row)
    return found


def test_pixels_agree(pictures):
    for rows in pictures.values():
        for theirs, ours, coverage in rows:
            inside = coverage > 0.999
            assert inside.double().mean() > 0.3
            assert (theirs - ours)[inside].abs().mean() < 0.005


def test_ranking_agrees(pictures):
    scores: list[dict[str, float]] = [{}, {}]
    for name in LAYOUTS:
        for number in (0, 1):  # theirs, ours
            values = []
            for row, reference in zip(pictures[name], pictures["reference"], strict=True):
                window = comparison_window(row[2], reference[2])
                values.append(dissimilarity(row[number][None], reference[number][None], window))
            scores[number][name] = float(torch.stack(values).mean())
    theirs, ours = scores
    assert sorted(theirs, key=theirs.__getitem__) == sorted(ours, key=ours.__getitem__)
    for name in LAYOUTS:
        assert ours[name] == pytest.approx(theirs[name], abs=3e-3)
