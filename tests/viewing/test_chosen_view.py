from __future__ import annotations

import math

import pytest
import torch
from helpers import wavy_grid

from torchfair.errors import TorchfairError
from torchfair.viewing import chosen_view, view_direction
from torchfair.viewing.chosen_view import parse_view

X, Y, Z = torch.eye(3, dtype=torch.float64)


@pytest.mark.parametrize(("up", "front", "right"), [("z", -Y, X), ("y", Z, X), ("x", -Y, -Z)])
def test_front_top_and_sides(up: str, front: torch.Tensor, right: torch.Tensor) -> None:
    """The eye is in front at azimuth 0, on the right at 90, and above for the top, with the front below."""
    mesh = wavy_grid(5, 5)
    axis = {"x": X, "y": Y, "z": Z}[up]
    for text, expected in (("front", front), ("90,0", right), ("180,0", -front), ("top", axis), ("0,-90", -axis)):
        view = chosen_view(*mesh, up, parse_view(text))
        torch.testing.assert_close(view.towards_eye, expected, atol=1e-4, rtol=0)
        assert torch.equal(view.up, axis)


def test_iso_sees_three_axes_alike() -> None:
    eye = chosen_view(*wavy_grid(5, 5), "z", parse_view("iso")).towards_eye
    torch.testing.assert_close(eye.abs(), torch.full((3,), math.sqrt(1 / 3), dtype=torch.float64))


def test_without_words_it_is_the_usual_view_and_an_axis_alone_keeps_three_quarters() -> None:
    vertices, topology = wavy_grid(5, 5)
    usual, chosen = view_direction(vertices, topology), chosen_view(vertices, topology)
    assert torch.equal(usual.towards_eye, chosen.towards_eye)
    for up, axis in (("x", X), ("y", Y), ("z", Z)):
        view = chosen_view(vertices, topology, up)
        assert float(view.towards_eye @ axis) == pytest.approx(math.sin(math.radians(38)))


@pytest.mark.parametrize("text", ["side", "1", "1,2,3", "10,91", "nan,0", "a,b"])
def test_other_views_are_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"expected|could not convert"):
        parse_view(text)


def test_other_axes_are_refused() -> None:
    with pytest.raises(TorchfairError, match="x, y or z"):
        chosen_view(*wavy_grid(3, 3), "w")
