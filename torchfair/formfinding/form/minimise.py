"""The job: C becomes small, the boundary is given."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from torch import Tensor

from ...curves import ClosedCurve
from ...errors import SettingsError
from ...projection import Callback
from ...settings.form_settings import FormSettings
from ...topology import Topology
from ..job import JobResult, Level, solved
from .recipe import FormRecipe


def minimise_absolute_curvature(
    vertices: Tensor,
    topology: Topology,
    *,
    curves: Sequence[ClosedCurve] | None = None,
    normals: Tensor | None = None,
    handles: Mapping[int, Sequence[float]] | None = None,
    fixed: Iterable[int] = (),
    levels: int = 0,
    starts: int = 1,
    remesh: bool = False,
    settings: FormSettings | None = None,
    callback: Callback | None = None,
) -> JobResult[Level]:
    """Moves the vertices of a surface so that C, the integral of ``|k1| + |k2|``, becomes small.

    Boundary vertices keep their places or glide on the boundary curves. With ``levels`` the result is refined
    and improved again: Loop subdivision for triangle meshes, Catmull-Clark for others; new boundary vertices
    lie on the curves. Faces that are not triangles are seen as triangles, cut by diagonals, while C is lowered.
    The merit never increases within a stage. The problem is solved centred and with unit mean edge length, so
    results do not depend on the unit.

    Minimisers are not unique: the start decides, among other things, between a cone and two cones tip to tip. So it
    is worth trying several (``starts``).

    Promises, which are measured on the result (:attr:`~torchfair.formfinding.JobResult.promises`): the boundary is on
    its curves; handles are within 0.05 mean edges of their targets; prescribed tangent planes are met within a degree;
    no more faces are folded than at the start; E is at most three times C, no dihedral angle above 150 degrees, and no
    two faces run through each other, since C does not see folds; no corner angle falls below ``settings.least_angle``
    or half the smallest of the start; and C is not above that of the start, unless handles, normals or curves that the
    boundary is moved onto ask for a different shape.

    Args:
        vertices: (V, 3) start.
        topology: Connectivity, with or without boundary.
        curves: One for each boundary loop, by default smooth curves through its vertices. The boundary is moved
            onto given curves first.
        normals: (V, 3) prescribed normals of the surface at boundary vertices, of any length; zero where none is.
            They point to the side from which faces run counterclockwise.
        handles: Places to pass through, by vertex number.
        fixed: Numbers of vertices that stay where they are.
        levels: How often to refine.
        starts: From how many surfaces to start, the given one first: others have its boundary and connectivity and lie
            on its convex hull, above and below, are bumped up and down, of least area, or have random bumps. The best
            is refined; all are listed with their C in the notes. Where a handle is farther than a mean edge from its
            vertex, the surface is also made to follow it in small steps.
        remesh: Whether the triangles may be replaced where a promise is not kept: the surface is given even ones
            between the same boundary vertices, and the job goes on from there, four times at most, until all promises
            are kept; else the one with fewest broken promises is the result. Vertices have other numbers then.
        settings: Weights, smoothing and tolerances.
        callback: Called with every iteration record, whose quantities hold ``total_absolute_curvature``; returning
            True stops. Ctrl-C, or a function that raises KeyboardInterrupt, returns the best mesh so far, on the finest
            level on which a step was taken.

    Returns:
        One level for each refinement, and the first. ``before`` of the first is that of the input.

    Raises:
        ShapeError: vertices or normals are not ``(V, 3)``, or a handle is not a point.
        MeshError: vertices are not finite, a face has no area, the mesh is closed, curves cross or do not fit the
            boundary, a handle is no vertex or pulls a vertex of the boundary that stays, or a fixed vertex is none or
            pulled.
        SettingsError: ``starts`` is below 1, or above 1 with fixed vertices, which others would not hold, or ``remesh``
            is asked for a mesh that has other faces than triangles.

    Example:
        >>> import math
        >>> import torch
        >>> from torchfair.curves import ClosedCurve
        >>> from torchfair.formfinding import minimise_absolute_curvature, start_surface
        >>> turn = torch.linspace(0, 2 * math.pi, 25)[:-1].double()
        >>> curve = ClosedCurve(torch.stack([turn.cos(), turn.sin(), 0.3 * torch.cos(2 * turn)], dim=1))
        >>> vertices, topology = start_surface([curve], 60)
        >>> result = minimise_absolute_curvature(vertices, topology, curves=[curve])
        >>> result.after["total_absolute_curvature"] < result.before["total_absolute_curvature"]
        True
    """
    if starts < 1:
        raise SettingsError(f"starts must be at least 1, got {starts}")
    stay = list(fixed)
    if stay and starts > 1:
        raise SettingsError(
            f"fixed vertices stay on the surface that is given: starts must be 1 with them, got {starts}"
        )
    if remesh and not topology.is_triangular:
        raise SettingsError("remesh replaces triangles, and the mesh has other faces: cut these, or leave remesh out")

    def begin() -> FormRecipe:
        return FormRecipe(
            vertices, topology, curves=curves, normals=normals, handles=handles, settings=settings, starts=starts,
            remesh=remesh, fixed=stay,
        )  # fmt: skip

    return solved(begin, vertices, levels=levels, callback=callback)
