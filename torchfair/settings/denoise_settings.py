"""Settings of the formfinding job that removes noise."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal, get_args

from .._numbers import check_number
from ..errors import SettingsError
from .checks import check_choice, check_weights
from .projection_settings import ProjectionSettings
from .setting import setting

Boundary = Literal["free", "fixed"]
_DIRECT_LIMIT = 100_000  # unknowns; above, factors cost more time and memory than iterations


def _default_projection() -> ProjectionSettings:
    return ProjectionSettings(
        max_iterations=60,
        initial_damping=1e-3,
        damping_scale="diagonal",
        merit_tolerance=3e-3,
        patience=2,
        when_settled="judge",
        accuracy=3e-2,
    )


@dataclass(frozen=True)
class DenoiseSettings:
    """What :func:`denoise` takes for noise. One setting serves all meshes.

    Attributes:
        noise: Standard deviation of the noise across the surface, in the unit of the input; ``"auto"`` estimates it.
        strength: Weight of E over the noise: above 1 smooths more than the noise asks for.
        curved: Whether the surface is curved nearly everywhere, as organic shapes are: the absolute value is rounded
            by ``curved_smoothing``, so that faces bend evenly and do not gather into facets.
        boundary: ``"free"`` moves boundary vertices like others; ``"fixed"`` keeps them where they are.
        smoothing: ``l l*`` below this is treated as flat, in mean edge lengths.
        curved_smoothing: The same with ``curved``.
        unfolding_weight: Weight of half the squared inequalities that turn folded faces back; 0 leaves them folded.
        handle_weight: Weight of half the squared distance of handles from their targets.
        projection: Iterations, tolerances, damping and linear solver; ``"auto"`` takes conjugate gradients above a
            hundred thousand unknowns, which depend on rounding (of the unit, say) a little.

    Raises:
        SettingsError: a setting is out of its range; names it.
    """

    noise: float | Literal["auto"] = "auto"
    strength: float = 1.0
    curved: bool = False
    boundary: Boundary = "free"
    smoothing: float = setting(3e-3, unit="mean edges")
    curved_smoothing: float = setting(2e-2, unit="mean edges")
    unfolding_weight: float = 100.0
    handle_weight: float = 1e4
    projection: ProjectionSettings = field(default_factory=_default_projection)

    def __post_init__(self) -> None:
        if self.noise != "auto":
            check_number("noise (or 'auto')", self.noise, finite=True)
        check_number("strength", self.strength, finite=True)
        if not isinstance(self.curved, bool):
            raise SettingsError(f"curved must be True or False, got {self.curved!r}")
        check_choice(self, "boundary", get_args(Boundary))
        for name in ("smoothing", "curved_smoothing"):
            check_number(name, getattr(self, name), above=True, finite=True)
        check_weights(self)

    def run(self, unknowns: int) -> ProjectionSettings:
        """Settings of the iteration for a number of unknowns."""
        iterative = self.projection.solver == "auto" and unknowns > _DIRECT_LIMIT
        return replace(self.projection, solver="cg") if iterative else self.projection
