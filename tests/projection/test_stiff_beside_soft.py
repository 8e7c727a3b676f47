"""Theorems about "converged" where one residual is far stiffer than the others, or its derivative is not finite."""

import pytest
import torch

from torchfair.projection import ElementTerm, GuidedProjection, ProjectionSettings, SmoothAbsolute, guided_projection

F = torch.float64


@pytest.mark.parametrize("linear", [False, True])
@pytest.mark.parametrize(("place", "weight"), [(1e3, 1e10), (1e4, 1e12), (1e6, 1e8)])
def test_a_length_is_reached_beside_a_stiff_pin_far_from_the_origin(place, weight, linear):
    start = torch.tensor([[place, 0.0], [place + 1.3, 0.2]], dtype=F)
    pin = ElementTerm(
        "pin", lambda x, p: x[0] - p, [("x", torch.tensor([[0]]))], data=(start[:1],), weight=weight, linear=linear
    )
    length = ElementTerm(
        "length", lambda x: torch.linalg.vector_norm(x[1] - x[0]) - 1.0, [("x", torch.tensor([[0, 1]]))]
    )
    result = guided_projection({"x": start}, [pin, length])
    assert result.status.converged
    assert result.residuals[1].largest < 1e-5


def test_two_linear_terms_of_very_different_weights_are_both_met():
    start = torch.tensor([[1e4], [0.0]], dtype=F)
    stiff = ElementTerm("stiff", lambda x: x[0] - 1e4, [("x", torch.tensor([[0]]))], weight=1e14, linear=True)
    soft = ElementTerm("soft", lambda x: x[0] - 1.0, [("x", torch.tensor([[1]]))], linear=True)
    result = guided_projection({"x": start}, [stiff, soft])
    assert result.status.converged
    assert abs(float(result.blocks["x"][1, 0]) - 1.0) < 1e-5


def test_a_sharp_median_is_no_state_without_residuals():
    places = torch.tensor([0.0, 1.0, 2.0, 3.0, 100.0], dtype=F)
    stencil = [("x", torch.zeros(5, 1, dtype=torch.long))]
    term = ElementTerm("places", lambda x, p: x[0] - p, stencil, data=(places,), loss=SmoothAbsolute(1e-30))
    result = guided_projection({"x": torch.tensor([[50.0]], dtype=F)}, [term])
    assert abs(float(result.blocks["x"]) - 2.0) < 1e-12
    assert result.status.name != "ZERO_MERIT"


def test_residuals_at_a_place_without_a_finite_derivative_are_not_taken_for_zero():
    term = ElementTerm("root", lambda x: torch.sqrt(x[0] - 1.0) + 1.0, [("x", torch.tensor([[0]]))])
    result = guided_projection({"x": torch.tensor([[4.0]], dtype=F)}, [term])
    assert result.merit == pytest.approx(0.5)
    assert not result.status.converged


@pytest.mark.parametrize("solver", ["dense", "scipy"])
def test_single_precision_does_not_certify_what_it_cannot_solve(solver):
    n = 400
    stencil = [("u", torch.stack([torch.arange(n - 2) + k for k in range(3)], 1))]
    term = ElementTerm(
        "bratu", lambda u: (u[0, 0] - 2.0 * u[1, 0] + u[2, 0]) * n * n + 3.0 * torch.exp(u[1, 0]), stencil
    )
    ends = torch.zeros(n, dtype=torch.bool)
    ends[[0, -1]] = True
    settings = ProjectionSettings(solver=solver)
    result = guided_projection({"u": torch.zeros(n, 1)}, [term], fixed={"u": ends}, settings=settings)
    assert not result.status.converged or result.merit < 1e-2


def test_members_before_a_wall_do_not_stop_the_others():
    term = ElementTerm("wall", lambda x: torch.where(x[0] > 0.5, x[0], torch.inf), [("x", torch.tensor([[0]]))])
    starts = torch.tensor([[[3.0]], [[0.6]], [[0.5000001]]], dtype=F)
    problem = GuidedProjection({"x": starts[0]}, [term])
    for start, member in zip(starts, problem.solve_batch({"x": starts}), strict=True):
        alone = problem.solve({"x": start})
        assert member.status is alone.status
        torch.testing.assert_close(member.blocks, alone.blocks, rtol=1e-12, atol=0.0)


def test_a_block_without_rows_is_solved():
    term = ElementTerm("none", lambda x: x[0], [("x", torch.zeros(0, 1, dtype=torch.long))])
    result = guided_projection({"x": torch.zeros(0, 3, dtype=F)}, [term])
    assert result.status.converged
    assert result.blocks["x"].shape == (0, 3)
