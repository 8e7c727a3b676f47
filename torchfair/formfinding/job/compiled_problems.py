"""The compiled problems of a session: index maps and analysis are kept from one stage to the next of its name."""

from __future__ import annotations

import copy
from collections.abc import Callable

from ...errors import ShapeError
from ...projection import GuidedProjection
from .plan import Stage


class CompiledProblems:
    """The last problem of every name of a stage, with the version of the terms it was made from."""

    def __init__(self) -> None:
        self._known: dict[str, tuple[object, GuidedProjection]] = {}

    def of(self, stage: Stage) -> GuidedProjection:
        """The problem of a stage, with the index maps and the analysis of the last one of its name.

        Made anew where terms have come or gone, as with a weight that was zero.
        """
        version, problem = self._known.get(stage.name, (None, None))
        if problem is not None and not stage.anew and version != stage.version:
            try:
                problem = problem.with_terms(stage.terms())
            except ShapeError:  # other stencils; what is wrong with the terms is an error below, too
                problem = None
        if problem is None or stage.anew:
            problem = GuidedProjection(stage.blocks, stage.terms(), fixed=stage.fixed, solver=stage.settings.solver)
        else:
            problem = problem.with_fixed(stage.fixed)
        self._known[stage.name] = (stage.version, problem)
        return problem

    def all(self) -> list[GuidedProjection]:
        """The problems, in the order in which their stages came."""
        return [problem for _, problem in self._known.values()]

    def snapshot(self) -> Callable[[], None]:
        """What puts everything back, bit for bit: what solvers carry from one step to the next, too."""
        known = dict(self._known)
        solvers = {name: copy.copy(problem.solver) for name, (_, problem) in known.items()}

        def restore() -> None:
            self._known = dict(known)
            for name, (_, problem) in self._known.items():
                problem.solver = copy.copy(solvers[name])

        return restore

    def clear(self) -> None:
        """Forgets all: what was interrupted while it searched or factorised may not be whole."""
        self._known = {}
