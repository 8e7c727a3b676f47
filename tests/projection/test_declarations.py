"""What terms declare is tried at the start: closed forms are derivatives, rows of batched functions independent."""

from __future__ import annotations

from collections.abc import Callable

import pytest
import torch
from bars import LENGTHS, VERTICES, all_derivatives, all_stretched, derivative, solved, stretched, term
from helpers import DOUBLE, wavy_grid
from torch import Tensor

from torchfair import TorchfairError
from torchfair.constraints import absolute_curvature_terms, normal_variation_terms
from torchfair.projection import ElementTerm, GuidedProjection, ProjectionSettings, guided_projection

WRONG_DERIVATIVES: dict[str, Callable[[Tensor, Tensor], Tensor]] = {
    "sign": lambda x, length: -derivative(x, length),
    "factor": lambda x, length: 1.01 * derivative(x, length),
    "order of vertices": lambda x, length: derivative(x.flip(0), length),
    "order of unknowns": lambda x, length: derivative(x, length).view(2, 3).T.reshape(6),
    "zero": lambda x, length: torch.zeros_like(derivative(x, length)),
}
WORDS = (
    r"jacobian of term 'bars' is not the derivative of its residual: in element \d, component 0 .* of row \d of block"
)


@pytest.mark.parametrize("dtype", [DOUBLE, torch.float32])
@pytest.mark.parametrize("mistake", WRONG_DERIVATIVES)
def test_wrong_closed_forms_are_refused(mistake: str, dtype: torch.dtype) -> None:
    wrong, blocks = WRONG_DERIVATIVES[mistake], {"vertices": VERTICES.to(dtype)}

    def batched(x: Tensor, lengths: Tensor) -> Tensor:
        return torch.func.vmap(wrong)(x, lengths)

    for one in (
        term(data=(LENGTHS.to(dtype),), jacobian=wrong),
        term(
            data=(LENGTHS.to(dtype),),
            residual=lambda x, length: 1e3 * stretched(x, length),
            jacobian=lambda x, length: 1e3 * wrong(x, length),
        ),
        term(data=(LENGTHS.to(dtype),), residual=all_stretched, jacobian=batched, batched=True),
    ):
        with pytest.raises(TorchfairError, match=WORDS):
            guided_projection(blocks, [one])


def test_the_place_of_a_wrong_closed_form_is_named() -> None:
    """Of two components with two blocks: d (x y, 1e-6 z) with a wrong entry at one element, whatever the sizes."""
    blocks = {
        "x": torch.tensor([[2.0], [3.0]], dtype=DOUBLE),
        "yz": torch.tensor([[5.0, 7.0], [1.0, 4.0]], dtype=DOUBLE),
    }
    stencil = [("x", torch.tensor([[1], [0]])), ("yz", torch.tensor([[1], [1]]))]

    def product(x: Tensor, yz: Tensor, factor: Tensor) -> Tensor:
        return torch.stack([x[0, 0] * yz[0, 0], 1e-6 * yz[0, 1]])

    def by_hand(x: Tensor, yz: Tensor, factor: Tensor) -> Tensor:
        zero = torch.zeros_like(factor)
        rows = [yz[0, 0], x[0, 0], zero], [zero, zero, 1e-6 * factor]
        return torch.stack([torch.stack(row) for row in rows])

    for last in (1.0, 2.0):
        factors = torch.tensor([1.0, last], dtype=DOUBLE)
        one = ElementTerm("products", product, stencil, (factors,), jacobian=by_hand)
        if last == 1.0:
            guided_projection(blocks, [one], settings=ProjectionSettings(max_iterations=1))
            continue
        place = "in element 1, component 1 changes by 1e-06 with coordinate 1 of row 1 of block 'yz', not by 2e-06"
        with pytest.raises(TorchfairError, match=place):
            guided_projection(blocks, [one])


def test_a_wrong_closed_form_of_a_linear_term_is_refused_at_zero_too() -> None:
    """There every linear map meets the residual."""
    wrong = term(
        residual=lambda x, length: x[0, 0] - length,
        jacobian=lambda x, length: -x.new_tensor([1.0, 0, 0, 0, 0, 0]),
        linear=True,
    )
    with pytest.raises(TorchfairError, match=WORDS):
        guided_projection({"vertices": torch.zeros_like(VERTICES)}, [wrong])


def test_another_subgradient_at_a_kink_is_no_mistake() -> None:
    """max(x, y) where x = y: torch takes half of both, the closed form all of x; elsewhere it is wrong to swap them."""
    x = torch.tensor([[1.0, 1.0], [2.0, 2.0]], dtype=DOUBLE)
    stencil = [("x", torch.tensor([[0], [1]]))]

    def first(x: Tensor) -> Tensor:
        ahead = (x[0, 0] >= x[0, 1]).to(x.dtype)
        return torch.stack([ahead, 1.0 - ahead])

    def largest(x: Tensor) -> Tensor:
        return torch.amax(x[0])

    settings = ProjectionSettings(max_iterations=1)
    guided_projection({"x": x}, [ElementTerm("larger", largest, stencil, jacobian=first)], settings=settings)
    swapped = ElementTerm("larger", largest, stencil, jacobian=lambda x: first(x).flip(0))
    with pytest.raises(TorchfairError, match="not the derivative"):
        guided_projection({"x": x}, [swapped], settings=settings)


def test_rounding_beside_a_kink_is_no_mistake() -> None:
    """The derivative of exp(3 log x) - x^3 is zero; by the chain rule it is 1e-14 or so."""

    def nothing(x: Tensor) -> Tensor:
        return torch.exp(3.0 * torch.log(x[0, 0])) - x[0, 0] ** 3

    def both(x: Tensor) -> Tensor:
        return torch.stack([torch.amax(x[0]), nothing(x)])

    x = torch.linspace(1.1, 4.7, 8, dtype=DOUBLE)[:, None].expand(8, 2)
    stencil = [("x", torch.arange(8)[:, None])]
    alone = ElementTerm("nothing", nothing, stencil)
    noise = alone.jacobians(alone.arguments({"x": x})).abs().max()
    assert 0.0 < float(noise) < 1e-12

    def by_hand(x: Tensor) -> Tensor:
        ahead = (x[0, 0] >= x[0, 1]).to(x)
        return torch.stack([torch.stack([ahead, 1.0 - ahead]), torch.zeros_like(x[0])])

    closed = ElementTerm("both", both, stencil, jacobian=by_hand)
    guided_projection({"x": x}, [closed], settings=ProjectionSettings(max_iterations=0))


def test_what_torch_cannot_differentiate_is_no_verdict_on_a_closed_form() -> None:
    def outside(x: Tensor, lengths: Tensor) -> Tensor:
        return torch.from_numpy(all_stretched(x.detach(), lengths).numpy())

    closed = term(residual=outside, jacobian=all_derivatives, batched=True)
    assert solved(closed).residuals[0].largest < 1e-3


def test_functions_are_tried_once_for_all_data_and_anew_if_they_change() -> None:
    sizes: list[int] = []

    def counted(x: Tensor, lengths: Tensor) -> Tensor:
        sizes.append(x.shape[0])
        return all_derivatives(x, lengths)

    many = torch.arange(20)[:, None] + torch.arange(2)
    blocks = {"vertices": torch.randn(21, 3, dtype=DOUBLE, generator=torch.Generator().manual_seed(0))}
    settings = ProjectionSettings(max_iterations=0)

    def bars(length: float) -> ElementTerm:
        data = (torch.full((20,), length, dtype=DOUBLE),)
        return term(stencil=[("vertices", many)], data=data, residual=all_stretched, jacobian=counted, batched=True)

    problem = GuidedProjection(blocks, [bars(1.0)])
    for length in (1.0, 2.0):
        problem = problem.with_terms([bars(length)])
        problem.solve(blocks, settings=settings)
    assert [size for size in sizes if size < 20] == [8]
    with pytest.raises(TorchfairError, match=WORDS):
        problem.with_terms(
            [term(stencil=[("vertices", many)], data=bars(1.0).data, jacobian=WRONG_DERIVATIVES["sign"])]
        ).solve(blocks, settings=settings)


def test_batched_functions_take_any_number_of_elements() -> None:
    """A residual for one element runs for three too, and means something else."""
    with pytest.raises(TorchfairError, match="any number n of elements"):
        solved(term(batched=True))
    with pytest.raises(
        TorchfairError, match=r"residual of term 'bars' for the last element is another one.*batched=True"
    ):
        solved(term(residual=lambda x, lengths: all_stretched(x - x.mean(0), lengths) * x.mean(), batched=True))


@pytest.mark.parametrize("dtype", [DOUBLE, torch.float32])
@pytest.mark.parametrize(
    "shape", [(1.0, 1.0, 1.0), (1e4, 1e4, 1e4), (1e-4, 1e-4, 1e-4), (1.0, 1.0, 0.0), (1.0, 1.0, 1e-6)]
)
def test_closed_forms_of_the_library_are_right_in_every_unit_and_flat(
    shape: tuple[float, ...], dtype: torch.dtype
) -> None:
    """In float32 the products of four lengths of 1e4 have few digits, whichever way they are differentiated."""
    vertices, topology = wavy_grid(triangles=True)
    blocks = {"vertices": (vertices * torch.tensor(shape, dtype=DOUBLE)).to(dtype)}
    smoothing = 0.01 * shape[0]
    for terms in (
        normal_variation_terms(topology, smoothing=smoothing),
        absolute_curvature_terms(topology, smoothing=smoothing),
    ):
        guided_projection(blocks, terms, settings=ProjectionSettings(max_iterations=0))
