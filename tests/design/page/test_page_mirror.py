"""What the page mirrors, pixel by pixel, is what torchfair.reflection says."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from browser_tools import Window, hall

from torchfair.cameras import Camera, OrthographicCamera, PerspectiveCamera
from torchfair.reflection import Checker, Environment, EquirectangularImage, Stripes, render_reflection

pytestmark = pytest.mark.browser


@pytest.fixture
def bare(window: Window) -> Window:
    """A window that shows nothing but the facets, as mirrors."""
    window("design.store.put({ lines: false, sphere: false })")
    for name in ("tools", "gauss", "tag", "notices"):
        window(f"document.getElementById('{name}').hidden = true")
    window.page.mouse.move(1, 1)
    set_mirror(window, surroundings="stripes", eye="room")
    return window


def set_mirror(window: Window, **values: object) -> None:
    for name, value in values.items():
        window(f"document.getElementById('{name}').value = {value!r}")
    window("design.panel.applyMirror()")
    window.drawn()


def camera_of(window: Window) -> Camera:
    """The camera of torchfair that sees what the page sees."""
    said = window("design.scene.view.toJSON(design.store.topology.origin)")
    eye, target = torch.tensor(said["position"]).double(), torch.tensor(said["target"]).double()
    width, height, half = window("[design.scene.view.width, design.scene.view.height, design.scene.view.halfHeight]")
    if said["orthographic"]:
        return OrthographicCamera(target - eye, targets=target, half_widths=half * width / height)
    slope = np.tan(np.radians(said["fov"]) / 2) * width / height
    return PerspectiveCamera(eye, target, 2 * np.degrees(np.arctan(slope)))


def differences(window: Window, environment: Environment, dark: np.ndarray, light: np.ndarray) -> np.ndarray:
    """|page - torchfair| (N,) of the pixels that the mesh covers whole, in units of the range of the environment."""
    picture = window.picture()
    expected = render_reflection(*hall(), camera_of(window), environment, size=picture.shape[:2])
    inside = expected.coverage[0].numpy() > 0.999
    assert inside.sum() > 30_000
    colours = dark + (light - dark) * expected.image[0].permute(1, 2, 0).numpy()
    return (np.abs(picture - colours) / np.abs(light - dark)).max(-1)[inside]


def two_colours(window: Window) -> tuple[np.ndarray, np.ndarray]:
    dark, light = (window(f"design.scene.uniforms.{name}.value.toArray()") for name in ("dark", "light"))
    return 255 * np.array(dark), 255 * np.array(light)


def stripes_of(window: Window) -> Stripes:
    direction, frequency, sharpness = window(
        "[design.scene.uniforms.stripeDirection.value.toArray(), design.scene.uniforms.frequency.value,"
        " design.scene.uniforms.sharpness.value]"
    )
    return Stripes(torch.tensor(direction).double(), frequency, sharpness)


@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("setting", [{"around": "90", "tilt": "20", "frequency": "4", "sharpness": "8"},
    {"around": "10", "tilt": "-60", "frequency": "9", "sharpness": "3"}])  # fmt: skip
def test_stripes_are_those_of_the_library(bare: Window, setting: dict[str, str], orthographic: bool) -> None:
    set_mirror(bare, surroundings="stripes", **setting)
    if orthographic:
        bare("design.flights.parallel()")
    bare("design.scene.view.orbit(70, -30)")
    bare.drawn()
    found = differences(bare, stripes_of(bare), *two_colours(bare))
    assert np.median(found) < 0.01
    assert np.quantile(found, 0.9) < 0.05  # the rest are borders of facets, which the page smooths


def test_the_direction_of_the_stripes_matters(bare: Window) -> None:
    set_mirror(bare, surroundings="stripes", around="90", tilt="20")
    stripes = stripes_of(bare)
    set_mirror(bare, around="20", tilt="20")
    assert np.median(differences(bare, stripes, *two_colours(bare))) > 0.05


def test_the_checker_is_that_of_the_library(bare: Window) -> None:
    set_mirror(bare, surroundings="checker", frequency="2.5", sharpness="6")
    found = differences(bare, Checker(), *two_colours(bare))
    assert np.median(found) < 0.01


def test_a_panorama_is_looked_up_as_in_the_library(bare: Window, tmp_path: Path) -> None:
    from PIL import Image

    down, across = np.meshgrid(np.linspace(0, 1, 64), np.linspace(0, 1, 128, endpoint=False), indexing="ij")
    bands = np.stack([down, 0.5 + 0.5 * np.sin(2 * np.pi * across), 0.5 + 0.5 * np.cos(6 * np.pi * across)])
    texels = np.round(255 * bands).astype(np.uint8)
    Image.fromarray(np.moveaxis(texels, 0, -1)).save(tmp_path / "room.png")
    bare.page.set_input_files("#panorama", tmp_path / "room.png")
    bare.wait("design.scene.uniforms.surroundings.value === 3")
    bare.drawn()
    environment = EquirectangularImage(torch.from_numpy(texels / 255))
    found = differences(bare, environment, np.zeros(3), np.full(3, 255.0))
    assert np.median(found) < 0.01


def test_surroundings_stay_in_the_room_follow_the_eye_or_stay_on_the_facets(bare: Window) -> None:
    set_mirror(bare, surroundings="stripes", eye="frozen", around="90", tilt="20")
    stripes, camera = stripes_of(bare), camera_of(bare)
    bare("design.scene.view.orbit(60, 20)")
    bare.drawn()
    moved = differences(bare, stripes, *two_colours(bare))
    assert np.median(moved) > 0.01  # not what the eye sees from where it is now
    eye = bare("design.scene.uniforms.mirrorEye.value.toArray()")
    assert torch.allclose(torch.tensor(eye).double() + torch.tensor(bare("design.store.topology.origin")).double(),
                          camera.origins[0], atol=1e-3)  # fmt: skip
    set_mirror(bare, eye="eye")
    axes = torch.tensor(bare("[design.scene.view.right, design.scene.view.forward, design.scene.view.upward]"))
    direction = torch.tensor(bare("design.scene.uniforms.stripeDirection.value.toArray()"))
    frequency = bare("design.scene.uniforms.frequency.value")
    turned = Stripes((direction @ axes).double(), frequency, stripes.sharpness)
    assert np.median(differences(bare, turned, *two_colours(bare))) < 0.01


def test_the_mesh_before_is_shown_while_a_key_is_held(bare: Window) -> None:
    start = bare.picture()
    vertex = bare.inner_vertex()
    place = bare(f"design.scene.mesh.point({vertex}).map((x, i) => x + design.store.topology.origin[i])")
    bare.do(f"design.send('move', {{ places: [[{vertex}, {place[0]}, {place[1]}, {place[2] + 0.8}]], release: true }})")
    bare.drawn()
    after = bare.picture()
    bare.page.focus("#canvas")
    bare.page.keyboard.down(" ")
    bare.wait("design.store.before")
    bare.drawn()
    assert np.abs(bare.picture() - start).mean() < 1 < np.abs(after - start).mean()
    bare.page.keyboard.up(" ")
    bare.wait("!design.store.before")
    bare.do("design.send('undo')")
