"""Guided projection: write the residual of one element, let the library assemble and solve."""

from ..settings.projection_settings import ProjectionSettings as ProjectionSettings
from .adjoint import AdjointSolution as AdjointSolution
from .guided_projection import GuidedProjection as GuidedProjection
from .guided_projection import guided_projection as guided_projection
from .layer import LayerInfo as LayerInfo
from .layer import ProjectionLayer as ProjectionLayer
from .loss import LogAbsolute as LogAbsolute
from .loss import Loss as Loss
from .loss import OneSided as OneSided
from .loss import SmoothAbsolute as SmoothAbsolute
from .loss import Squares as Squares
from .nuclear_norm import SmoothNuclearNorm as SmoothNuclearNorm
from .nuclear_norm import symmetric_components as symmetric_components
from .nuclear_norm import symmetric_matrix as symmetric_matrix
from .result import IterationRecord as IterationRecord
from .result import ProjectionResult as ProjectionResult
from .result import Status as Status
from .result import TermResidual as TermResidual
from .run import Callback as Callback
from .state import ProjectionState as ProjectionState
from .stationary_point import StationaryPoint as StationaryPoint
from .steps import finished as finished
from .steps import init as init
from .steps import resume as resume
from .steps import step as step
from .term import ElementTerm as ElementTerm
