"""Curvatures and principal directions from polynomials fitted over rings of vertices."""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from .._numbers import check_count
from .._precision import in_single_at_least
from ..errors import ShapeError, TorchfairError
from ..topology import Topology
from ._height_fits import Heights, fitted_heights, fitted_normals, turned_normals
from ._ops import norm
from ._principal_frames import principal_frames
from .curvature_norms import eigenvalues
from .normals import vertex_normals
from .patches import Patches
from .tangent_basis import tangent_bases

_LEAST_RINGS, _MOST_RINGS = 2, 12
_QUADRATIC = 6  # coefficients; of no more vertices than that, nothing is left to tell the error by
_DEGREE = 4
_WANTED = 0.02  # relative error of the curvatures, at half of the vertices
_NO_DIRECTION = math.radians(10.0)  # expected error of a direction from which on it is worth nothing
_NONE = 1e-6  # relative difference of curvatures that is rounding
_ROUND = 3e-3  # relative difference of curvatures that is not told from none
_FLAT = 1e-6  # radians that normals turn over a patch; less is flat


@dataclass(frozen=True)
class FittedCurvature:
    """Normals and shape operators of the surface under the noise, at every vertex.

    Attributes:
        normals: (*batch, V, 3) unit normals.
        operators: (*batch, V, 3, 3) symmetric shape operators in the tangent planes, one over the unit of the
            vertices, positive where convex: ``operator @ d1 = k1 d1`` along the direction ``d1`` itself, not turned
            as in :func:`shape_operators`. The normal is in the kernel.
        doubts: (*batch, V) expected error of the traceless part, one over the unit of the vertices: standard error
            of ``|k1 - k2| / 2`` in any direction, from what the fit leaves over.
        scales: (*batch, V) root mean square distance of the vertices in the patch, in the unit of the vertices.
        rings: over how many rings of vertices they were fitted.
    """

    normals: Tensor
    operators: Tensor
    doubts: Tensor
    scales: Tensor
    rings: int

    @property
    def curvatures(self) -> Tensor:
        """(*batch, V, 2) both principal curvatures, the larger first; where they agree, derivatives of their mean."""
        return eigenvalues(self._plane())

    @property
    def directions(self) -> Tensor:
        """(*batch, V, 2, 3) unit principal directions ``d1, d2``, as :func:`principal_directions` returns them."""
        plane = self._plane()
        turned = self.mean_curvatures[..., None, None] * 2 * torch.eye(2, dtype=plane.dtype, device=plane.device)
        least = _NONE * (self.mean_curvatures.abs() + _FLAT / self.scales).detach()
        return principal_frames(turned - plane, tangent_bases(self.normals), least)

    @property
    def mean_curvatures(self) -> Tensor:
        """(*batch, V) ``(k1 + k2) / 2``."""
        return self.operators.diagonal(dim1=-2, dim2=-1).sum(-1) / 2

    @property
    def traceless(self) -> Tensor:
        """(*batch, V, 3, 3) the operators less the mean curvature in the tangent plane: what has the directions.

        Symmetric, with the eigenvalue ``(k1 - k2) / 2`` along ``d1``, minus that along ``d2`` and zero along the
        normal. It can be averaged over neighbours, as directions cannot.
        """
        outer = self.normals[..., :, None] * self.normals[..., None, :]
        one = (self.normals != 0).any(-1)[..., None, None] * torch.eye(3, dtype=outer.dtype, device=outer.device)
        return self.operators - self.mean_curvatures[..., None, None] * (one - outer)

    @property
    def confidence(self) -> Tensor:
        """(*batch, V) how far the principal directions can be trusted, in [0, 1].

        ``1 - (f / 10 degrees)^2``, but not below zero, where ``f`` is the expected error of the directions: their
        standard error as far as what the fit leaves over is noise, and at least what a relative difference of the
        curvatures of 0.3 % would need to be told from none. So it is zero at umbilics, on spheres, in flat places
        and where noise hides the directions, 0.94 where they are expected to be right within 2.5 degrees.
        """
        anisotropy = norm(self.traceless.flatten(-2)) / 2**0.5  # |k1 - k2| / 2
        least = _ROUND * self.mean_curvatures.abs() + _FLAT / self.scales
        doubt = norm(torch.stack([self.doubts, least], dim=-1))
        error = doubt / (2 * torch.where(anisotropy > 0.0, anisotropy, 1.0))
        trusted = (1.0 - (error / _NO_DIRECTION).square()).clamp_min(0.0)
        return torch.where(anisotropy > 0.0, trusted, 0.0)

    def _plane(self) -> Tensor:
        """(*batch, V, 2, 2) in the tangent bases."""
        bases = tangent_bases(self.normals)
        return bases @ self.operators @ bases.mT


@in_single_at_least
def fitted_curvature(
    vertices: Tensor, topology: Topology, *, rings: int | Patches | None = None, at: Tensor | None = None
) -> FittedCurvature:
    r"""Normal and shape operator of the surface at every vertex, by polynomials over rings of vertices.

    The surface around a vertex is a height over its tangent plane, and a polynomial of degree four is fitted to the
    vertices within some rings of edges (osculating jets: Cazals and Pouget, *Estimating differential quantities using
    polynomial fitting of osculating jets*, 2005). The plane is that of a quadratic fit before. Terms of the third
    and fourth degree are weighed by how far they stand out of the noise of the mesh: they follow curvatures that
    change, up to the boundary, and do not follow the noise. From three rings on, patches near the boundary are wider,
    and within two rings of it polynomials are of degree six, where each term is weighed in the principal directions.

    Without noise the error of operators is nearly of the third order in the edge length, on irregular meshes too.
    Creases are rounded over the rings.

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity; any polygons, mixed.
        rings: how many rings around every vertex; or :class:`Patches` of the topology, made before, as
            ``torch.compile`` needs them. By default chosen by the noise that is found: :func:`rings_for_noise`.
        at: (V,) at which vertices curvature is wanted, true or false; at all if left out. Takes no part where patches
            are given, which have their own.

    Returns:
        Tensors of the vertices' dtype, computed in double precision. Operators are zeros where they are not wanted, and
        normals those of :func:`vertex_normals`. Zeros at isolated vertices and where
        :func:`vertex_normals` is zero. Where there are too few vertices for a polynomial, its higher terms are
        small or zero; where a patch has no more than six, directions have no confidence.

    Raises:
        ShapeError: if ``vertices`` is not a floating tensor (*batch, V, 3), or patches are of another mesh.
        SettingsError: if ``rings`` is no number from 2 on.
        TorchfairError: if ``rings`` are to be chosen inside ``torch.func.vmap``.

    Example:
        >>> from torchfair.geometry import fitted_curvature
        >>> from torchfair.shapes import icosphere
        >>> ball = icosphere(2, radius=2.0)
        >>> fit = fitted_curvature(ball.vertices, ball.topology)
        >>> fit.operators.shape
        torch.Size([162, 3, 3])
    """
    topology.check_vertices(vertices)
    if rings is None:
        return _fitted_by_noise(vertices, topology, at)
    patches = rings if isinstance(rings, Patches) else Patches(topology, rings, at=at)
    check_count("rings", patches.rings, least=_LEAST_RINGS)
    if patches.places.shape[0] != topology.num_vertices:
        raise ShapeError("rings", f"patches of {topology.num_vertices} vertices", patches.places.shape[0])
    normals = fitted_normals(vertices, vertex_normals(vertices, topology), patches)
    heights = fitted_heights(vertices, normals, patches, _DEGREE)
    normals, operators, doubts = _forms(heights)
    whole = norm(operators.flatten(-2)).detach()
    doubts = torch.where(patches.sizes > _QUADRATIC, doubts, torch.maximum(doubts, whole))
    normals, operators, doubts, scales = (x.to(vertices.dtype) for x in (normals, operators, doubts, heights.scale))
    return FittedCurvature(normals, operators, doubts, scales, patches.rings)


@in_single_at_least
def rings_for_noise(vertices: Tensor, topology: Topology) -> int:
    """Rings that :func:`fitted_curvature` needs in the noise of a mesh: 2 without, at most 12.

    A fit over two rings says how uncertain curvatures are. The error of second derivatives falls with the third
    power of the size of a patch; chosen is the smallest at which, at half of the vertices, the error is expected to
    be within 2 % of the curvature, unless a fit over so many rings shows that it is no better. The whole batch has
    one number. Without derivatives.

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity; any polygons, mixed.

    Raises:
        ShapeError: if ``vertices`` is not a floating tensor (*batch, V, 3).
        TorchfairError: inside ``torch.func.vmap``, where numbers cannot be read.

    Example:
        >>> from torchfair.geometry import rings_for_noise
        >>> from torchfair.shapes import icosphere
        >>> ball = icosphere(2, radius=2.0)
        >>> rings_for_noise(ball.vertices, ball.topology)
        2
    """
    with torch.no_grad():
        return _fitted_by_noise(vertices.detach(), topology).rings


def _fitted_by_noise(vertices: Tensor, topology: Topology, at: Tensor | None = None) -> FittedCurvature:
    """Over as many rings as :func:`rings_for_noise` says; the fits that tell are those returned."""
    fit = fitted_curvature(vertices, topology, rings=_LEAST_RINGS, at=at)
    least = _relative_doubt(fit, at)
    if not _WANTED < least < math.inf:
        return fit
    wanted = (_LEAST_RINGS + 0.5) * float((least / _WANTED) ** (1 / 3)) - 0.5
    rings = min(max(math.ceil(wanted), _LEAST_RINGS + 1), _MOST_RINGS)
    patches = Patches(topology, rings, at=at)
    wider = fitted_curvature(vertices, topology, rings=patches)
    inner = ~patches.border if at is None else at & ~patches.border  # wide patches are always less uncertain
    where = inner if bool(inner.any()) else at
    return wider if _relative_doubt(wider, where) < _relative_doubt(fit, where) else fit


def _relative_doubt(fit: FittedCurvature, where: Tensor | None = None) -> float:
    """Median of the doubts over the size of the operators, at the vertices ``where`` (V,)."""
    size = norm(fit.operators.detach().flatten(-2)) + _FLAT / fit.scales.detach()
    ratios = fit.doubts.detach() / size
    ratios = (ratios if where is None else ratios[..., where]).flatten()
    try:
        return float(ratios.median()) if ratios.numel() else 0.0
    except RuntimeError as error:
        raise TorchfairError("rings cannot be chosen by the noise inside vmap. Give a number of rings.") from error


def _forms(heights: Heights) -> tuple[Tensor, Tensor, Tensor]:
    """Normals, operators and their doubts from the derivatives of the heights at the centre."""
    first, second, normal = heights.frames.unbind(-2)
    _, fx, fy, xx, xy, yy = heights.coefficients.unbind(-1)
    slope = torch.stack([fx, fy], dim=-1)
    stretch = (1.0 + slope.square().sum(-1)).sqrt()[..., None]
    normals = turned_normals(heights.frames, slope)
    tangents = torch.stack([first + fx[..., None] * normal, second + fy[..., None] * normal], dim=-2)
    # The inverse root of the first fundamental form makes them orthonormal.
    stretch = stretch[..., None]
    root = torch.eye(2, dtype=fx.dtype, device=fx.device) - slope[..., :, None] * slope[..., None, :] / (
        stretch * (1.0 + stretch)
    )
    tangents = root @ tangents
    hessian = torch.stack([torch.stack([2 * xx, xy], dim=-1), torch.stack([xy, 2 * yy], dim=-1)], dim=-2)
    plane = -(root @ hessian @ root) / (stretch * heights.scale[..., None, None])
    doubts = heights.uncertainty.clamp_min(0.0)
    doubts = torch.where(doubts > 0.0, torch.where(doubts > 0.0, doubts, 1.0).sqrt(), 0.0) / 2**0.5 / heights.scale
    return normals, tangents.mT @ plane @ tangents, doubts
