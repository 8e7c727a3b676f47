"""Formfinding jobs: short recipes over energies, constraints and guided projection (paper section 5)."""

from .denoise.noise import noise_level as noise_level
from .denoise.recipe import DenoiseRecipe as DenoiseRecipe
from .denoise.recipe import denoise as denoise
from .denoise.settings import DenoiseSettings as DenoiseSettings
from .fair.recipe import FairRecipe as FairRecipe
from .fair.recipe import minimise_normal_variation as minimise_normal_variation
from .fair.settings import FairSettings as FairSettings
from .form.prescribed_normals import prescribed_normals as prescribed_normals
from .form.recipe import FormResult as FormResult
from .form.recipe import minimise_absolute_curvature as minimise_absolute_curvature
from .form.settings import FormSettings as FormSettings
from .form.start_surface import start_surface as start_surface
from .job import JobResult as JobResult
from .job import Level as Level
from .job import Progress as Progress
from .job import Promise as Promise
from .job import Recipe as Recipe
from .job import Session as Session
from .symmetric.design import SymmetricDesign as SymmetricDesign
from .symmetric.measures import condition_residuals as condition_residuals
from .symmetric.measures import symmetric_measures as symmetric_measures
from .symmetric.recipe import SymmetricLevel as SymmetricLevel
from .symmetric.recipe import SymmetricResult as SymmetricResult
from .symmetric.recipe import principal_symmetric as principal_symmetric
from .symmetric.settings import SymmetricSettings as SymmetricSettings
from .symmetric.strip_normals import strip_normals as strip_normals
