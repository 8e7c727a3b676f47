"""What the presets of all jobs share that run guided projection as the paper prints it (sections 5.1 to 5.3)."""

from __future__ import annotations

from .projection_settings import ProjectionSettings


def printed_projection(w_reg: float, steps: int) -> ProjectionSettings:
    """So many steps with constant damping ``w_reg``, all of them taken; fewer where the merit comes to rest."""
    return ProjectionSettings(
        max_iterations=steps,
        step_policy="every",
        initial_damping=w_reg,
        damping_scale="identity",
        merit_tolerance=1e-6,
        when_settled="judge",
    )
