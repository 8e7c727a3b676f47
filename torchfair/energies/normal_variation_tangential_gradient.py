"""How far a mesh is from having stationary E on a surface: the tangential part of the gradient."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.autograd.forward_ad import unpack_dual

from .._precision import in_single_at_least
from .._tracing import is_recorded, is_transformed
from ..errors import ShapeError
from ..topology import Topology
from .normal_variation import normal_variation_per_edge


@in_single_at_least
def normal_variation_tangential_gradient(
    vertices: Tensor, normals: Tensor, topology: Topology, edge_weights: Tensor | None = None
) -> Tensor:
    r"""Parts of the gradient of E tangential to a reference surface, at every vertex: ``g - (g . n) n``.

    Among meshes whose vertices lie on a smooth surface those of least E have a gradient that is orthogonal to it
    (paper, section 3.2): all these vectors vanish at vertices that are free to move along the surface. They vanish in
    the limit wherever edges follow smooth curves on the surface (ideal case I: the star of a vertex is nearly symmetric
    with respect to a half-turn about the normal). Measured against the pulls of single edges, the sum of ``l*`` around
    the vertex, which have order 1 in the edge length: of order 2 and more on principal quads, of order 1 on other
    meshes along smooth curves, and not falling on irregular meshes (0.5 to 0.7 of the pulls).

    Flat edges are left out, as they are from the gradient: bending them raises E whichever way vertices move (ideal
    case II, :func:`normal_variation_derivative`). A *nearly* flat edge, such as the diagonal that cuts a nearly planar
    quad, counts in full.

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        normals: unit normals (V, 3) or (*batch, V, 3) of the surface at its points nearest to the vertices, for
            instance ``surface.closest(vertices).smooth_normals`` of a :class:`torchfair.geometry.ReferenceSurface`.
            Where a normal is zero the whole gradient is given.
        topology: connectivity; any polygons, mixed.
        edge_weights: (I,) or (*batch, I) factors of the terms of E, 1 if left out.

    Returns:
        (*batch, V, 3), dimensionless: length of E per length moved, unchanged by scaling, and turning with the mesh.
        They are orthogonal to the normals. Nothing is known about vertices on the boundary, whose stars are
        incomplete: they are not stationary even on the best mesh. Differentiable as the gradient of E is.

    Raises:
        ShapeError: if ``vertices``, ``normals`` or ``edge_weights`` has the wrong shape or is not floating.

    Example:
        >>> from torchfair.energies import normal_variation_tangential_gradient
        >>> from torchfair.shapes import icosphere
        >>> sphere = icosphere(0)  # an icosahedron: every star has more symmetry than needed
        >>> part = normal_variation_tangential_gradient(sphere.vertices, sphere.vertices, sphere.topology)
        >>> bool(part.abs().max() < 1e-12)
        True
    """
    topology.check_vertices(vertices)
    _check_normals(normals, vertices)
    gradient = _gradient(vertices, topology, edge_weights)
    normals = normals.to(gradient.dtype)
    return gradient - (gradient * normals).sum(-1, keepdim=True) * normals


def _gradient(vertices: Tensor, topology: Topology, edge_weights: Tensor | None) -> Tensor:
    """The gradient of E, followed by whatever follows its arguments.

    Where nothing does, by plain autograd: ``torch.func.grad`` loads the compiler of torch, which takes a second.
    """

    def energy(points: Tensor) -> Tensor:
        return normal_variation_per_edge(points, topology, edge_weights).sum()

    if not _is_followed(vertices, edge_weights):
        with torch.enable_grad():
            points = vertices.detach().requires_grad_()
            return torch.autograd.grad(energy(points), points)[0]
    gradient: Tensor = torch.func.grad(energy)(vertices)
    return gradient


def _is_followed(vertices: Tensor, edge_weights: Tensor | None) -> bool:
    """Whether autograd, dual numbers, a transform or a recording wants to know where the gradient comes from."""
    inputs = [vertices] if edge_weights is None else [vertices, edge_weights]
    return (
        is_transformed()
        or is_recorded()
        or torch.is_inference_mode_enabled()
        or any(t.is_inference() or t.requires_grad or _is_dual(t) for t in inputs)
    )


def _is_dual(numbers: Tensor) -> bool:
    tangent: Tensor | None = unpack_dual(numbers).tangent  # type: ignore[no-untyped-call]
    return tangent is not None


def _check_normals(normals: Tensor, vertices: Tensor) -> None:
    fits = isinstance(normals, Tensor) and normals.is_floating_point()
    shapes = (vertices.shape[-2:], vertices.shape)
    if not fits or normals.shape not in shapes:
        actual = f"{tuple(normals.shape)} {normals.dtype}" if isinstance(normals, Tensor) else type(normals).__name__
        raise ShapeError("normals", f"a floating tensor {tuple(shapes[0])} or {tuple(shapes[1])}", actual)
