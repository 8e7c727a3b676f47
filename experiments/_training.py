"""The training loop that experiments share: logged losses, checkpoints, interruption and resumption.

A script brings a module, the named terms of its loss and a validation; see ``train_height_field.py``. Each run writes

* ``NAME.jsonl``: one JSON object per logged step: losses before the step, validation after it, learning rate, seconds;
* ``NAME_best.pt``: the state with the lowest validation so far, for ``load_state_dict``;
* ``NAME_last.pt``: everything needed to go on from the last logged step with ``--resume``.

Ctrl-C ends the training and keeps the best state. A resumed run gives the same numbers as one that was not
interrupted: the learning rate depends on the step alone, and random generators are part of the checkpoint.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import torch
from _common import ExperimentConfig, Results, setting
from torch import Tensor, nn

from torchfair import TorchfairError
from torchfair.io import atomic_write_text

Record = dict[str, float]
BOOKKEEPING = ("output", "force", "resume", "threads", "width")
"""Settings that may differ when a run is resumed."""


@dataclass(frozen=True)
class TrainingConfig(ExperimentConfig):
    """Settings of every training script."""

    steps: int = setting(1000, "optimiser steps", least=1)
    learning_rate: float = setting(0.01, "of Adam at the start; falls to 0 like half a cosine wave", least=0)
    log_every: int = setting(25, "steps between log lines, validations and checkpoints", least=1)
    resume: bool = setting(False, "go on from the checkpoint in the output folder, if there is one")
    device: str = setting("cpu", "torch device")
    dtype: str = setting("float32", "precision", choices=("float32", "float64"))

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
        return {"device": torch.device(self.device), "dtype": getattr(torch, self.dtype)}

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
        seconds: of this run; what was done before it was resumed is not counted.
    """

    records: list[Record] = field(default_factory=list)
    best: Record = field(default_factory=lambda: {"validation": math.inf})
    interrupted: bool = False
    seconds: float = 0.0


def training_files(name: str) -> list[str]:
    """Names of the files that :func:`train` writes."""
    return [f"{name}.jsonl", f"{name}_best.pt", f"{name}_last.pt"]


def train(
    model: nn.Module,
    terms: Callable[[], dict[str, Tensor]],
    validate: Callable[[], dict[str, float]],
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
        generator: the only source of randomness in ``terms``.

    Raises:
        TorchfairError: if the loss is not finite, or a checkpoint does not fit the settings.
    """
    optimiser = torch.optim.Adam(model.parameters(), lr=config.learning_rate)
    run = _Run(model, optimiser, generator, name, config, results)
    start = run.resume() if config.resume else run.begin()
    begin = time.perf_counter()
    try:
        for step in range(start, config.steps):
            for group in optimiser.param_groups:
                group["lr"] = config.rate(step)
            optimiser.zero_grad(set_to_none=True)
            values = terms()
            values["loss"].backward()
            optimiser.step()
            if (step + 1) % config.log_every == 0 or step + 1 == config.steps:
                run.log(step + 1, values, validate, time.perf_counter() - begin)
    except KeyboardInterrupt:
        run.training.interrupted = True
        print(f"{name}: interrupted; the best state so far is kept, --resume goes on")
    run.training.seconds = time.perf_counter() - begin
    run.restore_best()
    return run.training


class _Run:
    """Log and checkpoints of one training."""

    def __init__(
        self,
        model: nn.Module,
        optimiser: torch.optim.Optimizer,
        generator: torch.Generator,
        name: str,
        config: TrainingConfig,
        results: Results,
    ) -> None:
        self.model, self.optimiser, self.generator = model, optimiser, generator
        self.name, self.config, self.results = name, config, results
        self.training = Training()
        self.log_path, self.best_path, self.last_path = (results.path(file) for file in training_files(name))

    def begin(self) -> int:
        """Starts with an empty log and without checkpoints."""
        self._write_log()
        for path in (self.best_path, self.last_path):
            path.unlink(missing_ok=True)
        return 0

    def resume(self) -> int:
        """Takes up the last checkpoint and returns the step to go on with."""
        if not self.last_path.exists():
            return self.begin()
        state = self._load(self.last_path)
        ours, theirs = self.config.identity(), state["settings"]
        differing = sorted(key for key in ours if _listed(ours[key]) != _listed(theirs.get(key)))
        if differing:
            raise TorchfairError(
                f"{self.last_path} was made with other settings ({', '.join(differing)}). Resume with the same ones, "
                "or start again with --force and without --resume."
            )
        self.model.load_state_dict(state["model"])
        self.optimiser.load_state_dict(state["optimiser"])
        self.generator.set_state(state["generator"])
        self.training.records, self.training.best = state["records"], state["best"]
        self._write_log()
        return int(state["step"])

    def log(
        self, step: int, values: Mapping[str, Tensor], validate: Callable[[], dict[str, float]], seconds: float
    ) -> None:
        """One line in the log and on the screen, then the checkpoints."""
        record: Record = {"step": step, **{key: float(value.detach()) for key, value in values.items()}}
        if not math.isfinite(record["loss"]):
            raise TorchfairError(f"{self.name}: the loss is not finite at step {step}. Lower --learning-rate.")
        with torch.no_grad():
            record |= validate()
        record |= {"learning_rate": self.config.rate(step - 1), "seconds": seconds}
        self.training.records.append(record)
        with self.log_path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(record) + "\n")
        shown = "  ".join(f"{key} {value:.4g}" for key, value in record.items() if key not in ("step", "learning_rate"))
        print(f"{self.name} {step}/{self.config.steps}  {shown}", flush=True)
        if record["validation"] < self.training.best["validation"]:
            self.training.best = record
            self.results.state(self.best_path.name, self.model.state_dict(), overwrite=True)
        self._checkpoint(step)

    def _checkpoint(self, step: int) -> None:
        state = {
            "step": step,
            "model": self.model.state_dict(),
            "optimiser": self.optimiser.state_dict(),
            "generator": self.generator.get_state(),
            "records": self.training.records,
            "best": self.training.best,
            "settings": self.config.identity(),
        }
        self.results.state(self.last_path.name, state, overwrite=True)

    def restore_best(self) -> None:
        """Puts the best state into the model, if there is one."""
        if self.best_path.exists():
            self.model.load_state_dict(self._load(self.best_path))

    def _write_log(self) -> None:
        text = "".join(json.dumps(record) + "\n" for record in self.training.records)
        atomic_write_text(self.log_path, text, overwrite=True)

    def _load(self, path: Path) -> dict[str, Any]:
        try:
            state: dict[str, Any] = torch.load(path, map_location=self.config.device, weights_only=True)
        except Exception as error:  # torch raises all kinds of errors for files that are not its own
            raise TorchfairError(
                f"{path} is no checkpoint ({type(error).__name__}). Start again with --force."
            ) from None
        if "generator" in state:
            state["generator"] = state["generator"].cpu()
        return state


def _listed(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value
