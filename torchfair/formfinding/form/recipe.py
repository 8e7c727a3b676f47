"""Surfaces of minimal total absolute curvature with given boundary (paper sections 4 and 5.3)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from ..._interrupts import deferred_interrupts
from ...curves import ClosedCurve
from ...errors import MeshError, ShapeError
from ...normalisation import Normalisation
from ...projection import Callback, ProjectionResult
from ...topology import Topology
from ..checks import one_start, refuse_degenerate_faces
from ..handles import read_handles, refuse_unreachable_handles
from ..stopping import interrupted, stopped
from .boundary_track import BoundaryTrack
from .level import FormJob, FormLevel, Handles
from .measures import form_measures
from .problem import staying_vertices
from .settings import FormSettings


@dataclass(frozen=True)
class FormResult:
    """A surface of low C.

    Attributes:
        vertices: (V', 3) in the unit and dtype of the input.
        topology: of the input, or its refinement.
        stages: Every run of guided projection, in order, in normalised units; the quantity
            ``total_absolute_curvature`` in the history is in the unit of the input. Merits fall within a stage.
        levels: Level of refinement of every stage.
        before, after: Energies and conditions, see ``form_measures``; ``before`` is that of the input.
        notes: What the job decided on its own, in words.
    """

    vertices: Tensor
    topology: Topology
    stages: list[ProjectionResult]
    levels: list[int]
    before: dict[str, float]
    after: dict[str, float]
    notes: list[str]

    @property
    def projection(self) -> ProjectionResult:
        """The last stage."""
        return self.stages[-1]

    @property
    def message(self) -> str:
        """Why the last stage ended."""
        return self.projection.message


def minimise_absolute_curvature(
    vertices: Tensor,
    topology: Topology,
    *,
    curves: Sequence[ClosedCurve] | None = None,
    normals: Tensor | None = None,
    handles: Mapping[int, Sequence[float]] | None = None,
    levels: int = 0,
    settings: FormSettings | None = None,
    callback: Callback | None = None,
) -> FormResult:
    """Moves the vertices of a surface so that C, the integral of ``|k1| + |k2|``, becomes small.

    Boundary vertices keep their places or glide on the boundary curves. With ``levels`` the result is refined
    and improved again: Loop subdivision for triangle meshes, Catmull-Clark for others; new boundary vertices
    lie on the curves. Faces that are not triangles are seen as triangles, cut by diagonals, while C is lowered.
    The merit never increases within a stage. The problem is solved centred and with unit mean edge length, so
    results do not depend on the unit.

    Minimisers are not unique: the start decides, among other things, between a cone and two cones tip to tip.

    Args:
        vertices: (V, 3) start.
        topology: Connectivity, with or without boundary.
        curves: One for each boundary loop, by default smooth curves through its vertices. The boundary is moved
            onto given curves first.
        normals: (V, 3) prescribed normals of the surface at boundary vertices, of any length; zero where none is.
            They point to the side from which faces run counterclockwise.
        handles: Places to pass through, by vertex number.
        levels: How often to refine.
        settings: Weights, smoothing and tolerances.
        callback: Called with every iteration record; returning True stops. Ctrl-C, or a function that
            raises KeyboardInterrupt, returns the best mesh so far, on the finest level on which a step was taken.

    Raises:
        ShapeError: vertices or normals are not ``(V, 3)``, or a handle is not a point.
        MeshError: vertices are not finite, a face has no area, curves do not fit the boundary, or a handle is
            no vertex or pulls a vertex of the boundary that stays.
    """
    settings = settings or FormSettings()
    with deferred_interrupts() as interrupts:
        surface, pulled, before, notes = interrupts.insist(
            _begin, vertices, topology, curves, normals, handles or {}, settings
        )
        job = FormJob(pulled, settings, callback, interrupts)
        surface, stages = interrupts.insist(job.solved, surface)
        stage_levels = [0] * len(stages)
        for level in range(1, levels + 1):
            if stopped(stages[-1]):
                break
            finer = interrupts.attempt(job.solved_finer, surface)
            if finer is None:
                stages[-1] = interrupted(stages[-1])
                break
            surface, runs = finer
            stages += runs
            stage_levels += [level] * len(runs)
        after = interrupts.insist(form_measures, surface.vertices, surface.topology, surface.normals, *pulled)
    return FormResult(surface.vertices.to(vertices), surface.topology, stages, stage_levels, before, after, notes)


def _begin(
    vertices: Tensor,
    topology: Topology,
    curves: Sequence[ClosedCurve] | None,
    normals: Tensor | None,
    handles: Mapping[int, Sequence[float]],
    settings: FormSettings,
) -> tuple[FormLevel, Handles, dict[str, float], list[str]]:
    """The surface to start from, handles, measures and notes."""
    start, topology = one_start(vertices, topology), topology.to("cpu")
    Normalisation.of(start, topology)  # refuses what is not finite or has no extent
    refuse_degenerate_faces(start, topology)
    normals = _unit_normals(normals, topology)
    pulled, targets = read_handles(handles, topology)
    if curves is None:
        track = BoundaryTrack.through(start, topology, settings.corner_angle)
    else:
        track = BoundaryTrack.onto(start, topology, curves)
    current = track.positions(start)
    refuse_unreachable_handles(pulled, targets, current, staying_vertices(topology, track, settings))
    notes = []
    if not topology.is_triangular:
        notes.append("faces with more than three corners are cut into triangles while C is lowered")
    before = form_measures(start, topology, normals, pulled, targets)
    return FormLevel(current, topology, track, normals), (pulled, targets), before, notes


def _unit_normals(normals: Tensor | None, topology: Topology) -> Tensor:
    """(V, 3) unit or zero."""
    if normals is None:
        return torch.zeros(topology.num_vertices, 3, dtype=torch.float64)
    if not isinstance(normals, Tensor) or tuple(normals.shape) != (topology.num_vertices, 3):
        actual = tuple(normals.shape) if isinstance(normals, Tensor) else type(normals).__name__
        raise ShapeError("normals", f"({topology.num_vertices}, 3), zero where none is prescribed", actual)
    given = normals.detach().to("cpu", torch.float64)
    lengths = given.norm(dim=1, keepdim=True)
    if not bool(torch.isfinite(lengths).all()):
        raise MeshError("prescribed normals must be finite; give zeros where none is prescribed")
    inside = torch.nonzero((lengths[:, 0] > 0.0) & ~topology.is_boundary_vertex).squeeze(1).tolist()
    if inside:
        raise MeshError(f"normals are prescribed at boundary vertices only, not at vertices {inside[:5]}")
    return torch.where(lengths > 0.0, given / lengths.clamp_min(1e-300), given)
