"""A whole job: level after level, interruptible anywhere without losing what was found."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from torch import Tensor

from ..._interrupts import Interrupts, deferred_interrupts
from ...progress import phase
from ...projection import Callback, ProjectionResult
from ..stopping import interrupted, interrupted_at_the_start
from .recipe import Recipe
from .result import JobResult, Level
from .session import Session

_RENEWALS = 4


def solved(
    begin: Callable[[], Recipe[Any]], like: Tensor, *, levels: int = 0, callback: Callback | None = None
) -> JobResult[Any]:
    """Does a job, refines the mesh, and does it again on every level.

    Args:
        begin: Makes the recipe on the coarsest level.
        like: Tensor of the dtype and on the device of the result.
        levels: How often to refine.
        callback: Called with every iteration record; returning True stops. Ctrl-C, or a function that raises
            KeyboardInterrupt, ends the job: what was found until then is returned, on the finest level on which a step
            was taken.
    """
    done: list[Level] = []
    notes: list[str] = []

    def begun() -> Session[Any]:
        with phase("preparing the mesh"):
            return Session(begin(), callback=callback, live=False)

    def finer(session: Session[Any]) -> tuple[Session[Any], dict[str, float], bool] | None:
        """The session on the next level, solved; None if it was interrupted before a step was taken."""
        with phase("refining"):
            result = session.refined()
        before = _before(result)
        ended = result.solve()
        return None if interrupted_at_the_start(result.runs) else (result, before, ended)

    with deferred_interrupts() as interrupts:
        session = interrupts.insist(begun)
        before = interrupts.insist(_before, session)
        stopped = interrupts.insist(session.solve)
        for number in range(levels + 1):
            if number:
                found = interrupts.attempt(finer, session)
                if found is None:
                    stopped, runs = True, done[-1].runs
                    runs[-1] = interrupted(runs[-1])
                    break
                session, before, stopped = found
            recipe = session.recipe
            level = interrupts.insist(_level, session, before, list(session.runs), like)
            if not stopped:
                session, level, stopped = _with_other_faces(session, level, interrupts)
                recipe = session.recipe
            done.append(level)
            said = [*recipe.notes, *(str(promise) for promise in level.promises if not promise.holds)]
            notes += [f"level {number}: {note}" if levels else note for note in said]
            if stopped:
                break
    return JobResult(done, notes, stopped)


def _with_other_faces(session: Session[Any], level: Level, interrupts: Interrupts) -> tuple[Session[Any], Level, bool]:
    """The job with other faces, as long as promises are broken and the recipe has some, and whether it was stopped.

    What keeps most promises is taken, of equals the first; the runs are those of all.
    """
    notes, latest, tried, stopped = session.recipe.notes, session, 0, False
    while not stopped and tried < _RENEWALS and _broken(level):
        recipe = interrupts.insist(latest.recipe.renewed, latest.state)
        if recipe is None:
            break
        latest, tried = Session(recipe, callback=session.callback, live=False), tried + 1
        ended = interrupts.attempt(latest.solve)
        runs = [*level.runs, *latest.runs]
        stopped = ended is not False
        if ended is None:
            runs[-1] = interrupted(runs[-1])
        other = interrupts.insist(_level, latest, level.before, runs, level.vertices)
        session, level = (latest, other) if _broken(other) < _broken(level) else (session, replace(level, runs=runs))
    if tried:
        outcome = "left as they were, others keep no more promises" if session.recipe.notes is notes else "replaced"
        session.recipe.notes = [*notes, f"promises were broken; faces made anew {tried} time(s): {outcome}"]
    return session, level, stopped


def _before(session: Session[Any]) -> dict[str, float]:
    with phase("measuring the start"):
        before: dict[str, float] = session.recipe.before()
    return before


def _level(session: Session[Any], before: dict[str, float], runs: list[ProjectionResult], like: Tensor) -> Level:
    with phase("checking the result"):
        level: Level = session.recipe.level(session.state, before, runs, like)
    return level


def _broken(level: Level) -> int:
    return sum(not promise.holds for promise in level.promises)
