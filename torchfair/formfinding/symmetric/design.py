"""A principal-symmetric mesh whose handles are moved, edit after edit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from torch import Tensor

from ...normalisation import Normalisation
from ...principal import PrincipalEdges
from ...principal.principal_edges import PrincipalStars
from ...projection import Callback, ProjectionResult
from ...settings.symmetric_settings import SymmetricSettings
from ...topology import Topology
from ..job import Session
from ..references import GivenReference
from .recipe import SymmetricRecipe


class SymmetricDesign:
    """One level of a design, which answers every edit with a mesh that meets the conditions.

    A thin name for a :class:`~torchfair.formfinding.Session` of a :class:`~torchfair.formfinding.SymmetricRecipe`,
    which follows handles step by step besides.

    Args:
        vertices: (V, 3).
        principal: Which edges are principal; it holds the topology.
        handles: Vertices that are pulled to where they are, until they are moved; others can be moved later too.
        fixed: (V,) bool, vertices that do not move.
        reference: Surface to stay close to: vertices and topology of a mesh, or a function that gives closest points
            and unit normals (:func:`torchfair.geometry.closest_on`).
        on: (n,) vertices where conditions are imposed, by default all regular ones.
        settings: Weights and tolerances.

    Attributes:
        session: Everything compiled for the next edit.

    Raises:
        ShapeError: vertices do not fit the topology.
        MeshError: the mask of fixed vertices does not fit, vertices are not finite, a face has no area, a handle is
            fixed, or there is no star to impose conditions on.
    """

    def __init__(
        self,
        vertices: Tensor,
        principal: PrincipalEdges,
        *,
        handles: Sequence[int] = (),
        fixed: Tensor | None = None,
        reference: GivenReference | None = None,
        on: Tensor | None = None,
        settings: SymmetricSettings | None = None,
    ) -> None:
        recipe = SymmetricRecipe(vertices, principal, fixed=fixed, reference=reference, on=on, settings=settings)
        recipe.pull({vertex: recipe.given[vertex].tolist() for vertex in handles})
        self.session = Session(recipe)

    @classmethod
    def of(cls, session: Session[SymmetricRecipe]) -> SymmetricDesign:
        """A design that edits the mesh of a session."""
        design = cls.__new__(cls)
        design.session = session
        return design

    # ---- what it is ------------------------------------------------------------------------------------

    @property
    def vertices(self) -> Tensor:
        """(V, 3) current state, float64, in the unit of the input."""
        return self.session.vertices

    @property
    def principal(self) -> PrincipalEdges:
        """Which edges are principal."""
        return self.session.recipe.principal

    @property
    def topology(self) -> Topology:
        """Of the mesh."""
        return self.session.recipe.topology

    @property
    def stars(self) -> PrincipalStars:
        """Where conditions are imposed."""
        return self.session.recipe.stars

    @property
    def fixed(self) -> Tensor:
        """(V,) bool, vertices that do not move."""
        return self.session.recipe.stays()

    @property
    def settings(self) -> SymmetricSettings:
        """Weights and tolerances."""
        return self.session.recipe.settings

    @property
    def normalisation(self) -> Normalisation:
        """Between the unit of the input and that of the problem."""
        return self.session.recipe.unit

    @property
    def handles(self) -> Tensor:
        """(n,) vertices that are pulled, ascending."""
        return self.session.recipe.pulls.vertices

    @property
    def targets(self) -> Tensor:
        """(n, 3) where the handles are to be, in the unit of the input."""
        recipe = self.session.recipe
        targets: Tensor = recipe.unit.invert(recipe.pulls.targets[recipe.pulls.vertices])
        return targets

    @property
    def runs(self) -> list[ProjectionResult]:
        """Every run of guided projection so far, in normalised units."""
        return self.session.runs

    def measures(self) -> dict[str, float]:
        """See :func:`~torchfair.formfinding.symmetric_measures`."""
        return self.session.measures()

    def normals(self) -> Tensor:
        """(V, 3) unit normals n(v); see :func:`~torchfair.formfinding.strip_normals`."""
        return self.session.recipe.normals(self.vertices)

    # ---- edits -----------------------------------------------------------------------------------------

    def solve(self, callback: Callback | None = None, *, rounds: int | None = None) -> bool:
        """Meets the conditions near the current state; returns whether it was stopped by callback or Ctrl-C.

        The shape is found with weighted conditions; then they are met exactly, by the shortest way. Where that fails
        it is tried again with handles that pull less: they yield to the conditions. A few saddle sides that come out
        wrong are tried again with a wider margin. The best state found is kept, also after Ctrl-C. Where a callback
        raises any other error, the design is as it was before.

        Args:
            callback: Called with every iteration record; returning True stops.
            rounds: How often that is tried, by default as the settings say.
        """
        self.session.callback, self.session.recipe.rounds = callback, rounds
        try:
            return self.session.solve()
        finally:
            self.session.callback = self.session.recipe.rounds = None

    def move(
        self,
        targets: Mapping[int, Sequence[float]],
        callback: Callback | None = None,
        *,
        rounds: int | None = None,
    ) -> bool:
        """Moves vertices to ``targets``, which makes them handles, and solves; see :meth:`solve`.

        Raises:
            ShapeError: a target is not a point with finite coordinates.
            MeshError: a handle is no vertex, or fixed.
        """
        before = self.session.snapshot()
        try:
            self.session.move(targets)
            return self.solve(callback, rounds=rounds)
        except BaseException:
            self.session.restore(before)
            raise

    def refined(self) -> SymmetricDesign:
        """The design on the mesh refined by Loop subdivision, labels, handles and fixed vertices carried along.

        Vertices keep their places on the boundary and where they are fixed, and fewer and fewer away from there: see
        :func:`~torchfair.subdivision.interpolate_vertices`.
        """
        return SymmetricDesign.of(self.session.refined())
