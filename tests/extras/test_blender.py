"""The Blender add-on, in Blender as a Python module (``pip install bpy``), without a window."""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from torchfair.energies import normal_variation
from torchfair.geometry import planarity
from torchfair.shapes import builtin_mesh

bpy = pytest.importorskip("bpy")
FILE = Path(__file__).resolve().parents[2] / "extras" / "blender" / "torchfair_addon.py"


@pytest.fixture(scope="module")
def addon() -> Iterator[Any]:
    spec = importlib.util.spec_from_file_location("torchfair_addon", FILE)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.register()
    yield module
    module.unregister()


@pytest.fixture
def roof() -> Any:
    """The only object of the scene: active, twice as large, turned and shifted."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    vertices, topology = builtin_mesh("roof")
    data = bpy.data.meshes.new("roof")
    data.from_pydata(vertices.tolist(), [], topology.face_lists())
    item = bpy.data.objects.new("roof", data)
    bpy.context.collection.objects.link(item)
    item.scale, item.location, item.rotation_euler = (2.0, 2.0, 2.0), (3.0, -1.0, 0.5), (0.3, 0.2, 0.1)
    bpy.context.view_layer.objects.active = item
    item.select_set(True)
    bpy.context.view_layer.update()
    return item


def energy(addon: Any, item: Any) -> float:
    return float(normal_variation(*addon.mesh_of(item)))


def positions(item: Any) -> np.ndarray[Any, Any]:
    return np.array([vertex.co[:] for vertex in item.data.vertices])


def test_polygons_come_in_the_space_of_the_scene(addon: Any, roof: Any) -> None:
    vertices, topology = addon.mesh_of(roof)
    expected, same = builtin_mesh("roof")
    assert topology.face_lists() == same.face_lists()
    turned = np.array(roof.matrix_world)
    placed = expected.numpy() @ turned[:3, :3].T + turned[:3, 3]
    assert np.allclose(vertices.numpy(), placed, atol=1e-5)
    assert energy(addon, roof) == pytest.approx(2.0 * float(normal_variation(expected, same)), rel=1e-4)


def test_measure_keeps_the_verdict(addon: Any, roof: Any) -> None:
    before = positions(roof)
    assert bpy.ops.torchfair.measure() == {"FINISHED"}
    assert "E/C" in roof["torchfair_verdict"]
    assert (positions(roof) == before).all()


def test_fair_lowers_the_energy_and_keeps_what_is_selected(addon: Any, roof: Any) -> None:
    before, places = energy(addon, roof), positions(roof)
    for vertex in roof.data.vertices:
        vertex.select = vertex.index in (100, 200)
    assert bpy.ops.torchfair.fair(keep_selected=True, boundary="fixed") == {"FINISHED"}
    assert energy(addon, roof) < 0.9 * before
    moved = np.linalg.norm(positions(roof) - places, axis=1)
    assert moved[[100, 200]].max() < 1e-5
    assert moved.max() > 1e-2


@pytest.mark.slow
def test_fair_makes_quads_planar_up_to_single_precision(addon: Any, roof: Any) -> None:
    vertices, topology = builtin_mesh("hybrid_roof")
    bent = vertices + 0.05 * torch.sin(7.0 * vertices[:, :1]) * torch.tensor([0.0, 0.0, 1.0])
    roof.data = bpy.data.meshes.new("hybrid")
    roof.data.from_pydata(bent.tolist(), [], topology.face_lists())
    assert float(planarity(*addon.mesh_of(roof)).max()) > 5e-3
    assert bpy.ops.torchfair.fair(planar=True) == {"FINISHED"}
    assert float(planarity(*addon.mesh_of(roof)).max()) < 1e-4


def test_mesh_is_a_new_object_at_the_same_place(addon: Any, roof: Any) -> None:
    assert bpy.ops.torchfair.mesh(faces=300) == {"FINISHED"}
    made = bpy.context.view_layer.objects.active
    assert made is not roof
    assert made.name == "roof quads"
    assert 200 < len(made.data.polygons) < 400
    old, new = addon.mesh_of(roof)[0], addon.mesh_of(made)[0]
    for box in (torch.amin, torch.amax):
        assert torch.allclose(box(old, 0), box(new, 0), atol=0.02 * float((old.amax(0) - old.amin(0)).max()))


def test_reflections_become_an_image(addon: Any, roof: Any) -> None:
    assert bpy.ops.torchfair.reflect(size=64) == {"FINISHED"}
    image = bpy.data.images["roof reflections"]
    assert image.packed_file is not None
    assert min(image.size) > 64
    pixels = np.array(image.pixels[:])
    assert pixels.std() > 0.1


def test_what_cannot_be_done_is_said(addon: Any, roof: Any) -> None:
    def fails(words: str) -> None:
        with pytest.raises(RuntimeError, match=words):
            bpy.ops.torchfair.fair()

    roof.shape_key_add(name="Basis")
    fails("shape keys")
    roof.shape_key_clear()
    roof.scale = (1.0, 0.0, 1.0)
    bpy.context.view_layer.update()
    fails("scaled to nothing")
    roof.scale = (1.0, 1.0, 1.0)
    data = bpy.data.meshes.new("loose")
    square = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
    data.from_pydata([*square, *square], [], [(0, 1, 2), (3, 4, 5)])
    roof.data = data
    bpy.context.view_layer.update()
    fails("merge its vertices by distance")
    roof.data = bpy.data.meshes.new("nothing")
    fails("has no faces")
    twice = bpy.data.meshes.new("twice")
    twice.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (0, -1, 0)], [], [(0, 1, 2), (0, 1, 3), (0, 1, 4)])
    roof.data = twice
    fails("more than two faces|traversed")
    assert math.isfinite(roof.scale[0])


def test_there_is_nothing_to_do_without_a_mesh_or_in_edit_mode(addon: Any, roof: Any) -> None:
    bpy.ops.object.mode_set(mode="EDIT")
    assert not bpy.ops.torchfair.fair.poll()
    bpy.ops.object.mode_set(mode="OBJECT")
    assert bpy.ops.torchfair.fair.poll()
    bpy.data.objects.remove(roof)
    assert not bpy.ops.torchfair.measure.poll()
