"""Surfaces of minimal total absolute curvature with given boundary (paper sections 4 and 5.3)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from ..curves import ClosedCurve
from ..energies import total_absolute_curvature
from ..errors import MeshError, ShapeError
from ..normalisation import Normalisation
from ..projection import Callback, ProjectionResult
from ..subdivision import Refinement, catmull_clark, loop
from ..topology import Topology
from ..triangulation import triangulate
from .boundary_track import BoundaryTrack, new_boundary_vertices
from .checks import one_start, refuse_degenerate_faces
from .form_problem import FormProblem, staying_vertices
from .form_report import form_measures
from .form_settings import FormSettings
from .form_stages import FormStages, stopped
from .handles import read_handles, refuse_unreachable_handles


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
        callback: Called with every iteration record; returning True stops. Ctrl-C returns the best mesh so far.

    Raises:
        ShapeError: vertices or normals are not ``(V, 3)``, or a handle is not a point.
        MeshError: vertices are not finite, a face has no area, curves do not fit the boundary, or a handle is
            no vertex or pulls a vertex of the boundary that stays.
    """
    settings = settings or FormSettings()
    start, topology = one_start(vertices, topology), topology.to("cpu")
    Normalisation.of(start, topology)  # refuses what is not finite or has no extent
    refuse_degenerate_faces(start, topology)
    normals = _unit_normals(normals, topology)
    pulled, targets = read_handles(handles or {}, topology)
    notes: list[str] = []
    if curves is None:
        track = BoundaryTrack.through(start, topology, settings.corner_angle)
    else:
        track = BoundaryTrack.onto(start, topology, curves)
    current = track.positions(start)
    refuse_unreachable_handles(pulled, targets, current, staying_vertices(topology, track, settings))
    before = form_measures(start, topology, normals, pulled, targets)
    if not topology.is_triangular:
        notes.append("faces with more than three corners are cut into triangles while C is lowered")

    stages: list[ProjectionResult] = []
    stage_levels: list[int] = []
    for level in range(levels + 1):
        if level:
            refinement = _refine(topology, track)
            topology = refinement.topology
            normals = _refined_normals(normals, refinement)
            track = track.refined(refinement)
            current = track.positions(refinement.apply(current))
        solved = _solve(current, topology, track, normals, (pulled, targets), settings, callback, nearby=level > 0)
        for moved, run in solved:
            current = moved
            stages.append(run)
            stage_levels.append(level)
        if settings.boundary == "glide":
            track = track.updated(current)
            current = track.positions(current)
        if stopped(stages[-1]):
            break
    after = form_measures(current, topology, normals, pulled, targets)
    return FormResult(current.to(vertices), topology, stages, stage_levels, before, after, notes)


def _solve(
    vertices: Tensor,
    topology: Topology,
    track: BoundaryTrack,
    normals: Tensor,
    handles: tuple[Tensor, Tensor],
    settings: FormSettings,
    callback: Callback | None,
    *,
    nearby: bool,
) -> Iterator[tuple[Tensor, ProjectionResult]]:
    """One level, in units of the input: the vertices after each stage, and the run."""
    triangles = topology
    if not topology.is_triangular:
        triangles = Topology.from_faces(triangulate(vertices, topology).triangles, topology.num_vertices)
    normalisation = Normalisation.of(vertices, topology)
    pulled, targets = handles
    problem = FormProblem(triangles, normalisation, track, normals, pulled, normalisation.apply(targets), settings)

    def observe(state: Tensor) -> dict[str, float]:
        return {"total_absolute_curvature": normalisation.length * float(total_absolute_curvature(state, triangles))}

    stages = FormStages(problem, callback, observe)
    start = normalisation.apply(vertices)
    for moved, run in stages.from_nearby(start) if nearby else stages.from_afar(start):
        yield torch.where(problem.fixed[:, None], vertices, normalisation.invert(moved)), run


def _refine(topology: Topology, track: BoundaryTrack) -> Refinement:
    """Loop or Catmull-Clark; the boundary stays where it is, new vertices are put on the curves afterwards."""
    scheme = loop if topology.is_triangular else catmull_clark
    return scheme(topology, boundary="interpolate", corners=track.corners)


def _refined_normals(normals: Tensor, refinement: Refinement) -> Tensor:
    """Prescribed normals of the finer boundary: a new vertex has the mean of both ends if both are prescribed."""
    ends = normals[refinement.coarse.boundary_edges]
    mean = ends.sum(1)
    given = (ends != 0.0).any(2).all(1) & (mean != 0.0).any(1)
    mean = torch.where(given[:, None], mean / mean.norm(dim=1, keepdim=True), torch.zeros_like(mean))
    result = refinement.carry_vertex_labels(normals)
    result[new_boundary_vertices(refinement)] = mean
    return result


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
