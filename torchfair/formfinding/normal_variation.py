"""Smoother meshes near a reference surface: lowers E by sliding vertices (paper section 5.1)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor

from .._interrupts import deferred_interrupts
from ..normalisation import Normalisation
from ..projection import Callback, ProjectionResult
from ..projection.layout import State
from ..topology import Topology
from .checks import one_start
from .fair_problem import FairProblem
from .fair_report import fair_measures
from .fair_stages import FairStages
from .handles import read_handles
from .settings import FairSettings
from .stopping import interrupted

Mesh = tuple[Tensor, Topology]

_HANDLE_REACHED = 0.05  # mean edge lengths


@dataclass(frozen=True)
class FairResult:
    """A mesh of lower E.

    Attributes:
        vertices: (V, 3) in the unit and dtype of the input.
        projection: Status, history and residual table of the iteration, in normalised units
            (energies in the history are in the unit of the input).
        preparation: Earlier stages: with a blunter absolute value, and where handles travel far or faces have to
            become planar, with constraints imposed step by step. The merit falls within each stage.
        before, after: Energies and the quantities that the job guarantees, see ``fair_measures``.
        notes: What the job decided on its own, in words.
    """

    vertices: Tensor
    projection: ProjectionResult
    preparation: list[ProjectionResult]
    before: dict[str, float]
    after: dict[str, float]
    notes: list[str]


def minimise_normal_variation(
    vertices: Tensor,
    topology: Topology,
    *,
    reference: Mesh | None = None,
    handles: Mapping[int, Sequence[float]] | None = None,
    settings: FairSettings | None = None,
    callback: Callback | None = None,
) -> FairResult:
    """Moves vertices along a reference surface so that E = sum l l* becomes small.

    Works on triangle, quad and hybrid polygon meshes, with or without boundary. Guarantees at every step:
    the merit never increases, nor does E above its start (unless handles, another reference or planarity
    ask for a different shape); no vertex goes farther from the reference surface than
    ``settings.distance_limit`` (gliding boundary vertices are on smooth curves through the boundary, which bulge over
    its chords); no corner angle and no face area falls below its bound; no face flips. The
    problem is solved centred and with unit mean edge length, so results do not depend on the unit.

    Args:
        vertices: (V, 3).
        topology: Connectivity; it does not change.
        reference: Surface to stay close to, by default the input itself. Vertices that start farther from
            it than the limit may not go farther away than they are.
        handles: Targets by vertex number. Where a target is farther from the reference surface than the
            limit, the reference is given up (design mode, paper Fig. 12) and a note says so.
        settings: Weights, bounds and tolerances.
        callback: Called with every iteration record, whose quantities hold ``normal_variation``; returning
            True stops. Ctrl-C, or a function that raises KeyboardInterrupt, returns the best mesh so far.

    Raises:
        ShapeError: vertices are not ``(V, 3)``, or a handle is not a point.
        MeshError: vertices are not finite, a face has no area, or a handle is no vertex.
    """
    with deferred_interrupts() as interrupts:
        job = interrupts.insist(_Job.of, vertices, topology, reference, handles, settings or FairSettings())
        runs, cut = interrupts.collect(lambda: FairStages(job.problem, callback, job.observe))
        if cut:
            runs[-1] = interrupted(runs[-1])
        return interrupts.insist(job.result, vertices, runs)


class _Job(NamedTuple):
    """The job with its problem in normalised units; ``start`` is in those of the input."""

    start: Tensor
    topology: Topology
    normalisation: Normalisation
    problem: FairProblem

    @classmethod
    def of(
        cls,
        vertices: Tensor,
        topology: Topology,
        reference: Mesh | None,
        handles: Mapping[int, Sequence[float]] | None,
        settings: FairSettings,
    ) -> _Job:
        start, topology = one_start(vertices, topology), topology.to("cpu")
        normalisation = Normalisation.of(start, topology)
        pulled, targets = read_handles(handles or {}, topology)
        problem = FairProblem(
            normalisation.apply(start),
            topology,
            None
            if reference is None
            else (normalisation.apply(reference[0].detach().to("cpu", torch.float64)), reference[1]),
            dict(zip(pulled.tolist(), normalisation.apply(targets), strict=True)),
            settings,
        )
        return cls(start, topology, normalisation, problem)

    def observe(self, state: State) -> dict[str, float]:
        """What the history holds."""
        return {"normal_variation": self.normalisation.length * self.problem.guard.energy(state)}

    def result(self, vertices: Tensor, runs: list[ProjectionResult]) -> FairResult:
        """The mesh after all runs, in the dtype and on the device of the input ``vertices``, and its measures."""
        start, topology, normalisation, problem = self
        state = problem.placed(runs[-1].blocks)
        moved = torch.where(problem.fixed["vertices"], start, normalisation.invert(state))
        after = fair_measures(moved, start, topology, problem, normalisation)
        notes = list(problem.notes)
        if after["largest_handle_distance"] > _HANDLE_REACHED * normalisation.length:
            notes.append(
                f"a handle ends {after['largest_handle_distance']:.3g} from its target: faces would become too small "
                "or too thin; allow smaller angles and areas, or pull less"
            )
        return FairResult(
            vertices=moved.to(vertices),
            projection=runs[-1],
            preparation=runs[:-1],
            before=fair_measures(start, start, topology, problem, normalisation),
            after=after,
            notes=notes,
        )
