"""Formfinding jobs: short recipes over energies, constraints and guided projection (paper section 5)."""

from .absolute_curvature import FormResult as FormResult
from .absolute_curvature import minimise_absolute_curvature as minimise_absolute_curvature
from .form_settings import FormSettings as FormSettings
from .normal_variation import FairResult as FairResult
from .normal_variation import minimise_normal_variation as minimise_normal_variation
from .prescribed_normals import prescribed_normals as prescribed_normals
from .principal_symmetric import SymmetricLevel as SymmetricLevel
from .principal_symmetric import SymmetricResult as SymmetricResult
from .principal_symmetric import principal_symmetric as principal_symmetric
from .settings import FairSettings as FairSettings
from .start_surface import start_surface as start_surface
from .strip_normals import strip_normals as strip_normals
from .symmetric_design import SymmetricDesign as SymmetricDesign
from .symmetric_report import condition_residuals as condition_residuals
from .symmetric_report import symmetric_measures as symmetric_measures
from .symmetric_settings import SymmetricSettings as SymmetricSettings
