"""Formfinding jobs: short recipes over energies, constraints and guided projection (paper section 5)."""

from .normal_variation import FairResult as FairResult
from .normal_variation import minimise_normal_variation as minimise_normal_variation
from .settings import FairSettings as FairSettings
