"""Linear solvers for symmetric positive definite matrices, behind one small protocol; they know no mesh."""

from .base import Descending as Descending
from .base import Factor as Factor
from .base import LinearSolver as LinearSolver
from .base import Pattern as Pattern
from .base import Solution as Solution
from .base import System as System
from .block_by_block import BlockByBlock as BlockByBlock
from .block_dense import BlockDense as BlockDense
from .choose import choose_solver as choose_solver
from .conjugate_gradients import ConjugateGradients as ConjugateGradients
from .dense import DenseQR as DenseQR
from .direct import SparseDirect as SparseDirect
from .lower_triangle import LowerTriangle as LowerTriangle
from .matrix import MatrixSystem as MatrixSystem
from .matrix import factorise as factorise
from .mixed_precision import MixedPrecision as MixedPrecision
from .pardiso_direct import PardisoDirect as PardisoDirect
from .rslab_direct import RslabDirect as RslabDirect
from .scipy_direct import ScipyDirect as ScipyDirect
