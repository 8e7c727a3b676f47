"""A job as a layer: the finished mesh is a differentiable function of what the job was given."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Unpack

import torch
from torch import Tensor, nn

from ..._numbers import check_count, check_number
from ...errors import ShapeError
from ...projection.implicit import BackwardOptions, BackwardRule
from ..job import Recipe
from ..job.compiled_problems import CompiledProblems
from .finished import Finish, FinishedMesh, JobLayerInfo, copied


class JobLayer(nn.Module):
    r"""Does a job; the finished mesh is a differentiable function of the *parameters* of the job.

    The job is done as always (or started near its end) and its mesh brought to a minimum of what its last stage lowers:
    the merit of :class:`FairRecipe` with the sharp absolute value, that of :class:`FormRecipe` in space with the last
    smoothing, of :class:`SymmetricRecipe` the best shape among those that meet the conditions. Jobs stop a little
    before; so meshes differ from theirs, by hundredths to tenths of an edge. There derivatives follow from the implicit
    function theorem, see :class:`~torchfair.projection.ProjectionLayer`. Everything is in the unit of the input;
    weights are dimensionless.

    Parameters, by name, any number of them:

    - ``targets`` (h, 3): where handles of the recipe are pulled, in the order of their vertex numbers;
    - ``vertices`` (V, 3): the start. Of it those points count that stay where they are, such as a fixed boundary; to
      others the gradient is zero;
    - ``reference`` (R, 3): vertices of the reference mesh. Closest points follow them and the mesh;
    - weights of the settings by their names, such as ``fairness_weight`` (), above 0.

    Constant are: the unit that weights refer to, which is the mean edge length of the start of the recipe; what bounds
    of angles and areas are measured by; for C the smoothing and the even part of fairness, which are seen from where
    the job ends, or from ``start``; which stars are to be saddles. So a change of parameters that is followed by the
    whole job, not by ``start``, may end elsewhere.

    Args:
        recipe: The job; it is copied.
        tolerance: The mesh is at its minimum where the next Newton step is shorter than this, relative to the extent.
        steps: Most steps with exact second derivatives on the way there.
        options: Of the backward pass, see :class:`~torchfair.projection.BackwardRule`.

    Raises:
        SettingsError: an option is out of range, or the job does not end in a minimum.

    Example:
        >>> import torch
        >>> from torchfair.formfinding import FairRecipe, FairSettings, JobLayer
        >>> from torchfair.shapes import Paraboloid, parameter_quads
        >>> mesh = parameter_quads(Paraboloid(1.0, -1.0), 6, 6)
        >>> settings = FairSettings(boundary="fixed", smoothing=0.1)
        >>> layer = JobLayer(FairRecipe(mesh.vertices, mesh.topology, handles={24: (0.0, 0.0, 0.3)}, settings=settings))
        >>> targets = torch.tensor([[0.0, 0.0, 0.3]], dtype=torch.float64, requires_grad=True)
        >>> vertices, info = layer({"targets": targets})
        >>> vertices[:, 2].mean().backward()
        >>> bool(targets.grad[0, 2] > 0.0)
        True
    """

    def __init__(
        self,
        recipe: Recipe[Any],
        *,
        tolerance: float = 1e-7,
        steps: int = 100,
        **options: Unpack[BackwardOptions],
    ) -> None:
        super().__init__()
        self.rule = BackwardRule(**options)
        check_count("steps", steps, least=1)
        check_number("tolerance", tolerance, above=True, finite=True)
        self.finish = Finish(tolerance, steps, self.rule.products)
        self._recipe, self._problems = copied(recipe), CompiledProblems()
        trial = copied(recipe)
        trial.final(trial.state())

    if TYPE_CHECKING:  # torch says Any

        def __call__(
            self, parameters: Mapping[str, Tensor] | None = None, *, start: Tensor | None = None
        ) -> tuple[Tensor, JobLayerInfo | list[JobLayerInfo]]:
            """What ``forward`` gives."""
            ...

    def forward(
        self, parameters: Mapping[str, Tensor] | None = None, *, start: Tensor | None = None
    ) -> tuple[Tensor, JobLayerInfo | list[JobLayerInfo]]:
        """The finished mesh.

        Args:
            parameters: By name; what is not named is as in the recipe. Or all with one leading batch dimension.
            start: (V, 3) a mesh near the finished one, such as the one before: only the last stage is done then, from
                there. By default the whole job is. ``(batch, V, 3)`` for a batch.

        Returns:
            Vertices (V, 3), or ``(batch, V, 3)``, in dtype and on the device of the first parameter (float64 without
            any), and :class:`JobLayerInfo`, a list of them for a batch.

        Raises:
            SettingsError, ShapeError: there is no such parameter, or it does not fit.
            DerivativeError: derivatives are asked for where they mean nothing; names the condition that failed. Second
                derivatives are refused when they are asked for.
        """
        parameters = dict(parameters or {})
        count = self._members(parameters, start)
        if count is None:
            return self._solved(parameters, start)
        members = [
            self._solved({name: value[i] for name, value in parameters.items()}, None if start is None else start[i])
            for i in range(count)
        ]
        if not members:
            return next(iter(parameters.values())).new_zeros(0, *self._recipe.given.shape), []
        return torch.stack([vertices for vertices, _ in members]), [info for _, info in members]

    def _members(self, parameters: Mapping[str, Tensor], start: Tensor | None) -> int | None:
        """How many, None for one without a batch dimension."""
        given = {**parameters, **({} if start is None else {"start": start})}
        extra = {name: value.ndim - (0 if name.endswith("_weight") else 2) for name, value in given.items()}
        if not any(number == 1 for number in extra.values()):
            return None
        sizes = {value.shape[0] if value.ndim else 0 for value in given.values()}
        if set(extra.values()) != {1} or len(sizes) != 1 or not parameters:
            shapes = {name: tuple(value.shape) for name, value in given.items()}
            raise ShapeError("parameters and start", "all with one leading batch dimension, or none with", shapes)
        return sizes.pop()

    def _solved(self, parameters: dict[str, Tensor], start: Tensor | None) -> tuple[Tensor, JobLayerInfo]:
        mesh = FinishedMesh(copied(self._recipe), parameters, start, self.finish, self._problems)
        wanted = torch.is_grad_enabled() and any(value.requires_grad for value in parameters.values())
        if wanted and mesh.info.point.fault:
            self.rule.complain(mesh.info.point.fault)
        vertices = mesh.as_function_of(parameters, self.rule) if wanted else mesh.vertices
        return vertices.to(next(iter(parameters.values()), vertices)), mesh.info
