"""Settings of the formfinding job that lowers C."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal, get_args

from .._numbers import check_number
from ..errors import SettingsError
from .checks import check_angles, check_choice, check_weights
from .printed import printed_projection
from .projection_settings import ProjectionSettings
from .setting import setting

Boundary = Literal["fixed", "glide"]
Formulation = Literal["reduced", "lifted"]
AbsoluteValue = Literal["smooth", "logarithmic"]


def _default_projection() -> ProjectionSettings:
    return ProjectionSettings(
        max_iterations=40,
        initial_damping=1e-2,
        damping_scale="identity",
        merit_tolerance=1e-3,
        patience=2,
        when_settled="judge",
    )


@dataclass(frozen=True)
class FormSettings:
    """What :func:`minimise_absolute_curvature` trades against what.

    Weights are dimensionless: the problem is solved with unit mean edge length.

    Attributes:
        curvature_weight: Weight of C, which counts once.
        fairness_weight: Weight of half the squared differences of umbrella vectors from the even part of those around:
            keeps stars from crumpling and vertices apart, fades as edges shorten.
        coarse_fairness_weight: The same, of half the squares, while smoothing is coarse.
        umbrella_weight: Weight of half the squared umbrella vectors as they are (the paper's fairness): shrinks tubes.
        tangential_fairness_weight: Weight of half the squares of their parts in the tangent planes.
        boundary: ``"fixed"``, or ``"glide"`` to let boundary vertices slide along the boundary curves, corners
            kept.
        boundary_weight: Weight of half the squared distance of gliding vertices from their curve.
        corner_angle: The boundary has a corner where it turns by more than this, radians.
        tangent_weight: Weight of half the squared angle between prescribed and actual normals, radians; ten times it
            in the end.
        handle_weight: Weight of half the squared distance of handles from their targets.
        coarse_smoothing, smoothing: Stars with less curvature than this fraction of the mean over all stars
            are treated as flat, at first and in the end; in between, by steps of about five.
        least_angle: A surface found with the coarse smoothing that has a smaller corner angle than this, radians
            (or half the smallest of the start), is suspected to have collapsed and sought once more with the
            last smoothing alone; likewise one that has not converged. In space no step leads to a smaller one.
        formulation: ``"reduced"`` has the vertices as unknowns, ``"lifted"`` the paper's auxiliary variables
            too (for comparison: slower).
        constraint_weight: Weight of half the squared constraints that define auxiliary variables.
        absolute_value: Of curvatures that are unknowns, those of the lifted formulation: ``"smooth"`` is reweighted by
            the inverse of ``sqrt(x^2 + smoothing^2)``, ``"logarithmic"`` by that of ``|x| + smoothing``, as the paper
            prints it.
        projection: Iterations of each stage, tolerances, damping and linear solver. The tolerance of the merit is
            that of stages in space; along normals ten times it while smoothing is coarse, a tenth of it at last.
    """

    curvature_weight: float = 1.0
    fairness_weight: float = 0.5
    coarse_fairness_weight: float = 1.0
    umbrella_weight: float = 0.0
    tangential_fairness_weight: float = 0.0
    boundary: Boundary = "fixed"
    boundary_weight: float = 1e4
    corner_angle: float = setting(math.radians(40.0), unit="radians")
    tangent_weight: float = 1e3
    handle_weight: float = 1e4
    coarse_smoothing: float = 0.3
    smoothing: float = 0.05
    least_angle: float = setting(math.radians(5.0), unit="radians")
    formulation: Formulation = "reduced"
    constraint_weight: float = 1e3
    absolute_value: AbsoluteValue = "smooth"
    projection: ProjectionSettings = field(default_factory=_default_projection)

    @classmethod
    def paper(
        cls,
        *,
        w_reg: float = 1e-3,
        w_fair: float = 0.2,
        w_target: float = 0.05,
        w_handle: float = 1.0,
        epsilon: float = 0.05,
        steps: int = 18,
    ) -> FormSettings:
        """Guided projection as printed (paper section 5.3), with weights of Fig. 19 by their names.

        The paper's variables; ``w_reg |X - X_prev|^2`` with constant ``w_reg``; every step taken; plain umbrella
        vectors; absolute values by ``1 / (|x| + epsilon)``; no smoothing from coarse to fine, no guards, no stages
        along normals. What is promised is measured all the same. Constraints have weight 1.

        Args:
            w_reg: Of the squared change of the unknowns in a step.
            w_fair: Of squared umbrella vectors.
            w_target: Of C. All three as in Fig. 19 of the paper; with unit mean edge length, since
                the paper does not say its unit.
            w_handle: Of handles.
            epsilon: As a fraction of the mean absolute curvature of a star at the start; the paper does not say its.
            steps: At most so many; the paper has 7 to 18.
        """
        return cls(
            curvature_weight=w_target,
            fairness_weight=0.0,
            coarse_fairness_weight=0.0,
            umbrella_weight=w_fair,
            boundary_weight=1.0,
            handle_weight=w_handle,
            coarse_smoothing=epsilon,
            smoothing=epsilon,
            formulation="lifted",
            constraint_weight=1.0,
            absolute_value="logarithmic",
            projection=printed_projection(w_reg, steps),
        )

    def __post_init__(self) -> None:
        check_choice(self, "boundary", get_args(Boundary))
        check_choice(self, "formulation", get_args(Formulation))
        check_choice(self, "absolute_value", get_args(AbsoluteValue))
        check_weights(self)
        check_angles(self)
        for name in ("coarse_smoothing", "smoothing"):
            check_number(name, getattr(self, name), above=True, finite=True)
        if not 0.0 < self.smoothing <= self.coarse_smoothing < math.inf:
            raise SettingsError(
                f"smoothing must be positive and at most coarse_smoothing, got {self.smoothing} and "
                f"{self.coarse_smoothing}"
            )

    def smoothings(self) -> list[float]:
        """From coarse to fine, in geometric steps of about five."""
        steps = max(1, round(math.log(self.coarse_smoothing / self.smoothing, 5.0)))
        ratio = (self.smoothing / self.coarse_smoothing) ** (1.0 / steps)
        return [self.coarse_smoothing * ratio**i for i in range(steps)] + [self.smoothing]
