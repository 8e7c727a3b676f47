"""Principal-symmetric triangle meshes: design coarse, refine, design again (paper sections 2.3 and 5.2)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from torch import Tensor

from ..._interrupts import deferred_interrupts
from ...principal import PrincipalEdges
from ...projection import Callback, ProjectionResult
from ...topology import Topology
from ..handles import read_handles
from ..stopping import interrupted, interrupted_at_the_start
from .design import SymmetricDesign
from .settings import SymmetricSettings


@dataclass(frozen=True)
class SymmetricLevel:
    """The mesh of one level of refinement.

    Attributes:
        vertices: (V, 3) in the unit and dtype of the input.
        principal: Its principal edges, and with them its topology.
        normals: (V, 3) unit normals n(v), see :func:`strip_normals`.
        before, after: Measures of success, see
            :func:`~torchfair.formfinding.symmetric_measures`; ``before`` is at the start of the level.
        runs: Runs of guided projection, in order, in normalised units. Merits fall within a run.
    """

    vertices: Tensor
    principal: PrincipalEdges
    normals: Tensor
    before: dict[str, float]
    after: dict[str, float]
    runs: list[ProjectionResult]

    @property
    def steps(self) -> int:
        """Damped steps taken on this level."""
        return sum(run.iterations for run in self.runs)


@dataclass(frozen=True)
class SymmetricResult:
    """Principal-symmetric meshes, from coarse to fine.

    Attributes:
        levels: One for every level; the first has the vertices of the input.
        notes: Decisions taken and conditions missed, in words.
        stopped: Whether Ctrl-C or the callback ended it early; the last level is the best state found,
            or was finished before.
    """

    levels: list[SymmetricLevel]
    notes: list[str]
    stopped: bool

    @property
    def vertices(self) -> Tensor:
        """(V', 3) of the finest level."""
        return self.levels[-1].vertices

    @property
    def topology(self) -> Topology:
        """Of the finest level."""
        return self.levels[-1].principal.topology

    @property
    def principal(self) -> PrincipalEdges:
        """Of the finest level."""
        return self.levels[-1].principal

    @property
    def projection(self) -> ProjectionResult:
        """The last run."""
        return self.levels[-1].runs[-1]

    @property
    def before(self) -> dict[str, float]:
        """Measures of the input."""
        return self.levels[0].before

    @property
    def after(self) -> dict[str, float]:
        """Measures of the finest level."""
        return self.levels[-1].after


def principal_symmetric(
    vertices: Tensor,
    principal: PrincipalEdges,
    *,
    handles: Mapping[int, Sequence[float]] | None = None,
    fixed: Tensor | None = None,
    reference: tuple[Tensor, Topology] | None = None,
    on: Tensor | None = None,
    levels: int = 0,
    settings: SymmetricSettings | None = None,
    callback: Callback | None = None,
) -> SymmetricResult:
    """Makes a triangle mesh principal-symmetric, close to where it starts and through its handles, and refines it.

    At every regular vertex the four neighbours across non-principal edges lie on a sphere through the vertex, along
    principal edges the normals of these spheres and the edge are coplanar, and where the angle sum is above 2 pi the
    star is saddle-shaped. Nothing is asked of singular and boundary vertices. Conditions are met to rounding where
    they can be met; the report says how well.

    Principal edges must run along a principal direction of the surface, and near parabolic curves along that of the
    smaller curvature: stars there cannot be saddle-shaped otherwise.

    Args:
        vertices: (V, 3) start.
        principal: Which edges are principal, with the topology.
        handles: Places by vertex number. They pull their surroundings along; unless the conditions forbid it they
            are reached, but for a hundredth of an edge or so.
        fixed: (V,) bool, vertices that keep their places.
        reference: Vertices and topology of a surface to stay close to.
        on: Vertices where conditions are imposed, such as those of some principal polylines (paper Fig. 14h); by
            default all regular ones. With ``settings.energy_weight`` E is lowered everywhere else.
        levels: How often to refine by Loop subdivision; the labels are carried along.
        settings: Weights and tolerances.
        callback: Called with every iteration record; returning True stops. Ctrl-C returns the best state so far.

    Raises:
        ShapeError: vertices are not ``(V, 3)``, or a handle is not a point.
        MeshError: vertices are not finite, a face has no area, a handle is no vertex or fixed, or no condition can be
            imposed.
    """

    def begin() -> tuple[SymmetricDesign, dict[int, list[float]], dict[str, float]]:
        pulled, targets = read_handles(handles or {}, principal.topology)
        design = SymmetricDesign(
            vertices, principal, handles=pulled.tolist(), fixed=fixed, reference=reference, on=on, settings=settings
        )
        return design, dict(zip(pulled.tolist(), targets.tolist(), strict=True)), design.measures()

    done: list[SymmetricLevel] = []
    notes: list[str] = []
    with deferred_interrupts() as interrupts:
        design, places, before = interrupts.insist(begin)
        stopped = interrupts.insist(design.move, places, callback)
        for level in range(levels + 1):
            if level:
                finer = interrupts.attempt(_solved_finer, design, callback)
                if finer is None:
                    stopped, runs = True, done[-1].runs
                    runs[-1] = interrupted(runs[-1])
                    break
                design, before, stopped = finer
            made = interrupts.insist(_level, design, before, vertices)
            done.append(made)
            notes += [f"level {level}: {note}" if levels else note for note in _missed(made.after, design.settings)]
            if stopped:
                break
    return SymmetricResult(done, notes, stopped)


def _solved_finer(
    design: SymmetricDesign, callback: Callback | None
) -> tuple[SymmetricDesign, dict[str, float], bool] | None:
    """The refined design, its measures at the start, and whether it was stopped; None if interrupted at the start."""
    finer = design.refined()
    before = finer.measures()
    stopped = finer.solve(callback)
    return None if interrupted_at_the_start(finer.runs) else (finer, before, stopped)


def _level(design: SymmetricDesign, before: dict[str, float], like: Tensor) -> SymmetricLevel:
    """The mesh of a design, in the dtype and on the device of ``like``."""
    vertices, runs = design.vertices.to(like), list(design.runs)
    return SymmetricLevel(vertices, design.principal, design.normals(), before, design.measures(), runs)


def _missed(after: dict[str, float], settings: SymmetricSettings) -> list[str]:
    """What the mesh of a level does not meet, in words."""
    notes = []
    largest = max(after["largest_cospherical"], after["largest_coplanar"])
    if largest > settings.tolerance:
        notes.append(f"conditions are met to {largest:.2g} only: fix fewer vertices, pull less, or allow more steps")
    wrong = round((1.0 - after["saddle_side_share"]) * after["negative_stars"])
    crossing = int(after["crossing_pyramids_negative"])
    if wrong or crossing:
        notes.append(
            f"{wrong} negatively curved vertices have a principal neighbour on the wrong side and {crossing} a pyramid "
            "that intersects itself: choose principal edges along the smaller curvature, or a coarser spacing along "
            "than across them"
        )
    if after["largest_handle_distance"] > 0.05 * after["mean_edge_length"]:
        notes.append(
            f"a handle ends {after['largest_handle_distance']:.3g} from its target: pull less, or free other vertices"
        )
    return notes
