"""Guided projection: Levenberg-Marquardt on element terms, with a merit that never rises."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence

import torch
from torch import Tensor

from ..errors import ShapeError, SingularSystemError, TorchfairError
from .damping import Damping
from .evaluate import first_bad_elements, merit, residual_table
from .layout import Layout, State
from .linear import LinearSolver, choose_solver
from .result import IterationRecord, ProjectionResult, Status
from .settings import ProjectionSettings
from .system import LinearSystem, Structure
from .term import ElementTerm

Callback = Callable[[IterationRecord], object]
Observe = Callable[[State], dict[str, float]]


def guided_projection(
    blocks: State,
    terms: Sequence[ElementTerm],
    *,
    fixed: Mapping[str, Tensor] | None = None,
    settings: ProjectionSettings | None = None,
    callback: Callback | None = None,
    observe: Observe | None = None,
) -> ProjectionResult:
    """Lowers the sum of ``terms`` from ``blocks`` on by damped Gauss-Newton steps.

    Each step solves ``(J^T J + damping * scale) d = -J^T r`` and is taken only if the merit, the sum of the
    true losses of all terms, falls. Constraints are terms with large weights, targets terms with small ones
    (guided projection after Tang et al. 2014; paper section 5.1).

    Args:
        blocks: Start, ``name -> (n, d)``, all of one floating dtype and device. Not modified.
        terms: What is to be small. See :class:`ElementTerm`.
        fixed: Masks ``(n,)`` or ``(n, d)`` by block name, True where an unknown stays as it is.
        settings: Tolerances, damping, linear solver.
        callback: Called with every :class:`IterationRecord`; returning True stops the iteration.
        observe: Named quantities of a state to keep in the history.

    Returns:
        The best state found. Interrupting (Ctrl-C) returns it too, with ``Status.INTERRUPTED``.

    Raises:
        ShapeError: blocks, terms or masks do not fit together.
        TorchfairError: a residual or Jacobian is not finite at the start; names the term and its elements.
    """
    problem = GuidedProjection(blocks, terms, fixed=fixed, solver=(settings or ProjectionSettings()).solver)
    return problem.solve(blocks, settings=settings, callback=callback, observe=observe)


class GuidedProjection:
    """Terms compiled for blocks of given sizes; solves from many starts with one symbolic analysis."""

    def __init__(
        self,
        blocks: State,
        terms: Sequence[ElementTerm],
        *,
        fixed: Mapping[str, Tensor] | None = None,
        solver: str | LinearSolver = "auto",
    ) -> None:
        example = {name: block.detach() for name, block in blocks.items()}
        if not example or not terms:
            raise ShapeError("guided projection", "at least one block and one term", f"{len(example)} and {len(terms)}")
        first = next(iter(example.values()))
        for name, block in example.items():
            if block.dtype != first.dtype or block.device != first.device:
                raise ShapeError(f"block '{name}'", f"{first.dtype} on {first.device}", f"{block.dtype} on {block.device}")
        self.terms = list(terms)
        self.layout = Layout.of(example)
        free = self.layout.free_mask(fixed or {}, first.device)
        self.structure = Structure(self.layout, self.terms, free, first.dtype)
        self.solver = choose_solver(solver, self.structure) if isinstance(solver, str) else solver
        self._prepared = False

    def solve(
        self,
        blocks: State,
        *,
        settings: ProjectionSettings | None = None,
        callback: Callback | None = None,
        observe: Observe | None = None,
    ) -> ProjectionResult:
        """Iterates from ``blocks``; see :func:`guided_projection`."""
        if Layout.of(blocks) != self.layout:
            raise ShapeError("blocks", str(self.layout.sizes), str(Layout.of(blocks).sizes))
        with torch.no_grad():
            return _Iteration(self, blocks, settings or ProjectionSettings(), callback, observe).run()

    def solve_batch(self, blocks: State, *, settings: ProjectionSettings | None = None) -> list[ProjectionResult]:
        """Iterates from every member of blocks ``(batch, n, d)``, one result each."""
        count = {block.shape[0] for block in blocks.values()}
        if len(count) != 1 or any(block.ndim != 3 for block in blocks.values()):
            raise ShapeError("blocks", "(batch, n, d) with one batch size", str([tuple(b.shape) for b in blocks.values()]))
        return [
            self.solve({name: block[i] for name, block in blocks.items()}, settings=settings) for i in range(count.pop())
        ]

    def prepare(self) -> None:
        """Symbolic analysis, once."""
        if not self._prepared:
            self.solver.prepare(self.structure)
            self._prepared = True


class _Iteration:
    """One run: the current state, the damping and the history."""

    def __init__(
        self,
        problem: GuidedProjection,
        blocks: State,
        settings: ProjectionSettings,
        callback: Callback | None,
        observe: Observe | None,
    ) -> None:
        self.problem, self.settings = problem, settings
        self.callback, self.observe = callback, observe
        self.start = time.perf_counter()
        self.timings = {"linearise": 0.0, "solve": 0.0, "merit": 0.0}
        self.state: dict[str, Tensor] = {name: block.detach().clone() for name, block in blocks.items()}
        self.initial_residuals = residual_table(problem.terms, self.state)
        self.merit = self._merit(self.state)
        self.damping = Damping(settings.initial_damping)
        self.accuracy = settings.accuracy
        self.history: list[IterationRecord] = []
        self.recent: list[float] = []

    def run(self) -> ProjectionResult:
        status, detail = Status.MAX_ITERATIONS, ""
        try:
            self._check_start()
            if self._record(0, float("nan"), 0.0, float("nan"), True, 0):
                status = Status.CALLBACK
            elif self.merit == 0.0:
                status = Status.ZERO_MERIT
            else:
                self.problem.prepare()
                status, detail = self._iterate()
        except KeyboardInterrupt:
            status = Status.INTERRUPTED
        return self._result(status, detail)

    def _check_start(self) -> None:
        for block_name, block in self.state.items():
            bad = torch.nonzero(~torch.isfinite(block).all(1)).squeeze(1).tolist()
            if bad:
                raise TorchfairError(f"block '{block_name}' is not finite in rows {bad[:5]}: repair the start")
        if self.merit != float("inf"):
            return
        for term in self.problem.terms:
            bad = first_bad_elements(term, self.state) if term.num_elements and term.weight else []
            if bad:
                raise TorchfairError(
                    f"the residual of term '{term.name}' is not finite at the start, elements {bad[:5]}: "
                    "move the start away from the singular place or leave these elements out"
                )
        raise TorchfairError("the merit is not finite at the start although every residual is: lower the weights")

    def _iterate(self) -> tuple[Status, str]:
        system: LinearSystem | None = None
        for number in range(1, self.settings.max_iterations + 1):
            if self.settings.time_limit is not None and self._elapsed() > self.settings.time_limit:
                return Status.TIME_LIMIT, ""
            if system is None:
                system = self._timed("linearise", lambda: self.problem.structure.linearise(self.state))
            scale = self._scale(system)
            gradient = float((system.gradient.abs() / scale.sqrt()).max())
            if gradient <= self.settings.gradient_tolerance:
                return Status.GRADIENT_TOLERANCE, ""
            outcome = self._try_step(system, scale, number, gradient)
            if outcome is None:
                return Status.SINGULAR, self._culprit(system)
            status, accepted = outcome
            if status is not None:
                return status, ""
            if accepted:
                system = None
        return Status.MAX_ITERATIONS, ""

    def _try_step(
        self, system: LinearSystem, scale: Tensor, number: int, gradient: float
    ) -> tuple[Status | None, bool] | None:
        """One damped step; None where the system is singular at every damping."""
        while True:
            damping = self.damping.value * scale
            try:
                step = self._timed("solve", lambda d=damping: self.problem.solver.solve(system, d, self.accuracy))
                break
            except SingularSystemError:
                if not self.damping.reject():
                    return None
        change = step.change * self.problem.structure.free
        predicted = 0.5 * float(change @ (damping * change - system.gradient + step.remainder))
        flat = self.problem.layout.flatten(self.state)
        trial = self.problem.layout.unflatten(flat + change)
        value = self._merit(trial)
        gain = (self.merit - value) / predicted if predicted > 0.0 else float("-inf")
        accepted = value < self.merit and gain > 1e-4
        used, decrease = self.damping.value, self.merit - value
        size, reach = float(change.abs().max()), float(flat.abs().max())
        if accepted:
            self.state, self.merit = trial, value
            self.damping.accept(gain)
        if self._record(number, used, size, gain, accepted, step.iterations, gradient):
            return Status.CALLBACK, accepted
        if size <= self.settings.step_tolerance * (reach + self.settings.step_tolerance):
            return (Status.STEP_TOLERANCE if accepted else Status.STALLED), accepted
        if accepted:
            return self._settled(decrease), True
        return (None if self.damping.reject() else Status.STALLED), False

    def _settled(self, decrease: float) -> Status | None:
        """Whether the merit has come to rest; tightens the linear solver first where that may help."""
        if self.merit == 0.0:
            return Status.ZERO_MERIT
        relative = decrease / (self.merit + decrease)
        self.recent = [*self.recent, relative][-self.settings.patience :]
        slow = len(self.recent) == self.settings.patience and max(self.recent) < max(
            1e-2 * self.accuracy / self.settings.accuracy, self.settings.merit_tolerance
        )
        iterative = self.problem.solver.name == "conjugate gradients"
        if iterative and slow and self.accuracy > 1e-8:
            self.accuracy *= 0.1
            self.recent = []
            return None
        settled = len(self.recent) == self.settings.patience and max(self.recent) < self.settings.merit_tolerance
        return Status.MERIT_TOLERANCE if settled else None

    def _scale(self, system: LinearSystem) -> Tensor:
        """Positive diagonal that the damping multiplies; one where nothing is felt."""
        diagonal = system.diagonal
        if self.settings.damping_scale == "identity":
            return torch.ones_like(diagonal)
        floor = 1e-12 * float(diagonal.max()) if bool(torch.isfinite(diagonal).all()) else 1.0
        floored = diagonal.clamp_min(floor if floor > 0.0 else 1.0)
        return torch.where(diagonal > 0.0, floored, torch.ones_like(diagonal))

    def _culprit(self, system: LinearSystem) -> str:
        compiled = self.problem.structure.compiled
        sizes = [float(j.abs().max()) if bool(torch.isfinite(j).all()) else float("inf") for j in system.jacobians]
        worst = max(range(len(sizes)), key=sizes.__getitem__)
        bad = first_bad_elements(compiled[worst].term, self.state)
        where = f", not finite at elements {bad[:5]}" if bad else f", largest derivative {sizes[worst]:.3g}"
        return f"term '{compiled[worst].term.name}'{where}"

    def _merit(self, state: State) -> float:
        return self._timed("merit", lambda: merit(self.problem.terms, state))

    def _timed(self, what: str, work: Callable[[], object]) -> object:
        begin = time.perf_counter()
        result = work()
        self.timings[what] += time.perf_counter() - begin
        return result

    def _elapsed(self) -> float:
        return time.perf_counter() - self.start

    def _record(
        self, number: int, damping: float, size: float, gain: float, accepted: bool, inner: int, gradient: float = float("nan")
    ) -> bool:
        if accepted:
            self.quantities = self.observe(self.state) if self.observe else {}
        record = IterationRecord(
            number, self.merit, damping, gain, size, gradient, accepted, inner, self._elapsed(), self.quantities
        )
        self.history.append(record)
        return bool(self.callback(record)) if self.callback else False

    def _result(self, status: Status, detail: str) -> ProjectionResult:
        return ProjectionResult(
            blocks=self.state,
            status=status,
            message=f"{status.value}; {detail}" if detail else status.value,
            residuals=residual_table(self.problem.terms, self.state),
            initial_residuals=self.initial_residuals,
            history=self.history,
            solver=self.problem.solver.name,
            timings={**self.timings, "total": self._elapsed()},
        )
