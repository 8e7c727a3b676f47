"""Removes noise and keeps edges: the nearby mesh of small E (total variation of the normal)."""

from __future__ import annotations

from collections.abc import Mapping

from torch import Tensor

from ...constraints import handle_terms, normal_variation_terms
from ...energies import normal_variation
from ...projection import Callback, ElementTerm
from ...projection.layout import State
from ...settings.denoise_settings import DenoiseSettings
from ...topology import Topology
from ..job import JobResult, Level, OneStage, Promise, Recipe, Stage, solved
from .measures import denoise_measures, denoise_promises
from .neighbourhoods import Neighbourhoods
from .noise import noise_level
from .unfolding import Sides


class DenoiseRecipe(Recipe[DenoiseSettings]):
    """Removes noise; see :func:`denoise`."""

    name = "denoise"

    def __init__(self, vertices: Tensor, topology: Topology, *, settings: DenoiseSettings | None = None) -> None:
        super().__init__(vertices, topology, settings or DenoiseSettings())
        self._near = Neighbourhoods.of(self.topology)
        self._sides = Sides.of(self.start, self.topology, self._near)
        if isinstance(self.settings.noise, str):
            self.noise = noise_level(self.start, self.topology, self._near)
            self.notes.append(f"noise estimated at {self.noise:.3g} mean edge lengths")
        else:
            self.noise = self.settings.noise / self.unit.length

    def plan(self, state: State) -> OneStage:
        """One run."""
        return OneStage(self.follower(state))

    def follower(self, state: State) -> Stage:
        """The same."""
        version = (self.pulls.version, self.settings)
        return Stage("denoise", state, self.terms, version, self.settings.run(self.start.numel()), self.fixed)

    def terms(self) -> list[ElementTerm]:
        """``1/2 sum |x - x_noisy|^2 + strength noise sum (sqrt((l l*)^2 + eps^2) - eps)``, and faces unfold."""
        settings, every = self.settings, (self.topology.valences > 0).nonzero().squeeze(1)
        return [
            *handle_terms(every, self.start[every], weight=1.0, name="displacement"),
            *normal_variation_terms(
                self.topology,
                smoothing=settings.curved_smoothing if settings.curved else settings.smoothing,
                weight=settings.strength * self.noise,
            ),
            *self._sides.unfolding_terms(self.start, self.topology, self.noise, weight=settings.unfolding_weight),
            *self.pulls.terms(weight=settings.handle_weight),
        ]

    def stays(self) -> Tensor:
        """The boundary, where it is fixed."""
        boundary = self.topology.is_boundary_vertex & ~self.pulls.pulled
        return super().stays() | boundary if self.settings.boundary == "fixed" else super().stays()

    def observe(self, state: State) -> dict[str, float]:
        """E, in the unit of the input."""
        return {"normal_variation": self.unit.length * float(normal_variation(self.placed(state), self.topology))}

    def measures(self, vertices: Tensor) -> dict[str, float]:
        """See ``denoise_measures``."""
        return denoise_measures(vertices, self.given, self.topology, self._near, self.noise * self.unit.length)

    def promises(self, before: Mapping[str, float], after: Mapping[str, float]) -> list[Promise]:
        """See ``denoise_promises``."""
        return denoise_promises(before, after)


def denoise(
    vertices: Tensor,
    topology: Topology,
    *,
    settings: DenoiseSettings | None = None,
    callback: Callback | None = None,
) -> JobResult[Level]:
    """Moves the vertices (V, 3) of a noisy mesh as little as gives small E, so that faces are flat and edges sharp.

    Best on bodies of flat and singly curved faces; spheres get small facets, for which there is ``settings.curved``.
    The noise is estimated (:func:`noise_level`) and the result does not depend on the unit of length. Promised: no more
    than a tenth of the faces that arrived flipped are left.

    Raises:
        ShapeError: vertices are not ``(V, 3)``.
        MeshError: vertices are not finite, a face has no area, or the mesh is too small to estimate its noise.

    Example:
        >>> import torch
        >>> from torchfair.formfinding import denoise
        >>> from torchfair.shapes import icosphere
        >>> ball = icosphere(3)
        >>> noise = 0.02 * torch.randn(ball.vertices.shape, generator=torch.manual_seed(0), dtype=torch.float64)
        >>> result = denoise(ball.vertices + noise, ball.topology)
        >>> result.after["normal_variation"] < 0.5 * result.before["normal_variation"]
        True
    """
    return solved(lambda: DenoiseRecipe(vertices, topology, settings=settings), vertices, callback=callback)
