"""Classes of stars: pictures of the paper, and a slow reference that tries very many planes."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
import torch
from geometry_meshes import DEGENERATE, icosphere, random_polytope, torus
from helpers import DOUBLE, cube, random_rotation, tetrahedron, wavy_grid
from star_tools import Star, directions, has_witness, random_arms, star_of, stars_of

from torchfair import ShapeError, Topology
from torchfair.geometry import angle_defects
from torchfair.stars import StarKind, classify_stars
from torchfair.stars._groups import rounding_angle, sector_normals
from torchfair.stars._patterns import four_run_patterns, uneven

CONVEX, SADDLE, NEITHER, EXCLUDED = map(int, StarKind)


def hexagonal(*heights: float) -> Star:
    """A star of six edges over a regular hexagon."""
    angles = np.arange(6) * math.pi / 3
    return star_of(np.stack([np.cos(angles), np.sin(angles), np.array(heights)], axis=1))


def inscribed(*places: tuple[float, float]) -> Star:
    """A star with all vertices on z = x^2 - y^2/2."""
    return star_of([(x, y, x * x - y * y / 2) for x, y in places])


def test_good_saddle_of_fig_4a() -> None:
    star = hexagonal(1.0, -0.4, -0.4, 1.0, -0.4, -0.4)
    classes = classify_stars(*star)
    assert classes.kinds[0] == SADDLE
    assert bool(classes.good[0])
    assert classes.pattern(0) == classes.pattern(0, ordinary=True) == (1, 2, 1, 2)
    # w_1 w_2 and w_4 w_5 are no inflection faces: those between the two edges below
    assert classes.inflections.tolist() == [
        corner == 0 and face not in (1, 4)
        for corner, face in zip(star[1].corners.tolist(), star[1].corner_faces.tolist(), strict=True)
    ]
    assert classes.defect_signs[0] == -1
    torch.testing.assert_close(classes.normals[0].abs(), torch.tensor([0.0, 0, 1], dtype=DOUBLE), atol=1e-9, rtol=0)


@pytest.mark.parametrize(
    ("heights", "pattern", "free"),
    [((0.5, 0.5, -0.5, -0.5, 0.5, -0.5), (2, 2, 1, 1), 0), ((0.1, 0.1, 0.1, -0.1, 0.1, -0.1), (3, 1, 1, 1), 2)],
    ids=["4b", "4c"],
)
def test_bad_saddles_of_fig_4bc(heights: tuple[float, ...], pattern: tuple[int, ...], free: int) -> None:
    classes = classify_stars(*hexagonal(*heights))
    assert classes.kinds[0] == SADDLE
    assert not bool(classes.good[0])
    assert classes.bad_saddles.nonzero().tolist() == classes.bad.nonzero().tolist() == [[0]]
    assert classes.pattern(0) == classes.pattern(0, ordinary=True) == pattern
    sides = classes.sides[: len(heights)]
    not_met = sides == sides.roll(-1)
    inflections = classes.inflections[classes.topology.corners == 0]
    assert int((inflections & not_met).sum()) >= free


def test_star_of_fig_2c_lies_on_a_saddle_and_is_none() -> None:
    classes = classify_stars(*inscribed((1.0, 0.2), (0.6, 0.7), (-0.9, 0.7), (-1.1, -0.3), (-0.6, -0.8), (0.4, -1.0)))
    assert classes.kinds[0] == NEITHER
    assert classes.defect_signs[0] == -1
    assert classes.pattern(0) == ()
    assert classes.pattern(0, ordinary=True) == (3, 1, 1, 1)  # four segments, but within a half-plane


def test_monkey_saddle_cone_roof_and_flat_star() -> None:
    monkey = classify_stars(*hexagonal(1, -1, 1, -1, 1, -1))
    assert (int(monkey.kinds[0]), monkey.pattern(0, ordinary=True)) == (NEITHER, (1,) * 6)
    assert int(monkey.inflection_counts[0]) == 6
    for height in (0.7, -0.7):
        cone = classify_stars(*hexagonal(*[height] * 6))
        assert (int(cone.kinds[0]), int(cone.defect_signs[0])) == (CONVEX, 1)
        assert cone.pattern(0) == cone.pattern(0, ordinary=True) == (6,)
    flat = classify_stars(*hexagonal(*[0.0] * 6))
    assert (int(flat.kinds[0]), bool(flat.flat[0]), int(flat.defect_signs[0])) == (CONVEX, True, 0)
    crease = classify_stars(*star_of([(1, 0, 0), (0, 1, -1), (-1, 0, 0), (0, -1, -1)]))
    assert (int(crease.kinds[0]), bool(crease.flat[0])) == (CONVEX, False)


def test_equals_the_slow_reference_on_thousands_of_random_stars() -> None:
    planes = directions(2000)
    planes = planes[planes[:, 2] > 0]
    missed = 0
    for valence, count in ((3, 50), (4, 600), (5, 600), (6, 1200), (7, 200), (8, 100), (9, 40), (12, 10)):
        for saddle in (0.0, 0.5):
            arms = random_arms(count // 2, valence, seed=valence, height=0.5, saddle=saddle)
            classes = classify_stars(*stars_of(arms))
            kinds = classes.kinds[:: valence + 1].tolist()
            normals = classes.normals[:: valence + 1].numpy()
            for star, kind, normal in zip(arms, kinds, normals, strict=True):
                if kind == SADDLE:  # the plane that is reported is one by the definition
                    assert has_witness(star, normal[None])
                    continue
                missed += has_witness(star, planes)
    assert missed == 0


def test_convex_stars_lie_on_one_side_of_their_faces() -> None:
    arms = np.concatenate([random_arms(300, 5, seed=1, height=h) - [0, 0, d] for h in (0.1, 0.4) for d in (0.3, -0.3)])
    kinds = classify_stars(*stars_of(arms)).kinds[::6].numpy()
    heights = np.einsum("nij,nkj->nik", np.cross(arms, np.roll(arms, -1, axis=1)), arms)
    one_sided = (heights <= 1e-12).all((1, 2)) | (heights >= -1e-12).all((1, 2))
    assert 100 < one_sided.sum() < 1100
    assert np.array_equal(kinds == CONVEX, one_sided)  # all of them project 1-1 by how they were made


def test_every_saddle_of_valence_4_is_good_and_all_its_faces_are_inflection_faces() -> None:
    classes = classify_stars(*stars_of(random_arms(2000, 4, seed=3, height=0.6)))
    saddles = classes.is_kind(StarKind.SADDLE)
    assert int(saddles.sum()) > 300
    assert bool((classes.good == saddles).all())
    assert bool((classes.inflection_counts[saddles] == 4).all())


def test_good_saddles_of_valence_6_are_those_of_the_paper() -> None:
    arms = random_arms(1500, 6, seed=5, height=0.15, saddle=0.4)
    classes = classify_stars(*stars_of(arms))
    good = np.flatnonzero(classes.good[::7].numpy())
    assert len(good) > 300
    for star in good.tolist():
        assert classes.pattern(7 * star) == (1, 2, 1, 2)
    # only the faces that the plane meets are inflection faces
    assert bool((classes.inflection_counts[classes.good] == 4).all())


def test_closed_meshes() -> None:
    for mesh in (tetrahedron(), cube(), icosphere(2), random_polytope(3)):
        classes = classify_stars(*mesh)
        assert bool(classes.is_kind(StarKind.CONVEX).all())
        assert bool((classes.defect_signs == 1).all())
    classes = classify_stars(*torus(24, 16))  # principal quads: saddles exactly where the defect is negative
    defects = angle_defects(*torus(24, 16))
    saddles = classes.is_kind(StarKind.SADDLE)
    assert bool((saddles == (defects < -1e-9)).all())
    assert bool((classes.good == saddles).all())
    assert classes.pattern_counts(kind=StarKind.SADDLE) == {(1, 1, 1, 1): int(saddles.sum())}


def test_pattern_counts_and_boundary() -> None:
    vertices, topology = wavy_grid(8, 7, triangles=True)
    classes = classify_stars(vertices, topology)
    assert bool(((classes.kinds == EXCLUDED) == topology.is_boundary_vertex).all())
    inner = torch.nonzero(~topology.is_boundary_vertex).flatten().tolist()
    for ordinary in (False, True):
        counts = classes.pattern_counts(ordinary=ordinary)
        one_by_one = [classes.pattern(vertex, ordinary=ordinary) for vertex in inner]
        assert counts == {pattern: one_by_one.count(pattern) for pattern in set(one_by_one)}
        assert all(a >= b for a, b in pairwise(counts.values()))


def test_large_valence_and_reflex_corners() -> None:
    angles = 2 * math.pi * np.arange(30) / 30
    rim = np.stack([np.cos(angles), np.sin(angles), 0.2 * np.cos(2 * angles)], axis=1)
    classes = classify_stars(*star_of(rim))
    assert (int(classes.kinds[0]), bool(classes.good[0])) == (SADDLE, True)
    # an L-shaped hexagon and two quads around its reflex corner 0, in one plane
    points = [[0.0, 0, 0], [1, 0, 0], [1, -1, 0], [-1, -1, 0], [-1, 1, 0], [0, 1, 0], [1, 1, 0]]
    topology = Topology.from_faces([[0, 5, 4, 3, 2, 1], [0, 1, 6], [0, 6, 5]])
    plane = classify_stars(torch.tensor(points, dtype=DOUBLE), topology)
    assert (int(plane.kinds[0]), bool(plane.flat[0])) == (CONVEX, True)


@pytest.mark.parametrize("make", DEGENERATE.values(), ids=DEGENERATE)
def test_degenerate_meshes_have_an_answer(make: object) -> None:
    vertices, topology = make()  # type: ignore[operator]
    for dtype in (torch.float32, DOUBLE):
        classes = classify_stars(vertices.to(dtype), topology)
        assert bool(((classes.kinds >= 0) & (classes.kinds <= EXCLUDED)).all())
        assert bool(torch.isfinite(classes.normals).all())
        assert bool((classes.kinds[classes.degenerate] == NEITHER).all())


def test_nan_is_no_class_and_a_batch_is_refused() -> None:
    vertices, topology = hexagonal(1.0, -0.4, -0.4, 1.0, -0.4, -0.4)
    broken = vertices.clone()
    broken[3, 1] = math.nan
    classes = classify_stars(broken, topology)
    assert (int(classes.kinds[0]), bool(classes.degenerate[0])) == (NEITHER, True)
    with pytest.raises(ShapeError, match="not a batch"):
        classify_stars(vertices[None], topology)


@pytest.mark.parametrize("reverse", [False, True])
def test_a_floor_around_the_foot_of_a_box_is_no_inflection_face(reverse: bool) -> None:
    """Its corner is reflex and both its edges are concave; the walls have one concave and one convex edge each."""
    points = [[0.0, 0, 0], [1, 0, 0], [1, -1, 0], [-1, -1, 0], [-1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1]]
    faces = [[0, 5, 4, 3, 2, 1], [0, 1, 7, 6], [0, 6, 8, 5]]
    topology = Topology.from_faces([face[::-1] for face in faces] if reverse else faces)
    classes = classify_stars(torch.tensor(points, dtype=DOUBLE), topology)
    inflections = classes.topology.corner_faces[classes.inflections & (topology.corners == 0)]
    assert inflections.tolist() == [1, 2]
    assert int(classes.inflection_counts[0]) == 2


def test_thousands_of_equal_stars_are_all_judged_alike() -> None:
    """Stars are judged some thousand at a time."""
    star = [[1.0, 0.1, 0.4], [0.0, 1.2, -0.3], [-0.9, 0.0, 0.5], [0.1, -1.0, -0.4]]
    arms = np.repeat(np.array([star]), 9000, axis=0)
    classes = classify_stars(*stars_of(arms))
    assert bool((classes.kinds[::5] == SADDLE).all())
    assert bool((classes.sides.view(9000, -1) == classes.sides.view(9000, -1)[:1]).all())
    assert bool((classes.inflection_counts[::5] == 4).all())


@pytest.mark.parametrize("valence", [4, 6, 9, 20])
def test_planes_that_cut_opposite_sectors_alike_come_first_then_those_with_the_shortest_longest_run(
    valence: int,
) -> None:
    crossed = four_run_patterns(valence).crossed
    runs = (crossed.roll(-1, 1) - crossed) % valence
    keys = [(abs(a - c) + abs(b - d), max(a, b, c, d)) for a, b, c, d in runs.tolist()]
    ranks = dict(zip(keys, uneven(crossed, valence).tolist(), strict=True))
    assert [ranks[key] for key in keys] == uneven(crossed, valence).tolist()
    assert sorted(ranks, key=ranks.__getitem__) == sorted(ranks)
    assert len(set(ranks.values())) == len(ranks)


@pytest.mark.parametrize("valence", [6, 8, 9, 10, 12])
def test_planes_of_saddles_show_them_also_where_edges_lie_in_common_planes(valence: int) -> None:
    """Regular stars of three heights only: many planes through two edges contain others too.

    Where two faces lie in one plane, every plane cuts them in opposite directions, which rounding must not judge.
    """
    angles = np.arange(valence) * 2 * math.pi / valence
    heights = np.random.default_rng(0).integers(-1, 2, (100, valence))
    flat = np.broadcast_to(np.stack([np.cos(angles), np.sin(angles)], axis=1), (100, valence, 2))
    arms = np.concatenate([flat, heights[..., None]], axis=2)
    classes = classify_stars(*stars_of(arms))
    saddles = np.flatnonzero(classes.kinds[:: valence + 1].numpy() == SADDLE)
    assert 30 < len(saddles) < 95
    for star in saddles.tolist():
        assert has_witness(arms[star], classes.normals[(valence + 1) * star][None].numpy(), rounding=1e-12)
    vertices, topology = stars_of(arms)
    assert torch.equal(classify_stars(vertices @ random_rotation(3).T, topology).kinds, classes.kinds)


@pytest.mark.parametrize("seed", range(4))
def test_edges_in_a_plane_are_on_no_side_of_it(seed: int) -> None:
    """A roof whose ridge runs along x, and a flat star, turned so that rounding leaves nothing exactly in a plane."""
    turn = random_rotation(seed).T
    roof, topology = star_of([(1, 0, 0), (0, 1, -1), (-1, 0, 0), (0, -1, -1)])
    classes = classify_stars(roof @ turn, topology)
    assert classes.ordinary_sides[:4].tolist() == [0, -1, 0, -1]
    assert classes.pattern(0, ordinary=True) == (2,)
    flat, topology = hexagonal(*[0.0] * 6)
    classes = classify_stars(flat @ turn, topology)
    assert not bool(classes.ordinary_sides.any())
    assert not bool(classes.sides.any())
    assert classes.pattern(0) == classes.pattern(0, ordinary=True) == ()


@pytest.mark.parametrize("seed", range(5))
def test_rounding_turns_planes_of_sectors_by_no_more_than_its_bound(seed: int) -> None:
    """Also where a short arm beside a long one makes a thin sector: ends and centre are wrong by their last digit."""
    random = np.random.default_rng(seed)
    arms = random_arms(200, 6, seed, height=0.5)
    arms[:, 1] = 1e-3 * (arms[:, 2] + 1e-2 * random.normal(size=(200, 3)))
    arms = torch.from_numpy(arms)
    scale, eps = torch.full((200,), 30.0, dtype=DOUBLE), 1e-11
    bound = rounding_angle(arms, scale, eps)
    assert float(bound.median()) < 1e-2
    for _ in range(20):
        shifts = eps * 30.0 * torch.from_numpy(random.uniform(-1, 1, (2, 200, 6, 3)))
        before, after = sector_normals(arms), sector_normals(arms + shifts[0] - shifts[1][:, :1])
        turned = torch.linalg.cross(before, after).norm(dim=-1).amax(1)
        assert bool((turned <= bound).all())
    assert float((turned / bound).max()) > 0.02  # which is not much too large
