"""Linear solvers for the damped normal equations, behind one small protocol."""

from .base import LinearSolver as LinearSolver
from .base import Step as Step
from .choose import choose_solver as choose_solver
from .conjugate_gradients import ConjugateGradients as ConjugateGradients
from .dense import DenseQR as DenseQR
from .rslab_direct import RslabDirect as RslabDirect
from .scipy_direct import ScipyDirect as ScipyDirect
