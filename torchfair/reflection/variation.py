"""Reflection variation: how much the mirrored direction changes over the picture of a mirroring mesh."""

from __future__ import annotations

from typing import Literal, get_args

import torch
from torch import Tensor

from .._loading import safe_to_load
from .._precision import in_single_at_least
from ..energies.base import MeshModule, Reduction, in_words, register
from ..errors import ShapeError, TorchfairError
from ..geometry import dual_edge_lengths
from ..geometry._ops import cross, norm
from ..geometry._unit import in_their_units
from ..geometry.lengths import edge_vectors
from ..geometry.normals import adjacent_normals, normalise
from ..topology import Topology
from .view_directions import axis_directions

Form = Literal["sine", "dual"]


@in_single_at_least
def reflection_variation_per_edge(
    vertices: Tensor,
    topology: Topology,
    directions: Tensor | None = None,
    *,
    form: Form = "sine",
    visibility: Tensor | None = None,
) -> Tensor:
    """What every interior edge adds to the reflection variation in each view: (*batch, n, I).

    Arguments, degenerate cases and errors as for :func:`reflection_variation`.
    """
    _check_form(form)
    topology.check_vertices(vertices)
    vertices, unit = in_their_units(vertices, topology, "interior_edges")
    edges = edge_vectors(vertices, topology)[..., : topology.num_interior_edges, :]
    if directions is None:
        directions = axis_directions(torch.eye(3, dtype=vertices.dtype, device=vertices.device))
    views = view_vectors("directions", directions, vertices)
    views = normalise(views, 0.0)  # a vector of length zero stays zero and sees nothing
    across = squared_cross(views, edges)
    if form == "sine":
        left, right, _ = adjacent_normals(vertices, topology)
        terms = 2 * _root(squared_cross(views, cross(left, right))) * _root(across)
    else:
        lengths = norm(edges)
        # What is divided by a length of zero is zero, with derivative zero.
        densities = 2 * dual_edge_lengths(vertices, topology) / torch.where(lengths > 0, lengths, 1.0)
        terms = across * densities[..., None, :]
    return see(terms * unit[..., None, :], visibility, topology)


def reflection_variation(
    vertices: Tensor,
    topology: Topology,
    directions: Tensor | None = None,
    *,
    form: Form = "sine",
    visibility: Tensor | None = None,
) -> Tensor:
    r"""Total variation of the mirrored direction over the picture that a distant viewer has of a mirroring mesh.

    A plane face with normal ``n`` shows a viewer who looks along ``d`` the single direction
    ``r = d - 2 (d.n) n``. So the picture is piecewise constant, and all its variation sits on the edges::

          r  |  r'      jump:    |r - r'| = 2 |sin a| sin(d, e)     a dihedral angle, (d, e) angle at the edge
             |          length:  l sin(d, e)                        as the viewer sees the edge
             e

    The variation in the view ``d`` is ``sum_e 2 |sin a| l sin^2(d, e)``, the exact total variation of the picture
    inside its outline, if every edge is visible, or counted with its visible share.

    **The mean over all views is the energy of the paper.** With ``form="dual"``, in which ``|sin a|`` is replaced
    by ``|n - n'| = 2 sin(|a|/2)``, the mean over the sphere of views without visibility is exactly ``4/3 E`` (E is
    :func:`torchfair.energies.normal_variation`); ``sin^2`` being quadratic in ``d``, six axis directions are
    enough. With ``form="sine"`` it is ``4/3 sum l |sin a|``.

    Use ``"sine"`` to measure, ``"dual"`` to minimise: mirrors do not see the sign of a normal, so that the
    sine falls beyond 90 degrees, and minimising it folds the mesh. To third order in ``a`` both agree.

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity; any polygons, mixed. Every polygon mirrors by its one normal. Where polygons are
            not planar ``"sine"`` has the exact jump ``2 |d x (n x n')|``.
        directions: (n, 3) or (*batch, n, 3) lines of sight of any length; their sign does not matter. By default
            :func:`axis_directions`.
        form: ``"sine"`` or ``"dual"``.
        visibility: factors that broadcast to (*batch, n, I), the visible share of every interior edge in each
            view, such as from :func:`edge_visibility`; 1 if left out, which counts hidden edges too.

    Returns:
        (*batch, n) >= 0, one value per view (and one for each of joined meshes behind), same unit as the vertices;
        scales with them. Zero with derivative
        zero at flat edges (a kink, a subgradient), at edges along the line of sight, of length zero, on the
        boundary or beside a degenerate face (see :func:`torchfair.geometry.face_normals`), and for directions of
        length zero.

    Raises:
        ShapeError: if a tensor has the wrong shape or is not floating.
        TorchfairError: for an unknown form.
    """
    terms = reflection_variation_per_edge(vertices, topology, directions, form=form, visibility=visibility)
    return topology.sum_per_mesh(terms, "interior_edges")


@safe_to_load
class ReflectionVariation(MeshModule):
    """Mean reflection variation over some views: ``forward(vertices)`` (*batch, V, 3) -> (*batch,).

    With the default views and form this is ``4/3 E``. See :func:`reflection_variation`.

    Args:
        topology: connectivity of all meshes that the module is called with.
        directions: (n, 3) lines of sight, by default :func:`axis_directions`. A buffer.
        form: ``"dual"`` (for minimising) or ``"sine"`` (for measuring).
        visibility: (n, I) visible share of every interior edge in each view, 1 if left out. A buffer.
        reduction: see :class:`~torchfair.energies.MeshModule`.

    Raises:
        ShapeError: if a tensor has the wrong shape or is not floating.
        TorchfairError: for an unknown form.
    """

    directions: Tensor
    visibility: Tensor | None

    def __init__(
        self,
        topology: Topology,
        directions: Tensor | None = None,
        *,
        form: Form = "dual",
        visibility: Tensor | None = None,
        reduction: Reduction = "none",
    ) -> None:
        super().__init__(topology, reduction=reduction)
        _check_form(form)
        directions = axis_directions() if directions is None else directions
        _check_rows("directions", directions)
        _check_visibility(visibility, topology)
        self.form: Form = form
        register(self, "directions", directions)
        register(self, "visibility", visibility)

    @property
    def belongs_to_mesh(self) -> bool:
        """Whether there are visible shares of edges."""
        return self.visibility is not None

    def per_edge(self, vertices: Tensor) -> Tensor:
        """Terms (*batch, I), means over the views; they sum to ``forward(vertices)``."""
        terms = reflection_variation_per_edge(
            vertices, self.topology, self.directions, form=self.form, visibility=self.visibility
        )
        return terms.mean(-2)

    def per_mesh(self, vertices: Tensor) -> Tensor:
        """Mean variation (*batch,) of ``vertices`` (*batch, V, 3)."""
        return self.topology.sum_per_mesh(self.per_edge(vertices), "interior_edges")

    def extra_repr(self) -> str:
        """The topology and the choices in words."""
        words = f"{super().extra_repr()}, {self.directions.shape[-2]} views, form={self.form!r}"
        return words + in_words("visibility", self.visibility)


# ---- shared with the variation seen from a point ---------------------------------------------------------


def view_vectors(name: str, views: Tensor, vertices: Tensor) -> Tensor:
    """``views`` (..., n, 3), checked, in dtype and device of the vertices."""
    _check_rows(name, views)
    return views.to(vertices)


def see(terms: Tensor, visibility: Tensor | None, topology: Topology) -> Tensor:
    """``terms`` (*batch, n, I) times the visible shares."""
    _check_visibility(visibility, topology)
    return terms if visibility is None else terms * visibility.to(terms)


def squared_cross(views: Tensor, vectors: Tensor) -> Tensor:
    """``|d x e|^2`` of all pairs of rows ``d`` of ``views`` (*batch, n, 3) and ``e`` of ``vectors`` (*batch, I, 3).

    Returns (*batch, n, I). As one matrix product, which is three times as fast as cross products of pairs.
    """
    x, y, z = views.unbind(-1)
    zero = torch.zeros_like(x)
    matrices = torch.stack([zero, -z, y, z, zero, -x, -y, x, zero], dim=-1)
    product = matrices.reshape(*views.shape[:-2], -1, 3) @ vectors.mT
    product = product.reshape(*product.shape[:-2], views.shape[-2], 3, vectors.shape[-2])
    return (product * product).sum(-2)


def _root(squares: Tensor) -> Tensor:
    """Square root with value and derivatives zero at zero, where its own derivative is infinite."""
    positive = ~(squares <= 0)
    return torch.where(positive, torch.where(positive, squares, 1.0).sqrt(), 0.0)


def _check_form(form: str) -> None:
    if form not in get_args(Form):
        raise TorchfairError(f'form must be "sine" or "dual", got {form!r}')


def _check_rows(name: str, rows: object) -> None:
    if not isinstance(rows, Tensor):
        raise ShapeError(name, "a floating tensor (n, 3)", type(rows).__name__)
    if rows.dim() < 2 or rows.shape[-1] != 3 or not rows.is_floating_point():
        raise ShapeError(name, "a floating tensor (n, 3)", f"{tuple(rows.shape)} {rows.dtype}")


def _check_visibility(visibility: Tensor | None, topology: Topology) -> None:
    if visibility is None:
        return
    if visibility.shape[-1:] != (topology.num_interior_edges,) or not visibility.is_floating_point():
        expected = f"a floating tensor (n, {topology.num_interior_edges}), one share per view and interior edge"
        raise ShapeError("visibility", expected, f"{tuple(visibility.shape)} {visibility.dtype}")
