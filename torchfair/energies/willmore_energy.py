"""Willmore energy: squared curvatures of vertex stars over their areas."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, get_args

from torch import Tensor

from .._loading import safe_to_load
from ..errors import TorchfairError
from ..geometry.tangential_shape_operator import Estimator
from ..topology import Topology
from .base import Reduction
from .boundary_extrapolation import BoundaryExtrapolation
from .star_energy import Boundary, StarEnergy, star_terms

Density = Literal["mean", "difference", "bending"]


def willmore_energy_per_vertex(
    vertices: Tensor,
    topology: Topology,
    *,
    density: Density = "mean",
    sine: bool = True,
    estimator: Estimator = "normal_cycle",
    boundary: Boundary | BoundaryExtrapolation = "open",
) -> Tensor:
    """The squared curvature of every star, integrated over it: (*batch, V).

    Arguments, degenerate cases and errors as for :func:`willmore_energy`.

    Example:
        >>> from torchfair.energies import willmore_energy_per_vertex
        >>> from torchfair.shapes import Catenoid, principal_quads
        >>> mesh = principal_quads(Catenoid(), 8, 16)
        >>> willmore_energy_per_vertex(mesh.vertices, mesh.topology).shape
        torch.Size([144])
    """
    return star_terms(
        _squares(density), vertices, topology, sine=sine, estimator=estimator, boundary=boundary, per_area=True
    )


def willmore_energy(
    vertices: Tensor,
    topology: Topology,
    *,
    density: Density = "mean",
    sine: bool = True,
    estimator: Estimator = "normal_cycle",
    boundary: Boundary | BoundaryExtrapolation = "open",
) -> Tensor:
    """Willmore energy ``W = sum_v ((k1 + k2) / 2)^2 / A_v``, curvatures integrated over the star of ``v``.

    ``A_v`` is the area of the star (:func:`torchfair.geometry.vertex_areas`), so that W discretises an integral:

    ==============  ==================================  ==============  ==========================================
    density         integral of                         on a sphere     on a torus of radii R and r
    ==============  ==================================  ==============  ==========================================
    ``mean``        ``((k1 + k2) / 2)^2``               ``4 pi``        ``pi^2 R^2 / (r sqrt(R^2 - r^2))``
    ``difference``  ``(k1 - k2)^2``, as in the paper    0               4 times that
    ``bending``     ``k1^2 + k2^2``                     ``8 pi``        4 times that
    ==============  ==================================  ==============  ==========================================

    A cylinder of height h and radius R has ``pi h / (2 R)``, and 4 times that by the other two. They differ by
    multiples of the total Gaussian curvature, which is fixed for closed surfaces: ``difference = 4 mean - 4 K`` and
    ``bending = 4 mean - 2 K``; with a boundary that may turn they have different minimisers. Paper sections 1.2 and 4,
    where surfaces of least C are set against those of least Willmore energy.

    **Accuracy**, as measured on closed forms: order 2 in the edge length on regular lattices by either estimator. An
    open boundary of triangles costs the normal cycle a term of first order (6 % on a cylinder of 10 rows, 3 % on 20),
    which extrapolation takes away. On irregular meshes the noise in curvatures is squared and does not fall: on a torus
    the normal cycle settles 1.6 % too high by ``mean``, 4 % by ``difference``; the corrected estimator keeps order 2.

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity; any polygons, mixed.
        density: which squares, see the table.
        sine: see :func:`total_absolute_curvature`.
        estimator: see there.
        boundary: see there.

    Returns:
        (*batch,) >= 0, dimensionless: unchanged by scaling, by rigid motions and by turning all faces round. Smooth,
        flat stars included; large where a star of small area is sharply bent. Stars without a normal or without area
        contribute nothing, nor do edges on the boundary, of length zero or beside a degenerate face.

    Raises:
        ShapeError: if ``vertices`` is not a floating tensor (*batch, V, 3).
        TorchfairError: for an unknown density, estimator or treatment of the boundary.

    Example:
        >>> import torch
        >>> from torchfair.energies import willmore_energy
        >>> from torchfair.shapes import icosphere
        >>> sphere = icosphere(3)
        >>> round(willmore_energy(sphere.vertices, sphere.topology).item() / torch.pi, 1)
        4.0
    """
    terms = willmore_energy_per_vertex(
        vertices, topology, density=density, sine=sine, estimator=estimator, boundary=boundary
    )
    return topology.sum_per_mesh(terms, "vertices")


@safe_to_load
class WillmoreEnergy(StarEnergy):
    """Module form of :func:`willmore_energy`: ``forward(vertices)`` (*batch, V, 3) -> (*batch,).

    Args:
        topology: connectivity of all meshes that the module is called with.
        density: see :func:`willmore_energy`, also for the other three.
        sine: whether the normal cycle uses sines.
        estimator: of the shape operators.
        boundary: what to do about incomplete stars.
        reduction: see :class:`MeshModule`.

    Raises:
        TorchfairError: for an unknown density, estimator or treatment of the boundary.

    Example:
        >>> from torchfair.energies import WillmoreEnergy
        >>> from torchfair.shapes import icosphere
        >>> ball = icosphere(2, radius=2.0)
        >>> energy = WillmoreEnergy(ball.topology)
        >>> energy(ball.vertices)  # nearly 4 pi, that of every sphere
        tensor(11.9746, dtype=torch.float64)
        >>> batch = ball.vertices.expand(3, -1, -1)
        >>> energy(batch).shape
        torch.Size([3])
    """

    per_area = True

    def __init__(
        self,
        topology: Topology,
        *,
        density: Density = "mean",
        sine: bool = True,
        estimator: Estimator = "normal_cycle",
        boundary: Boundary = "open",
        reduction: Reduction = "none",
    ) -> None:
        super().__init__(topology, sine=sine, estimator=estimator, boundary=boundary, reduction=reduction)
        _squares(density)
        self.density: Density = density

    def extra_repr(self) -> str:
        """The topology and the choices in words."""
        return f"{super().extra_repr()}, {self.density}"

    def norms(self, matrices: Tensor) -> Tensor:
        """The square that is summed: symmetric matrices (*batch, V, 2, 2) to (*batch, V)."""
        return _squares(self.density)(matrices)


def _squares(density: str) -> Callable[[Tensor], Tensor]:
    try:
        return {"mean": _mean, "difference": _difference, "bending": _bending}[density]
    except KeyError:
        raise TorchfairError(f"density must be one of {get_args(Density)}, got {density!r}") from None


def _mean(matrices: Tensor) -> Tensor:
    return (matrices[..., 0, 0] + matrices[..., 1, 1]).square() / 4


def _difference(matrices: Tensor) -> Tensor:
    return (matrices[..., 0, 0] - matrices[..., 1, 1]).square() + 4 * matrices[..., 0, 1].square()


def _bending(matrices: Tensor) -> Tensor:
    return matrices.square().sum((-2, -1))
