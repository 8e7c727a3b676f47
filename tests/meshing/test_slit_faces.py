"""Faces in which a slit of the surface ends are cut in two from its tip."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from torchfair import Topology
from torchfair.geometry import corner_angles
from torchfair.meshing import principal_quads
from torchfair.meshing.polygon_area import area_vector
from torchfair.meshing.polygon_sides import sides_cross
from torchfair.meshing.slit_faces import without_slits


def notched(half_width: float, *more: list[float]) -> np.ndarray:
    """A unit square with a notch from the middle of its right side to its centre, which is corner 3."""
    square = [[0, 0, 0], [1, 0, 0], [1, 0.5 - half_width, 0], [0.5, 0.5, 0], [1, 0.5 + half_width, 0], [1, 1, 0]]
    return np.array([*square, [0, 1, 0], *more], float)


@pytest.mark.parametrize("half_width", [1e-9, 1e-5, 0.02])
@pytest.mark.parametrize("first", range(7))
def test_a_face_with_a_slit_is_cut_from_its_tip(half_width: float, first: int) -> None:
    positions = notched(half_width)
    order = [*range(first, 7), *range(first)]
    parts = without_slits(positions, [order])
    assert len(parts) == 2
    assert all(3 in part for part in parts)
    areas = [area_vector(positions, part)[2] for part in parts]
    assert sum(areas) == pytest.approx(area_vector(positions, order)[2])
    assert min(areas) > 0.3
    assert sum(map(len, parts)) == 9  # one edge more


def test_other_faces_stay_as_they_are() -> None:
    """Also a notch of more than ten degrees."""
    wide = np.tan(np.radians(5.1)) * 0.5
    for faces in ([[0, 1, 5, 6]], [list(range(7))]):
        assert without_slits(notched(wide), faces) is faces


def test_no_part_has_an_angle_below_eight_degrees() -> None:
    """In a face so low that every cut from the tip is nearly along the slit."""
    for height, parts in ((0.06, 1), (0.6, 2)):
        low = notched(1e-5) * [1, 1, 1]
        low[:, 1] = 0.5 + height * (low[:, 1] - 0.5)
        assert len(without_slits(low, [list(range(7))])) == parts


def test_no_part_has_sides_that_cross() -> None:
    """Between the tip and the left side there is a notch from above; a cut to the corner behind it would cross that."""
    notch = [[0.4, 1, 0], [0.3, 0.35, 0], [0.2, 1, 0]]
    positions = np.vstack([notched(1e-5)[:6], notch, [[0, 1, 0]]])
    parts = without_slits(positions, [list(range(10))])
    assert len(parts) == 2
    assert not any(sides_cross(positions[part], np.array([0.0, 0, 1])) for part in parts)


def test_no_edge_is_made_twice() -> None:
    """Where all cuts are edges of other faces, the face stays."""
    positions = notched(1e-5, [0.5, 0.5, 1])
    others = [[3, end, 7] for end in (0, 1, 5, 6)]
    faces = [list(range(7)), *others]
    assert without_slits(positions, faces) == faces
    assert len(without_slits(positions, faces[:4])) == 5  # one is left
    assert [3, 6] in [part[:2] for part in _turned(without_slits(positions, faces[:4]))]


def _turned(faces: list[list[int]]) -> list[list[int]]:
    """Faces with corner 3 from there on, in both directions."""
    from_tip = [face[face.index(3) :] + face[: face.index(3)] for face in faces if 3 in face]
    return [*from_tip, *([face[0], *face[:0:-1]] for face in from_tip)]


@pytest.mark.parametrize("turned", [False, True])
def test_a_plate_with_a_slit_is_meshed(turned: bool) -> None:
    """Sides of the slit are nearer to each other than anything in the mesh; no mesh was found without cuts."""
    vertices, topology = slit_plate(turned=turned)
    mesh = principal_quads(vertices, topology, count=400)
    assert mesh.report["euler_number"] == 1
    assert abs(mesh.topology.num_faces - 400) < 20
    assert mesh.report["smallest_curve_face"] >= 0.05
    assert float(torch.rad2deg(corner_angles(mesh.vertices, mesh.topology).min())) > 8.0


def slit_plate(lines: int = 26, *, turned: bool) -> tuple[torch.Tensor, Topology]:
    """A quadric over a square, slit from the left side to beyond the middle; lines of curvature may cross the slit."""
    steps = torch.linspace(-1, 1, lines + 1, dtype=torch.float64)
    x, y = (of.reshape(-1) for of in torch.meshgrid(steps, steps, indexing="ij"))
    at = torch.arange((lines + 1) ** 2).reshape(lines + 1, lines + 1)
    a, b, c, d = (of.reshape(-1) for of in (at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]))
    faces = torch.cat([torch.stack([a, b, c], 1), torch.stack([a, c, d], 1)])
    on_slit = torch.nonzero((y.abs() < 1e-9) & (x < 0.25)).squeeze(1)
    double = torch.arange(len(x))
    double[on_slit] = len(x) + torch.arange(len(on_slit))
    below = y[faces].mean(1) < 0
    faces[below] = double[faces[below]]
    points = torch.stack([torch.cat([x, x[on_slit]]), torch.cat([y, y[on_slit] - 1e-5])], 1)
    u, v = (points @ points.new_tensor([[0.88, -0.48], [0.48, 0.88]])).T if turned else points.T
    height = 0.4 * u.square() - 0.2 * v.square() if turned else 0.3 * u.square() + 0.1 * v.square()
    return torch.cat([points, height[:, None]], 1), Topology.from_faces(faces, len(points))
