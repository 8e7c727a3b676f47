"""The training loop that experiments share: logged losses, checkpoints, interruption, resumption, several processes.

A script brings a module, the named terms of its loss and a validation; see ``train_height_field.py``. Each run writes

* ``NAME.jsonl``: one JSON object per logged step: losses before the step, validation after it, learning rate, seconds;
* ``NAME_best.pt``: the state with the lowest validation so far, for ``load_state_dict``;
* ``NAME_last.pt``: everything needed to go on from where it stopped with ``--resume``;
* ``NAME_events/``: the same for TensorBoard, where that is installed.

Ctrl-C ends the training, keeps the best state and a checkpoint of the last whole step. A resumed run gives the same
numbers as one that was not interrupted: the learning rate depends on the step alone, and random generators are part of
the checkpoint. With more ``--steps`` than before it goes on from the end, at the rates of the longer course.

``torchrun --nproc-per-node 2 experiments/NAME.py`` trains with the mean of the gradients of all processes, each of
which draws its own batches; the first one validates, logs and writes.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import torch
from _common import ExperimentConfig, Results, setting
from _processes import Processes
from _training_log import EventLog, checked_state
from torch import Tensor, nn

from torchfair import TorchfairError
from torchfair.io import atomic_write_text

Record = dict[str, float]
Terms = Callable[[], dict[str, Tensor]]
Validation = Callable[[], dict[str, float]]
BOOKKEEPING = ("output", "force", "resume", "threads", "width", "steps", "patience", "tensorboard")
"""Settings that may differ when a run is resumed."""


@dataclass(frozen=True)
class TrainingConfig(ExperimentConfig):
    """Settings of every training script."""

    steps: int = setting(1000, "optimiser steps", least=1)
    learning_rate: float = setting(0.01, "of Adam at the start; falls to 0 like half a cosine wave", least=0)
    log_every: int = setting(25, "steps between log lines, validations and checkpoints", least=1)
    patience: int = setting(0, "stop after so many validations without a better one, 0 for never", least=0)
    clip: float = setting(0.0, "largest norm of the gradient, 0 for any", least=0)
    resume: bool = setting(False, "go on from the checkpoint in the output folder, if there is one")
    tensorboard: bool = setting(True, "write events for TensorBoard, if that is installed")
    device: str = setting("cpu", "torch device")
    dtype: str = setting(
        "float32", "precision; bfloat16 is that of matrix products only (autocast)",
        choices=("float32", "float64", "bfloat16"),
    )  # fmt: skip

    @property
    def replaces(self) -> bool:
        """Whether results that are there already may be replaced."""
        return self.force or self.resume

    @property
    def place(self) -> dict[str, Any]:
        """``device`` and ``dtype`` as arguments for ``.to(**place)`` and tensor factories.

        Raises:
            TorchfairError: if there is no such device.
        """
        try:
            torch.empty(0, device=self.device)
        except (RuntimeError, AssertionError) as error:
            raise TorchfairError(f"--device {self.device} cannot be used: {str(error).splitlines()[0]}") from None
        dtype = "float32" if self.dtype == "bfloat16" else self.dtype
        return {"device": torch.device(self.device), "dtype": getattr(torch, dtype)}

    def autocast(self) -> torch.autocast:
        """What terms and validations are computed in."""
        return torch.autocast(torch.device(self.device).type, torch.bfloat16, enabled=self.dtype == "bfloat16")

    def rate(self, step: int) -> float:
        """Learning rate of a step, counted from 0."""
        return self.learning_rate * 0.5 * (1 + math.cos(math.pi * step / self.steps))

    def identity(self) -> dict[str, Any]:
        """The settings that a checkpoint must share with the run that resumes it."""
        return {key: value for key, value in asdict(self).items() if key not in BOOKKEEPING}


@dataclass
class Training:
    """How a training went.

    Attributes:
        records: one per logged step.
        best: the one with the lowest ``validation``.
        interrupted: whether Ctrl-C ended it.
        stopped_early: whether ``patience`` ended it.
        seconds: of this run; what was done before it was resumed is not counted.
    """

    records: list[Record] = field(default_factory=list)
    best: Record = field(default_factory=lambda: {"validation": math.inf})
    interrupted: bool = False
    stopped_early: bool = False
    seconds: float = 0.0


def training_files(name: str) -> list[str]:
    """Names of the files that :func:`train` writes."""
    return [f"{name}.jsonl", f"{name}_best.pt", f"{name}_last.pt"]


def train(
    model: nn.Module,
    terms: Terms,
    validate: Validation,
    *,
    name: str,
    config: TrainingConfig,
    results: Results,
    generator: torch.Generator,
) -> Training:
    """Trains ``model`` with Adam and leaves it in its best state.

    Args:
        model: its parameters are trained.
        terms: named scalar tensors of one step; ``"loss"`` is minimised, the others are only logged.
        validate: named numbers of the present state, called without gradients; the smaller ``"validation"`` the
            better the state.
        name: of the run, for its files and log lines.
        config: steps, rates, and whether to resume.
        results: the output folder.
        generator: the only source of randomness in ``terms``; each process after the first gets another seed.

    Raises:
        TorchfairError: if the loss is not finite, or a checkpoint does not fit the settings.
    """
    with Processes.of_torchrun() as processes:
        processes.share(model)
        if processes.rank:
            generator.manual_seed(generator.initial_seed() + processes.rank)
        run = _Run(model, terms, validate, name, config, results, generator, processes)
        return run.whole()


class _Run:
    """One training: its steps, log and checkpoints."""

    def __init__(
        self, model: nn.Module, terms: Terms, validate: Validation, name: str, config: TrainingConfig,
        results: Results, generator: torch.Generator, processes: Processes,
    ) -> None:  # fmt: skip
        self.model, self.terms, self.validate, self.generator = model, terms, validate, generator
        self.name, self.config, self.results, self.processes = name, config, results, processes
        self.optimiser = torch.optim.Adam(model.parameters(), lr=config.learning_rate)
        self.training = Training()
        self.log_path, self.best_path, self.last_path = (results.path(file) for file in training_files(name))
        self.events = EventLog(results.folder / f"{name}_events", config.tensorboard and not processes.rank)
        self.before: tuple[int, Tensor] | None = None  # steps done and the generator then; None inside a step of Adam

    def whole(self) -> Training:
        """All steps, up to the end, to Ctrl-C or until patience is lost."""
        start = self.resume() if self.config.resume else self.begin()
        begin = time.perf_counter()
        try:
            for step in range(start, self.config.steps):
                values = self.step(step)
                if (step + 1) % self.config.log_every == 0 or step + 1 == self.config.steps:
                    self.log(step + 1, values, time.perf_counter() - begin)
                    if self.lost_patience():
                        self.training.stopped_early = True
                        break
        except KeyboardInterrupt:
            self.interrupt()
        self.training.seconds = time.perf_counter() - begin
        self.restore_best()
        self.events.close()
        return self.training

    def step(self, step: int) -> dict[str, Tensor]:
        """One step of Adam; the terms before it."""
        self.before = (step, self.generator.get_state())
        for group in self.optimiser.param_groups:
            group["lr"] = self.config.rate(step)
        self.optimiser.zero_grad(set_to_none=True)
        with self.config.autocast():
            values = self.terms()
        values["loss"].backward()
        self.processes.average_gradients(self.model)
        if self.config.clip:
            nn.utils.clip_grad_norm_(self.model.parameters(), self.config.clip)
        self.before = None
        self.optimiser.step()
        self.before = (step + 1, self.generator.get_state())
        return values

    # ---- going on ------------------------------------------------------------------------------------------

    def begin(self) -> int:
        """Starts with an empty log and without checkpoints."""
        self._write_log()
        for path in (self.best_path, self.last_path):
            path.unlink(missing_ok=True)
        return 0

    def resume(self) -> int:
        """Takes up the last checkpoint and returns the step to go on with."""
        state = self.processes.from_first(lambda: self._load(self.last_path) if self.last_path.exists() else None)
        if state is None:
            return self.begin()
        ours, theirs = self.config.identity(), state["settings"]
        differing = sorted(key for key in ours if _listed(ours[key]) != _listed(theirs.get(key)))
        if differing:
            raise TorchfairError(
                f"{self.last_path} was made with other settings ({', '.join(differing)}). Resume with the same ones, "
                "or start again with --force and without --resume."
            )
        self.model.load_state_dict(state["model"])
        self.optimiser.load_state_dict(state["optimiser"])
        if self.processes.rank < len(state["generators"]):
            self.generator.set_state(state["generators"][self.processes.rank].cpu())
        self.training.records, self.training.best = state["records"], state["best"]
        self._write_log()
        return int(state["step"])

    def interrupt(self) -> None:
        """After Ctrl-C: a checkpoint of the last whole step, by the one process that there is."""
        self.training.interrupted = True
        if self.before is not None and self.processes.count == 1 and self.before[0]:
            step, generator = self.before
            self._checkpoint(step, [generator])
        print(f"{self.name}: interrupted; the best state so far is kept, --resume goes on")

    def lost_patience(self) -> bool:
        """Whether the best validation is too many validations ago, in the first process's opinion."""
        later = [r for r in self.training.records if r["step"] > self.training.best.get("step", 0)]
        lost = bool(self.config.patience) and len(later) >= self.config.patience
        return bool(self.processes.from_first(lambda: lost))

    # ---- logs and files ------------------------------------------------------------------------------------

    def log(self, step: int, values: Mapping[str, Tensor], seconds: float) -> None:
        """One line in the log and on the screen, then the checkpoints."""
        generators = self.processes.gather(self.generator.get_state())
        record: Record = {"step": step, **{key: float(value.detach()) for key, value in values.items()}}
        if not math.isfinite(record["loss"]):
            raise TorchfairError(f"{self.name}: the loss is not finite at step {step}. Lower --learning-rate.")
        if self.processes.rank:
            return
        with torch.no_grad(), self.config.autocast():
            record |= self.validate()
        record |= {"learning_rate": self.config.rate(step - 1), "seconds": seconds}
        self.training.records.append(record)
        self.events.add(record)
        with self.log_path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(record) + "\n")
        shown = "  ".join(f"{key} {value:.4g}" for key, value in record.items() if key not in ("step", "learning_rate"))
        print(f"{self.name} {step}/{self.config.steps}  {shown}", flush=True)
        if record["validation"] < self.training.best["validation"]:
            self.training.best = record
            self.results.state(self.best_path.name, self.model.state_dict(), overwrite=True)
        self._checkpoint(step, generators)

    def _checkpoint(self, step: int, generators: list[Tensor]) -> None:
        state = {
            "step": step,
            "model": self.model.state_dict(),
            "optimiser": self.optimiser.state_dict(),
            "generators": generators,
            "records": self.training.records,
            "best": self.training.best,
            "settings": self.config.identity(),
        }
        self.results.state(self.last_path.name, state, overwrite=True)

    def restore_best(self) -> None:
        """Puts the best state into the model, if there is one."""
        state = self.processes.from_first(lambda: self._load(self.best_path) if self.best_path.exists() else None)
        if state is not None:
            self.model.load_state_dict(state)

    def _write_log(self) -> None:
        text = "".join(json.dumps(record) + "\n" for record in self.training.records)
        atomic_write_text(self.log_path, text, overwrite=True)

    def _load(self, path: Any) -> dict[str, Any]:
        return checked_state(path, self.config.device)


def _listed(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value
