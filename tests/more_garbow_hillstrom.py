"""The least-squares problems of More, Garbow and Hillstrom, "Testing unconstrained optimization software", ACM TOMS 7
(1981): data, starts and minima as published there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import more_garbow_hillstrom_residuals as of
import torch
from torch import Tensor

from torchfair.projection import ElementTerm

BARD = [0.14, 0.18, 0.22, 0.25, 0.29, 0.32, 0.35, 0.39, 0.37, 0.58, 0.73, 0.96, 1.34, 2.10, 4.39]
GAUSSIAN = [0.0009, 0.0044, 0.0175, 0.0540, 0.1295, 0.2420, 0.3521, 0.3989]
# Valleys of weak minima: a narrow bell through two neighbouring data, or the middle one, is zero at all others.
NARROW_GAUSSIAN = 2 * sum(y**2 for y in GAUSSIAN[:-1]) + GAUSSIAN[-1] ** 2 - GAUSSIAN[5] ** 2 - GAUSSIAN[6] ** 2
SINGLE_GAUSSIAN = 2 * sum(y**2 for y in GAUSSIAN[:-1])
MEYER = [34780, 28610, 23650, 19630, 16370, 13720, 11540, 9744, 8261, 7030, 6005, 5147, 4427, 3820, 3307, 2872]
KOWALIK_OSBORNE = [
    [4.0, 2.0, 1.0, 0.5, 0.25, 0.167, 0.125, 0.1, 0.0833, 0.0714, 0.0625],
    [0.1957, 0.1947, 0.1735, 0.1600, 0.0844, 0.0627, 0.0456, 0.0342, 0.0323, 0.0235, 0.0246],
]
OSBORNE_1 = """
844 908 932 936 925 908 881 850 818 784 751 718 685 658 628 603 580 558 538 522 506 490 478 467 457 448 438 431 424 420
414 411 406
"""
OSBORNE_2 = """
1366 1191 1112 1013 991 885 831 847 786 725 746 679 608 655 616 606 602 626 651 724 649 649 694 644 624 661 612 558 533
495 500 423 395 375 372 391 396 405 428 429 523 562 607 653 672 708 633 668 645 632 591 559 597 625 739 710 729 720 636
581 428 292 162 98 54
"""


@dataclass(frozen=True)
class Problem:
    """A sum of squares, its start and its published minima.

    Attributes:
        name: Of the problem; a number at its end is that of unknowns.
        term: All residuals, on the block ``"x"`` of width one.
        start: (n,) the published start.
        minima: Published minima of the SUM OF SQUARES, twice the merit, and other local minima known to be so; one of
            them is reached from the published start.
        minimiser: (n,) where the first minimum lies, if that is published with all its digits.
        scaled_starts: Multiples of the start from which the problem is solved too.
        at_infinity: Limits of the sum of squares along paths to infinity that attract iterations from far starts.
    """

    name: str
    term: ElementTerm
    start: Tensor
    minima: tuple[float, ...]
    minimiser: Tensor | None = None
    scaled_starts: tuple[int, ...] = (1,)
    at_infinity: tuple[float, ...] = ()

    def scaled_start(self, factor: int) -> dict[str, Tensor]:
        """The block at ``factor`` times the start; a start at zero (Watson) becomes the constant vector ``factor``."""
        moved = torch.full_like(self.start, factor) if factor > 1 and not self.start.any() else factor * self.start
        return {"x": moved[:, None]}

    def residuals(self, x: Tensor) -> Tensor:
        """All residuals at unknowns (n,)."""
        return self.term.values(self.term.arguments({"x": x[:, None]})).reshape(-1)


def problem(
    name: str,
    residual: Callable[..., Tensor],
    start: Tensor | list[float],
    minima: list[float],
    *,
    data: tuple[Tensor, ...] = (),
    minimiser: list[float] | None = None,
    multiples: tuple[int, ...] = (1, 10, 100),
    at_infinity: tuple[float, ...] = (),
) -> Problem:
    """Every unknown is a row of width one; the residual sees them as a vector."""
    first = torch.as_tensor(start, dtype=torch.float64)
    stencil = [("x", torch.arange(len(first)).repeat(len(data[0]) if data else 1, 1))]
    term = ElementTerm(name, lambda x, *row: residual(x[:, 0], *row), stencil, data=data)
    where = None if minimiser is None else torch.tensor(minimiser, dtype=torch.float64)
    return Problem(name, term, first, tuple(minima), where, multiples, at_infinity)


def table(*rows: list[float]) -> tuple[Tensor, ...]:
    return tuple(torch.tensor(row, dtype=torch.float64) for row in rows)


def thousandths(text: str) -> Tensor:
    return torch.tensor([int(word) for word in text.split()], dtype=torch.float64) / 1000


def steps(size: float, number: int, first: int = 1) -> Tensor:
    return size * of.count(first + number - 1, first)


def interior(n: int) -> Tensor:
    return of.count(n) / (n + 1)


PROBLEMS = [
    problem("rosenbrock", of.rosenbrock, [-1.2, 1.0], [0.0], minimiser=[1.0, 1.0]),
    problem("freudenstein_roth", of.freudenstein_roth, [0.5, -2.0], [48.98425, 0.0]),
    problem("powell_badly_scaled", of.powell_badly_scaled, [0.0, 1.0], [0.0], multiples=(1, 10)),
    problem("brown_badly_scaled", of.brown_badly_scaled, [1.0, 1.0], [0.0], minimiser=[1e6, 2e-6]),
    problem("beale", of.beale, [1.0, 1.0], [0.0], minimiser=[3.0, 0.5], multiples=(1,)),
    problem("jennrich_sampson", of.jennrich_sampson, [0.3, 0.4], [124.3622], data=(steps(1, 10),), multiples=(1,)),
    problem("helical_valley", of.helical_valley, [-1.0, 0.0, 0.0], [0.0], minimiser=[1.0, 0.0, 0.0]),
    problem("bard", of.bard, [1.0] * 3, [8.214877e-3], data=(steps(1, 15), *table(BARD)), at_infinity=(17.4286,)),
    problem(
        "gaussian",
        of.gaussian,
        [0.4, 1.0, 0.0],
        [1.127933e-8, NARROW_GAUSSIAN, SINGLE_GAUSSIAN],
        data=(steps(-0.5, 15, -7), *table(GAUSSIAN + GAUSSIAN[-2::-1])),
    ),
    problem(
        "meyer", of.meyer, [0.02, 4000.0, 250.0], [87.94585], data=(45 + steps(5, 16), *table(MEYER)), multiples=(1, 10)
    ),
    problem(
        "gulf", of.gulf, [5.0, 2.5, 0.15], [0.0], data=(steps(0.01, 99),), minimiser=[50.0, 25.0, 1.5], multiples=(1,)
    ),
    problem("box", of.box, [0.0, 10.0, 20.0], [0.0], data=(steps(0.1, 10),), at_infinity=(0.07558874,)),
    problem("powell_singular", of.powell_singular, [3.0, -1.0, 0.0, 1.0], [0.0]),
    problem("wood", of.wood, [-3.0, -1.0, -3.0, -1.0], [0.0], minimiser=[1.0] * 4),
    problem(
        "kowalik_osborne",
        of.kowalik_osborne,
        [0.25, 0.39, 0.415, 0.39],
        [3.075056e-4],
        data=table(*KOWALIK_OSBORNE),
        at_infinity=(1.027341e-3,),
    ),
    problem("brown_dennis", of.brown_dennis, [25.0, 5.0, -5.0, -1.0], [85822.20], data=(steps(0.2, 20),)),
    problem(
        "osborne_1",
        of.osborne_1,
        [0.5, 1.5, -1.0, 0.01, 0.02],
        [5.464895e-5],
        data=(steps(10, 33, 0), thousandths(OSBORNE_1)),
    ),
    problem("biggs", of.biggs, [1.0, 2.0, 1.0, 1.0, 1.0, 1.0], [5.655650e-3, 0.0, 0.3063668], data=(steps(0.1, 13),)),
    problem(
        "osborne_2",
        of.osborne_2,
        [1.3, 0.65, 0.65, 0.7, 0.6, 3.0, 5.0, 7.0, 2.0, 4.5, 5.5],
        [4.013774e-2, 1.789814],
        data=(steps(0.1, 65, 0), thousandths(OSBORNE_2)),
    ),
    problem("watson_6", of.watson, [0.0] * 6, [2.287670e-3]),
    problem("watson_9", of.watson, [0.0] * 9, [1.399760e-6]),
    problem("watson_12", of.watson, [0.0] * 12, [4.722381e-10]),
    problem("rosenbrock_10", of.rosenbrock, [-1.2, 1.0] * 5, [0.0], minimiser=[1.0] * 10),
    problem("powell_singular_12", of.powell_singular, [3.0, -1.0, 0.0, 1.0] * 3, [0.0]),
    problem("penalty_1_4", of.penalty_1, of.count(4), [2.249978e-5]),
    problem("penalty_1_10", of.penalty_1, of.count(10), [7.087651e-5]),
    problem("penalty_2_4", of.penalty_2, [0.5] * 4, [9.376293e-6]),
    problem("penalty_2_10", of.penalty_2, [0.5] * 10, [2.936605e-4]),
    problem("variably_dimensioned_10", of.variably_dimensioned, 1 - of.count(10) / 10, [0.0], minimiser=[1.0] * 10),
    problem("trigonometric_10", of.trigonometric, [0.1] * 10, [2.795062e-5, 0.0, 4.218634e-5, 8.788225e-4]),
    *(
        problem(f"brown_almost_linear_{n}", of.brown_almost_linear, [0.5] * n, [0.0, 1.0], multiples=multiples)
        for n, multiples in ((10, (1, 10, 100)), (30, (1,)), (40, (1,)))
    ),
    problem("boundary_value_10", of.boundary_value, interior(10) * (interior(10) - 1), [0.0]),
    problem("integral_equation_10", of.integral_equation, interior(10) * (interior(10) - 1), [0.0]),
    problem("broyden_tridiagonal_10", of.broyden_tridiagonal, [-1.0] * 10, [0.0]),
    problem("broyden_banded_10", of.broyden_banded, [-1.0] * 10, [0.0]),
    problem("linear_full_rank", of.linear_full_rank, [1.0] * 5, [5.0], minimiser=[-1.0] * 5),
    problem("linear_rank_1", of.linear_rank_1, [1.0] * 5, [10 * 9 / (2 * 21)]),
    problem("linear_rank_1_zeros", of.linear_rank_1_zeros, [1.0] * 5, [(100 + 30 - 6) / (2 * 17)]),
    problem("chebyquad_8", of.chebyquad, interior(8), [3.516874e-3], multiples=(1,)),
    problem("chebyquad_9", of.chebyquad, interior(9), [0.0], multiples=(1,)),
    problem("chebyquad_10", of.chebyquad, interior(10), [6.503955e-3], multiples=(1,)),
]
