"""Guided projection of many starts at once: one system with the block structure of the members."""

from __future__ import annotations

from torch import Tensor

from .._interrupts import Interrupts, deferred_interrupts
from ..settings.projection_settings import ProjectionSettings
from .evaluate import culprit, residual_tables
from .layout import State
from .problem import Problem
from .result import IterationRecord, ProjectionResult, Status, TermResidual, message_of
from .state import ProjectionState
from .steps import init, of_members, record_of, step
from .stopwatch import Stopwatch
from .unbegun import unbegun

_LEAVE = 0.5  # share of finished members at which the others go on without them


class BatchRun:
    """Runs of all members of a batch; make it, call :meth:`results` once.

    Damping, acceptance and convergence are those of each member; linear systems are solved and elements evaluated
    together. Members that have finished stay as they are; once they are half of those in the system, it is made anew
    without them.

    Args:
        problem: Of one member.
        blocks: ``(batch, n, d)``.
        settings: For every member; the time limit is that of all together.
    """

    def __init__(self, problem: Problem, blocks: State, settings: ProjectionSettings) -> None:
        self._watch, self._single, self._settings = Stopwatch(), problem, settings
        count = next(iter(blocks.values())).shape[0]
        self._members = list(range(count))  # of the system, by their numbers in the batch
        self._problem = problem.batched(count)
        self._blocks = {name: block.flatten(0, 1) for name, block in blocks.items()}
        self._histories: list[list[IterationRecord]] = [[] for _ in range(count)]
        self._results: dict[int, ProjectionResult] = {}

    def results(self) -> list[ProjectionResult]:
        """One for each member, in order. Ctrl-C ends those that are not yet at their end."""
        with deferred_interrupts() as interrupts:
            try:
                state = interrupts.interruptible(init, self._problem, self._blocks, self._settings)
            except KeyboardInterrupt:
                return unbegun(self._problem, self._blocks, self._watch)
            self._begin(state)
            try:
                self._loop(interrupts)
            except KeyboardInterrupt:
                self._retire(Status.INTERRUPTED)
        return [self._results[member] for member in range(len(self._histories))]

    def _begin(self, state: ProjectionState) -> None:
        self._state = state
        self._start = self._tables()
        self._note({})

    def _loop(self, interrupts: Interrupts) -> None:
        while self._going():
            late = self._settings.time_limit is not None and self._watch.elapsed > self._settings.time_limit
            if late:
                self._retire(Status.TIME_LIMIT)
                break
            if len(self._going()) <= _LEAVE * len(self._members):
                self._leave(interrupts)
            self._state, record = interrupts.interruptible(step, self._problem, self._state)
            self._note(record.timings)

    def _going(self) -> list[int]:
        """Places in the system of members that are not at their end."""
        return [place for place, member in enumerate(self._members) if member not in self._results]

    def _leave(self, interrupts: Interrupts) -> None:
        places = self._going()
        self._problem, self._state = interrupts.interruptible(of_members, self._single, self._state, places)
        self._members = [self._members[place] for place in places]

    def _note(self, timings: dict[str, float]) -> None:
        """Records of the last step; results of members that it ended."""
        for place in self._going():
            if self._state.courses[place].status is not Status.SINGULAR:  # that was no step
                self._histories[self._members[place]].append(record_of(self._state, place, timings=timings))
        self._retire(None)

    def _retire(self, status: Status | None) -> None:
        """Results of members that have finished, or of all with a status that is given."""
        courses = self._state.courses
        ends = {place: courses[place].finished(self._settings) or status for place in self._going()}
        if not any(ends.values()):
            return
        tables, layout = self._tables(), self._problem.layout
        views = {name: block.view(layout.members, -1, block.shape[1]) for name, block in self._state.blocks.items()}
        for place, end in ends.items():
            if end is not None:
                blocks = {name: view[place].clone() for name, view in views.items()}
                self._results[self._members[place]] = self._result(self._members[place], end, blocks, tables[place])

    def _result(
        self, member: int, status: Status, blocks: dict[str, Tensor], table: list[TermResidual]
    ) -> ProjectionResult:
        detail = culprit(self._single.structure, blocks) if status is Status.SINGULAR else ""
        return ProjectionResult(
            blocks=blocks,
            status=status,
            message=message_of(status, self._histories[member], detail),
            residuals=table,
            initial_residuals=self._start[member],
            history=self._histories[member],
            solver=self._problem.solver.name,
            timings={"total": self._watch.elapsed},
        )

    def _tables(self) -> list[list[TermResidual]]:
        return residual_tables(self._problem.structure, self._problem.terms, self._state.evaluation)
