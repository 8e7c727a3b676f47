"""Settings of the design of principal-symmetric meshes."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal, get_args

from .._numbers import check_count, check_number
from .checks import check_angles, check_choice, check_weights
from .printed import printed_projection
from .projection_settings import ProjectionSettings
from .setting import setting

Boundary = Literal["free", "fixed"]
Formulation = Literal["spheres", "eliminated", "lifted"]


def _default_projection() -> ProjectionSettings:
    return ProjectionSettings(
        max_iterations=12,
        initial_damping=1e-3,
        damping_scale="identity",
        merit_tolerance=3e-2,
        patience=2,
        when_settled="stop",
        least_uncorrected_gain=-math.inf,
    )


@dataclass(frozen=True)
class SymmetricSettings:
    """What :func:`principal_symmetric` trades against what. Weights are dimensionless: mean edge length 1.

    Attributes:
        constraint_weight: Weight of half the squared conditions while the shape is found.
        tight_weight: Weight of the same once it is found; at last they are met exactly, without any other aim.
        fairness_weight: Weight of half the squared umbrella vectors of the displacement from the start of the level:
            handles pull their surroundings along. Of second differences, also at the boundary, an eighth counts.
        second_differences: Whether fairness is that of plain second differences along all mesh polylines, the paper's,
            which shrink and straighten shapes; not of the displacement.
        evenness_weight: Weight of half the squares by which stars miss being symmetric along their principal polyline,
            which undoes shear; 3 for principal quads cut by diagonals.
        anchor_weight: Weight of half the squared displacement itself: how far around a handle the mesh follows, about
            the inverse fourth root of its quotient with ``fairness_weight`` in edges.
        handle_weight: Weight of half the squared distance of handles from their targets.
        closeness_weight: Weight of half the squared distance from the reference surface, if there is one.
        free: Whether the shape may become another where no handle asks for it. Without handles and reference it is
            kept otherwise: vertices stay close to the surface they start on, those of the boundary to curves. Live
            sessions are free in any case.
        shape_weight: Weight of half the squared distance from the shape that is kept. E counts at least a hundredth
            of that then, which keeps stars that slide fair. Where the result is too far from its start, or E/C has
            risen, fairness counts a tenth, and what was missed more and more.
        energy_weight: Weight of E, which counts once; 0 without.
        energy_smoothing: ``l l*`` below this is treated as flat.
        saddle_weight: Weight of half the squares by which saddle sides are missed.
        saddle_margin: How far beyond the bound principal neighbours are pushed, in curvatures of the star's sphere.
        boundary: ``"free"``, or ``"fixed"`` to keep boundary vertices where they are.
        smallest_angle: No corner angle falls below this while the shape is found, radians; 0 for no bound.
        tolerance: Largest relative residual of the conditions at which they count as met.
        most_steps: Damped steps that one level may take at most.
        rounds: How often a shape is looked for at most: with handles pulling less each time if the conditions could
            not be met, with wider margins if just some saddle sides came out wrong. 0 for a single run with everything
            weighted, as the paper has it.
        formulation: ``"spheres"`` has normals and curvatures of the stars' spheres as unknowns beside the vertices,
            ``"eliminated"`` the vertices alone, ``"lifted"`` the paper's variables.
        projection: Damping, tolerances and linear solver while the shape is found.
    """

    constraint_weight: float = 1e2
    tight_weight: float = 1e4
    fairness_weight: float = 1.0
    second_differences: bool = False
    evenness_weight: float = 0.0
    anchor_weight: float = 1e-5
    handle_weight: float = 1e2
    closeness_weight: float = 1.0
    free: bool = False
    shape_weight: float = 10.0
    energy_weight: float = 0.0
    energy_smoothing: float = 1e-2
    saddle_weight: float = 1.0
    saddle_margin: float = 0.05
    boundary: Boundary = "free"
    smallest_angle: float = setting(math.radians(10.0), unit="radians")
    tolerance: float = 1e-8
    most_steps: int = 300
    rounds: int = 6
    formulation: Formulation = "spheres"
    projection: ProjectionSettings = field(default_factory=_default_projection)

    @classmethod
    def paper(
        cls,
        *,
        w_reg: float = 1e-6,
        w_fair: float = 1.0,
        w_target: float = 0.0,
        w_prox: float = 0.2,
        w_handle: float = 1.0,
        steps: int = 25,
    ) -> SymmetricSettings:
        """Guided projection as printed (paper section 5.2), with the paper's weights of Figs. 5 and 14 by their names.

        The paper's variables, those of E among them if ``w_target`` is not 0; ``w_reg |X - X_prev|^2`` with constant
        ``w_reg``; every step taken; plain second differences; saddle sides by slacks; one run of all that, no rounds,
        no barriers, no guards. What is promised is measured all the same. Constraints have weight 1.

        Args:
            w_reg: Of the squared change of the unknowns in a step.
            w_fair: Of squared second differences.
            w_target: Of E; in Fig. 20 of the paper 1e-9 for Fig. 14 and 1e-6 for Fig. 5.
            w_prox: Of squared distances from the reference, if there is one. All four in mean edge lengths of the
                input, since the paper does not say its unit.
            w_handle: Of handles, "appropriately weighted" in the paper.
            steps: At most so many; "typically the shape stabilizes after 25 or so".
        """
        return cls(
            constraint_weight=1.0,
            fairness_weight=4.0 * w_fair,
            second_differences=True,
            anchor_weight=0.0,
            handle_weight=w_handle,
            closeness_weight=w_prox,
            free=True,
            energy_weight=0.5 * w_target,
            saddle_weight=0.0,
            smallest_angle=0.0,
            rounds=0,
            formulation="lifted",
            projection=printed_projection(w_reg, steps),
        )

    def __post_init__(self) -> None:
        check_choice(self, "boundary", get_args(Boundary))
        check_choice(self, "formulation", get_args(Formulation))
        check_weights(self)
        for name in ("constraint_weight", "tight_weight"):
            check_number(name, getattr(self, name), above=True)
        check_angles(self)
        check_number("energy_smoothing", self.energy_smoothing, above=True, finite=True)
        check_number("saddle_margin", self.saddle_margin, finite=True)
        check_number("tolerance", self.tolerance, above=True)
        check_count("most_steps", self.most_steps, least=1)
        check_count("rounds", self.rounds, least=0)
