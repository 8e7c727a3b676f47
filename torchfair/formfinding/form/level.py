"""Levels of refinement in the job that lowers C, in units of the input."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import torch
from torch import Tensor

from ..._interrupts import Interrupts
from ...energies import total_absolute_curvature
from ...normalisation import Normalisation
from ...projection import Callback, ProjectionResult
from ...subdivision import Refinement, catmull_clark, loop
from ...topology import Topology
from ...triangulation import triangulate
from ..stopping import interrupted, interrupted_at_the_start
from .boundary_track import BoundaryTrack, new_boundary_vertices
from .problem import FormProblem
from .settings import FormSettings
from .stages import FormStages, Stage

Handles = tuple[Tensor, Tensor]


class FormLevel(NamedTuple):
    """A surface with its conditions at the boundary.

    Attributes:
        vertices: (V, 3).
        topology: Its connectivity.
        track: Its boundary on the curves.
        normals: (V, 3) prescribed unit normals of boundary vertices; zero where none is.
    """

    vertices: Tensor
    topology: Topology
    track: BoundaryTrack
    normals: Tensor

    def refined(self) -> FormLevel:
        """By Loop or Catmull-Clark subdivision; new boundary vertices are put on the curves."""
        scheme = loop if self.topology.is_triangular else catmull_clark
        step = scheme(self.topology, boundary="interpolate", corners=self.track.corners)
        track = self.track.refined(step)
        vertices = track.positions(step.apply(self.vertices))
        return FormLevel(vertices, step.topology, track, _refined_normals(self.normals, step))

    def moved(self, vertices: Tensor, *, glides: bool) -> FormLevel:
        """With other places of vertices, which at the boundary are put on the curves if it glides."""
        if not glides:
            return self._replace(vertices=vertices)
        track = self.track.updated(vertices)
        return self._replace(vertices=track.positions(vertices), track=track)


class FormJob(NamedTuple):
    """What is the same on all levels.

    Attributes:
        handles: Vertices that are pulled (n,), and where to (n, 3).
        settings, callback: Of the job.
        interrupts: Those that wait.
    """

    handles: Handles
    settings: FormSettings
    callback: Callback | None
    interrupts: Interrupts

    def solved(self, surface: FormLevel, *, nearby: bool = False) -> tuple[FormLevel, list[ProjectionResult]]:
        """The surface of lower C, and the runs that led there.

        Args:
            surface: Start.
            nearby: Whether it is the refinement of a solution.
        """
        vertices, topology = surface.vertices, surface.topology
        triangles = topology
        if not topology.is_triangular:
            triangles = Topology.from_faces(triangulate(vertices, topology).triangles, topology.num_vertices)
        unit = Normalisation.of(vertices, topology)
        pulled, targets = self.handles
        problem = FormProblem(
            triangles, unit, surface.track, surface.normals, pulled, unit.apply(targets), self.settings
        )

        def observe(state: Tensor) -> dict[str, float]:
            return {"total_absolute_curvature": unit.length * float(total_absolute_curvature(state, triangles))}

        def begin() -> Iterator[Stage]:
            stages, start = FormStages(problem, self.callback, observe), unit.apply(vertices)
            return stages.from_nearby(start) if nearby else stages.from_afar(start)

        def end(normalised: Tensor) -> FormLevel:
            moved = torch.where(problem.fixed[:, None], vertices, unit.invert(normalised))
            return surface.moved(moved, glides=self.settings.boundary == "glide")

        stages, cut = self.interrupts.collect(begin)
        runs = [run for _, run in stages]
        if cut:
            runs[-1] = interrupted(runs[-1])
        return self.interrupts.insist(end, stages[-1][0]), runs

    def solved_finer(self, surface: FormLevel) -> tuple[FormLevel, list[ProjectionResult]] | None:
        """The same from the refinement of a solution; None if that was interrupted before any step was taken."""
        finer = surface.refined()
        self.interrupts.check()
        solved, runs = self.solved(finer, nearby=True)
        return None if interrupted_at_the_start(runs) else (solved, runs)


def _refined_normals(normals: Tensor, refinement: Refinement) -> Tensor:
    """Prescribed normals of the finer boundary: a new vertex has the mean of both ends if both are prescribed."""
    ends = normals[refinement.coarse.boundary_edges]
    mean = ends.sum(1)
    given = (ends != 0.0).any(2).all(1) & (mean != 0.0).any(1)
    mean = torch.where(given[:, None], mean / mean.norm(dim=1, keepdim=True), torch.zeros_like(mean))
    result = refinement.carry_vertex_labels(normals)
    result[new_boundary_vertices(refinement)] = mean
    return result
