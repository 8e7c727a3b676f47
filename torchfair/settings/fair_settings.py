"""Settings of the formfinding job that lowers E."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Literal, get_args

from .._numbers import check_number, is_number
from ..errors import SettingsError
from .checks import check_angles, check_choice, check_weights
from .printed import printed_projection
from .projection_settings import ProjectionSettings
from .setting import setting

Boundary = Literal["glide", "fixed", "free"]
Planar = Literal["keep", "quads", "none"]
Flat = Literal["keep", "all", "none"]
Directions = Literal["free", "keep"]
Formulation = Literal["reduced", "lifted"]


def _default_projection() -> ProjectionSettings:
    return ProjectionSettings(
        max_iterations=80,
        initial_damping=0.1,
        damping_scale="identity",
        merit_tolerance=5e-4,
        patience=6,
        least_uncorrected_gain=0.6,
    )


@dataclass(frozen=True)
class FairSettings:
    """What :func:`minimise_normal_variation` trades against what. Lengths are in mean edge lengths of the input.

    Attributes:
        energy_weight: Weight of E, which counts once.
        closeness_weight: Weight of half the squared distance from the reference surface; 0 for none. A boundary
            that glides is left to its curves.
        distance_limit: No vertex goes farther from the reference surface than this, or on a boundary that glides
            from its curve, which bulges over the chords; None for no limit.
        distance_back: No vertex of the input is farther from the result than this; said where it is not so.
        reference_distance: A reference is refused if a vertex of the start is farther from it than this.
        fairness_weight: Weight of an eighth of squared second differences (between quads, and along the boundary) and
            of half of squared umbrella vectors (elsewhere). Where the mean ``l l*`` of a mesh is below 0.4, it falls
            with that mean, unless handles pull it off its reference surface: fairness grows with the number of
            vertices, E with its root only.
        second_differences: Whether fairness is that of second differences along all mesh polylines, the paper's, on
            triangle meshes too.
        handle_weight: Weight of half the squared distance of handles from their targets.
        boundary: ``"glide"`` lets boundary vertices slide on smooth curves through all of them and keeps corners,
            where curves end; ``"fixed"`` keeps them where they are, ``"free"`` lets them leave their curves. Between
            two corners with no vertex between them the curve is straight.
        boundary_weight: Weight of half the squared distance from the boundary curves. In the result gliding vertices
            lie on them exactly, but for those of faces that are kept planar.
        free_boundary_weight: Weight of half the squared distance of a free boundary from its curves, and of its corners
            from their places; with 0 a sheet shrinks, since E falls with its size.
        corner_angle: The boundary has a corner where it turns by more than this, radians.
        crease_angle: Interior edges with a dihedral angle above this are creases, whose vertices slide on smooth curves
            and whose corners stay, radians; 0 for no creases.
        planar: ``"keep"`` for the polygons that arrive planar, ``"quads"`` for all polygons with more than
            three corners, ``"none"``, or face numbers.
        planar_tolerance: A polygon arrives planar when its diagonals are nearer than this fraction of its
            mean edge length.
        planar_reach: With ``"keep"``, polygons that are nearly planar, by less than this, do not become less so.
        planar_distance: Where faces cannot become planar within the distance limit, they may go so far from the
            reference surface; 0 to keep the limit.
        planarity_weight: Weight of half the squared distance of diagonals.
        flat: Edges that stay flat: ``"keep"`` for the diagonals of panels that arrive as coplanar triangles, ``"all"``
            for all edges between triangles that arrive flat, ``"none"``, or numbers of interior edges. Coplanar
            triangles are a panel if no vertex lies among them, and more than they hang together; there are none if no
            more edges are flat than by chance.
        flat_tolerance: An edge arrives flat when its angle is at most this fraction of the mean angle of all edges.
        flat_weight: Weight of half of squared ``l l*`` of edges kept flat; where they are not flat enough it is raised.
        directions: ``"keep"`` holds edges to their directions within the surface, such as those of a mesh along
            principal directions whose faces become planar: by a weight, which promises no bound; ``"free"`` lets E
            turn them.
        direction_weight: Weight of half the squared sideways components of edges that keep their directions.
        smallest_angle: No corner angle falls below this (or below the smallest of the input), radians.
        smallest_area: No face falls below this fraction of its area.
        smallest_share: Nor below this fraction of the mean area, or nine tenths of its own where that is less; where
            ``smallest_area`` is 0 this does not count either.
        smallest_edge: No side of a polygon with more than three corners falls below this fraction of its length, or of
            the mean edge length where that is less. (Those of triangles are kept by angle and area.)
        largest_area: No face grows above this many times its area, or half the mean area where that is more, unless
            handles stretch it.
        faces_may_turn: Whether faces may turn over against the start where handles pull, step by step: for shapes that
            end far from where they begin.
        quality_weight: Weight of half the squared barriers before those bounds.
        smoothing: ``l l*`` below this is treated as flat, in mean edge lengths. Of a mesh whose mean ``l l*`` is below
            0.05 it falls with that mean: else all edges would be flat. A smaller one leads to a smaller E, but gathers
            what bends in fewer edges, so that reflections break more visibly.
        continuation: Factors of ``smoothing`` in stages before the last, and of the weight of fairness up to the one
            given, falling; empty for the last stage alone. From 50 000 vertices on those stages smooth by at most a
            quarter of the mean ``l l*``.
        formulation: ``"reduced"`` has the vertices as unknowns, ``"lifted"`` the paper's auxiliary variables too.
        constraint_weight: Weight of half the squared constraints that define the auxiliary variables.
        projection: Iterations, tolerances, damping and linear solver. From 10 000 vertices on ``"auto"`` is conjugate
            gradients on triangles, where no flat edges, handles or auxiliary variables are asked for.
    """

    energy_weight: float = 1.0
    closeness_weight: float = 100.0
    distance_limit: float | None = setting(0.05, unit="mean edges")
    distance_back: float = setting(0.5, unit="mean edges")
    reference_distance: float = setting(3.0, unit="mean edges")
    fairness_weight: float = 0.3
    second_differences: bool = False
    handle_weight: float = 1e4
    boundary: Boundary = "glide"
    boundary_weight: float = 1e4
    free_boundary_weight: float = 30.0
    corner_angle: float = setting(math.radians(40.0), unit="radians")
    crease_angle: float = setting(math.radians(40.0), unit="radians")
    planar: Planar | tuple[int, ...] = "keep"
    planar_tolerance: float = 1e-3
    planar_reach: float = 5e-3
    planar_distance: float = setting(0.5, unit="mean edges")
    planarity_weight: float = 1e6
    flat: Flat | tuple[int, ...] = "keep"
    flat_tolerance: float = 1e-3
    flat_weight: float = 1e4
    directions: Directions = "free"
    direction_weight: float = 30.0
    smallest_angle: float = setting(math.radians(10.0), unit="radians")
    smallest_area: float = 0.2
    smallest_share: float = 0.0
    smallest_edge: float = 0.2
    largest_area: float = 3.0
    faces_may_turn: bool = False
    quality_weight: float = 0.1
    smoothing: float = 1e-2
    continuation: tuple[float, ...] = (10.0, 3.0)
    formulation: Formulation = "reduced"
    constraint_weight: float = 1e5
    projection: ProjectionSettings = field(default_factory=_default_projection)

    @classmethod
    def paper(
        cls,
        *,
        w_reg: float = 1e-6,
        w_fair: float = 1.0,
        w_target: float = 1e-6,
        w_prox: float = 0.2,
        w_handle: float = 1.0,
        steps: int = 25,
    ) -> FairSettings:
        """Guided projection as printed (paper section 5.1), with the paper's weights of Fig. 18 by their names.

        The paper's variables; ``w_reg |X - X_prev|^2`` with constant ``w_reg``; every step taken; plain second
        differences; tangent planes of the reference and of the boundary; ``l* = 0`` for the diagonals of panels, with
        equal normals; no creases, barriers, limits, guards or stages. What is promised is measured all the same.
        Constraints have weight 1. E enters as ``2 delta^2 mu^2``, which is ``l l*`` where constraints hold; the paper's
        quadratic form ``l l*`` is indefinite.

        Args:
            w_reg: Of the squared change of the unknowns in a step.
            w_fair: Of squared second differences.
            w_target: Of E.
            w_prox: Of squared distances from the reference and, of a boundary that glides, from its curves. All four as
                in Fig. 20 of the paper; in mean edge lengths of the input, since the paper does not say its unit.
            w_handle: Of handles, "appropriately weighted" in the paper.
            steps: At most so many; "typically the shape stabilizes after 25 or so".
        """
        return cls(
            energy_weight=0.5 * w_target,
            closeness_weight=w_prox,
            distance_limit=None,
            fairness_weight=4.0 * w_fair,
            second_differences=True,
            handle_weight=w_handle,
            boundary_weight=w_prox,
            free_boundary_weight=0.0,
            crease_angle=0.0,
            planarity_weight=0.0,
            flat_weight=1.0,
            quality_weight=0.0,
            continuation=(),
            formulation="lifted",
            constraint_weight=1.0,
            projection=printed_projection(w_reg, steps),
        )

    def __post_init__(self) -> None:
        check_choice(self, "boundary", get_args(Boundary))
        check_choice(self, "directions", get_args(Directions))
        check_choice(self, "formulation", get_args(Formulation))
        check_weights(self)
        if isinstance(self.planar, str) and self.planar not in get_args(Planar):
            raise SettingsError(
                f"planar must be one of {', '.join(get_args(Planar))} or face numbers, got {self.planar!r}"
            )
        if isinstance(self.flat, str) and self.flat not in get_args(Flat):
            raise SettingsError(f"flat must be one of {', '.join(get_args(Flat))} or edge numbers, got {self.flat!r}")
        for name in (
            "planar_tolerance",
            "planar_reach",
            "planar_distance",
            "flat_tolerance",
        ):
            check_number(name, getattr(self, name))
        check_number("largest_area", self.largest_area, least=1.0)
        check_number("reference_distance", self.reference_distance, above=True)
        check_number("distance_back", self.distance_back, above=True)
        for name in ("smallest_area", "smallest_share", "smallest_edge"):
            check_number(name, getattr(self, name), most=1.0)
        check_angles(self)
        check_number("smoothing", self.smoothing, above=True, finite=True)
        factors = self.continuation if isinstance(self.continuation, Iterable) else (self.continuation,)
        if not all(is_number(factor) and 1.0 < factor < math.inf for factor in factors):
            raise SettingsError(f"continuation must hold finite factors above 1, got {self.continuation}")
        check_number("distance_limit", self.distance_limit, above=True, or_none=True)

    def stage(self) -> ProjectionSettings:
        """Settings of a stage before the last: fewer steps, wider tolerance, no waiting for what damping holds back."""
        return replace(
            self.projection,
            max_iterations=min(20, self.projection.max_iterations),
            merit_tolerance=4e-3,
            patience=6,
            patience_when_damped=1,
            when_settled="stop",
        )
