"""What the energies of vertex stars share: the choice of estimator and of the boundary."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from typing import ClassVar, Literal, get_args

import torch
from torch import Tensor

from .._precision import in_single_at_least
from ..errors import TorchfairError
from ..geometry import tangential_shape_operators, vertex_areas
from ..geometry._unit import in_their_units
from ..geometry.tangential_shape_operator import Estimator, check_estimator
from ..topology import Topology
from .base import MeshModule, Reduction
from .boundary_extrapolation import BoundaryExtrapolation, boundary_extrapolation

Boundary = Literal["open", "extrapolated"]


@in_single_at_least
def star_terms(
    norms: Callable[[Tensor], Tensor],
    vertices: Tensor,
    topology: Topology,
    *,
    sine: bool,
    estimator: Estimator,
    boundary: Boundary | BoundaryExtrapolation,
    per_area: bool = False,
) -> Tensor:
    """``norms`` of the tangential shape operators of all stars (*batch, V), completed at the boundary if asked to.

    With ``per_area`` they are divided by the areas of the stars, as squares of integrated curvatures must be; a star
    without area contributes nothing.

    Raises:
        ShapeError: if ``vertices`` is not a floating tensor (*batch, V, 3).
        MeshError: if faces around a vertex form several fans.
        TorchfairError: for an unknown estimator or treatment of the boundary.
    """
    topology.require_fans()
    extrapolation = tables_for(boundary, topology)
    topology.check_vertices(vertices)
    vertices, unit = in_their_units(vertices, topology, "vertices")
    unit = torch.ones_like(unit) if per_area else unit  # the rest has the unit of a length, or none
    values = norms(tangential_shape_operators(vertices, topology, estimator=estimator, sine=sine))
    if extrapolation is None and not per_area:
        return values * unit
    areas = vertex_areas(vertices, topology)
    if per_area:
        values = values / torch.where(areas > 0, areas, 1.0)
    return (values if extrapolation is None else extrapolation.apply(values, areas)) * unit


def tables_for(boundary: Boundary | BoundaryExtrapolation, topology: Topology) -> BoundaryExtrapolation | None:
    """The tables to apply, None for an open boundary; TorchfairError for any other word."""
    if isinstance(boundary, BoundaryExtrapolation):
        return boundary
    if boundary not in get_args(Boundary):
        raise TorchfairError(f'boundary must be "open" or "extrapolated", got {boundary!r}')
    return None if boundary == "open" else boundary_extrapolation(topology)


class StarEnergy(MeshModule):
    """An energy that is a sum over vertex stars of a norm of their shape operators.

    Subclasses define :meth:`norms`, and :attr:`per_area` if these are squares.

    Args:
        topology: connectivity of all meshes that the module is called with.
        sine: see :func:`torchfair.energies.total_absolute_curvature`, also for the other two.
        estimator: of the shape operators.
        boundary: what to do about incomplete stars.
        reduction: see :class:`MeshModule`.

    Attributes:
        per_area: whether norms are divided by the areas of the stars.
        extrapolation: tables of the boundary, on the device of the topology; None for an open boundary.

    Raises:
        MeshError: if faces around a vertex form several fans.
        TorchfairError: for an unknown estimator or treatment of the boundary.
    """

    per_area: ClassVar[bool] = False
    extrapolation: BoundaryExtrapolation | None

    def __init__(
        self,
        topology: Topology,
        *,
        sine: bool = True,
        estimator: Estimator = "normal_cycle",
        boundary: Boundary = "open",
        reduction: Reduction = "none",
    ) -> None:
        super().__init__(topology, reduction=reduction)
        topology.require_fans()
        check_estimator(estimator)
        self.sine = sine
        self.estimator: Estimator = estimator
        self.extrapolation = tables_for(boundary, topology)

    def _apply(self, fn: Callable[[Tensor], Tensor], recurse: bool = True) -> MeshModule:
        super()._apply(fn, recurse)
        if self.extrapolation is not None:
            self.extrapolation = self.extrapolation.to(self.topology.device)
        return self

    def extra_repr(self) -> str:
        """The topology and the choices in words."""
        estimator = f"normal_cycle, sine={self.sine}" if self.estimator == "normal_cycle" else self.estimator
        return f"{super().extra_repr()}, {estimator}, {self.boundary} boundary"

    @property
    def boundary(self) -> Boundary:
        """What is done about incomplete stars."""
        return "open" if self.extrapolation is None else "extrapolated"

    @abstractmethod
    def norms(self, matrices: Tensor) -> Tensor:
        """The norm that is summed: symmetric matrices (*batch, V, 2, 2) to (*batch, V)."""

    def per_vertex(self, vertices: Tensor) -> Tensor:
        """Terms (*batch, V) of the stars; they sum to ``forward(vertices)``."""
        boundary: Boundary | BoundaryExtrapolation = self.extrapolation or "open"
        return star_terms(
            self.norms,
            vertices,
            self.topology,
            sine=self.sine,
            estimator=self.estimator,
            boundary=boundary,
            per_area=self.per_area,
        )

    def per_mesh(self, vertices: Tensor) -> Tensor:
        """Energy (*batch,) of ``vertices`` (*batch, V, 3)."""
        return self.topology.sum_per_mesh(self.per_vertex(vertices), "vertices")
