"""What changes from round to round while a principal-symmetric mesh is sought, and what is compiled once."""

from __future__ import annotations

import pytest
import torch
from helpers import DOUBLE

from torchfair.formfinding import Session, SymmetricRecipe, SymmetricSettings
from torchfair.formfinding.job import compiled_problems as module
from torchfair.formfinding.job.plan import Stages
from torchfair.formfinding.symmetric.plan import SymmetricPlan
from torchfair.formfinding.symmetric.problem import Aim
from torchfair.formfinding.symmetric.score import Score
from torchfair.principal import principal_edges_of_lattice
from torchfair.projection import GuidedProjection
from torchfair.shapes import Torus, principal_triangles


def recipe(formulation: str = "spheres") -> SymmetricRecipe:
    mesh = principal_triangles(Torus(2.0, 1.0), 10, 14, along="u")
    edges = principal_edges_of_lattice(mesh, "u")
    return SymmetricRecipe(mesh.vertices, edges, settings=SymmetricSettings(formulation=formulation))


class Rounds(SymmetricPlan):
    """Rounds that do nothing, and come out with the scores given."""

    scores: list[tuple[float, int]]
    seen: list[tuple[float, float]]

    def _round(self, *, first: bool) -> Stages:
        self.seen.append((self._problem.pulls.strength, self._problem.sides.margin))
        yield from ()

    def _score(self) -> Score:
        return Score(*self.scores[len(self.seen) - 1])


def rounds(scores: list[tuple[float, int]], pull: float) -> list[list[float]]:
    """Pulls and margins of all rounds, with a handle that is ``pull`` mean edges away from its target."""
    job = recipe()
    far = job.start[3] + torch.tensor([0.0, 0.0, pull], dtype=DOUBLE)
    job.pull({3: job.unit.invert(far).tolist()})
    work = Rounds(job.problem, job.state(), len(scores))
    work.scores, work.seen = scores, []
    assert not list(work.stages())
    work.best()
    assert job.pulls.strength == 1.0
    return [list(column) for column in zip(*work.seen, strict=True)]


MARGIN = SymmetricSettings().saddle_margin


@pytest.mark.parametrize("pull", [0.2, 2.0])
def test_handles_pull_less_and_less_where_conditions_cannot_be_met(pull: float) -> None:
    pulls, margins = rounds([(1.0, 0)] * 4, pull)
    assert pulls == pytest.approx([1.0, 0.2, 0.04, 0.008])
    assert margins == [MARGIN] * 4


def test_the_margin_of_saddle_sides_widens_where_no_handle_is_to_blame() -> None:
    pulls, margins = rounds([(1.0, 0)] * 3, 0.05)
    assert pulls == [1.0] * 3
    assert margins == pytest.approx([MARGIN, 1.6 * MARGIN, 1.6**2 * MARGIN])


def test_a_few_wrong_saddle_sides_widen_the_margin_and_many_make_handles_yield() -> None:
    met = SymmetricSettings().tolerance
    pulls, margins = rounds([(met, 1)] * 3, 2.0)
    assert pulls == [1.0] * 3
    assert margins == pytest.approx([MARGIN, 1.6 * MARGIN, 1.6**2 * MARGIN])
    pulls, margins = rounds([(met, 50)] * 3, 2.0)  # in the first round they are given a wider margin all the same
    assert pulls == pytest.approx([1.0, 1.0, 0.2])
    assert margins == pytest.approx([MARGIN, 1.6 * MARGIN, 1.6 * MARGIN])


def test_rounds_end_when_all_is_right() -> None:
    met = SymmetricSettings().tolerance
    assert len(rounds([(1.0, 0), (met, 0), (met, 0)], 2.0)[0]) == 2


def test_one_analysis_serves_all_shapes_and_edits(monkeypatch: pytest.MonkeyPatch) -> None:
    """Shapes sought, found and tightened differ in weights; conditions with and without sides are other problems."""
    made: list[int] = []
    monkeypatch.setattr(module, "GuidedProjection", lambda *a, **k: made.append(1) or GuidedProjection(*a, **k))
    session = Session(recipe())
    for stretch in (1.3, 1.1):
        session.move({3: (stretch * session.recipe.given[3]).tolist()})
        session.solve()
        assert len(made) <= 3
    assert len(session.runs) >= 6


def test_other_weights_act_in_the_next_solve() -> None:
    places = []
    for fairness in (1.0, 1e3):
        session = Session(recipe())
        session.move({3: (1.1 * session.recipe.given[3]).tolist()})
        session.solve()
        session.weigh(fairness=fairness)
        session.move({3: (1.15 * session.recipe.given[3]).tolist()})
        session.solve()
        places.append(session.vertices)
    assert not torch.allclose(*places, rtol=0.0, atol=1e-4)


def test_terms_of_the_papers_own_variables_follow_what_stars_are_to_be() -> None:
    """Their slacks belong to saddles only, so that another decision makes another problem."""
    job = recipe("lifted")
    problem, counts = job.problem, []
    noise = torch.randn(problem.base.shape, dtype=DOUBLE, generator=torch.Generator().manual_seed(0))
    for share in (0.0, 0.1):
        problem.sides.decide(problem.base + share * noise)
        stage = problem.stage(job.state(), Aim.SHAPE, job.settings.projection)
        (sides,) = (term for term in stage.terms() if term.name == "saddle side")
        assert stage.anew
        assert sides.num_elements == int(problem.sides.is_saddle.sum())
        counts.append(sides.num_elements)
    assert counts[0] != counts[1]
