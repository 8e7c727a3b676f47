from __future__ import annotations

import hypothesis.strategies as st
import torch
from helpers import DOUBLE
from hypothesis import given, settings

from torchfair.geometry import tangent_bases
from torchfair.geometry.tangent_basis import CUT

AXES = torch.cat([torch.eye(3, dtype=DOUBLE), -torch.eye(3, dtype=DOUBLE)])


def check(normals: torch.Tensor, tolerance: float) -> None:
    frames = torch.cat([tangent_bases(normals), normals[..., None, :]], dim=-2)
    identity = torch.eye(3, dtype=normals.dtype).expand_as(frames)
    torch.testing.assert_close(frames @ frames.mT, identity, rtol=0, atol=tolerance)
    assert (torch.linalg.det(frames) > 0).all()


@settings(max_examples=50, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_orthonormal_and_right_handed_everywhere(seed):
    random = torch.Generator().manual_seed(seed)
    normals = torch.randn(4, 50, 3, dtype=DOUBLE, generator=random)
    normals = torch.nn.functional.normalize(torch.cat([normals, AXES.expand(4, 6, 3)], dim=1), dim=-1)
    check(normals, 1e-14)
    check(normals.float(), 1e-6)


def test_around_the_cut_and_the_poles():
    angle = torch.linspace(0, 6.3, 100, dtype=DOUBLE)
    for height in (CUT - 1e-15, CUT, CUT + 1e-15, 1 - 1e-15, -1 + 1e-15, 1.0, -1.0, 0.0, -0.0):
        radius = (1 - height**2) ** 0.5
        check(torch.stack([radius * angle.cos(), radius * angle.sin(), torch.full_like(angle, height)], dim=-1), 1e-14)


def test_zero_with_zero_derivatives_without_a_normal_and_nan_for_nan():
    zero = torch.zeros(3, dtype=DOUBLE)
    assert not tangent_bases(zero).any()
    assert not torch.func.jacrev(tangent_bases)(zero).any()
    assert tangent_bases(torch.full((3,), float("nan"))).isnan().any()


def test_smooth_at_level_and_vertical_normals():
    for normal in AXES:
        variable = normal.clone().requires_grad_()
        assert torch.autograd.gradcheck(tangent_bases, variable, check_forward_ad=True)
        assert torch.autograd.gradgradcheck(tangent_bases, variable)
