"""Settings of principal meshing."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from .._numbers import check_count, check_number
from ..errors import SettingsError
from .checks import check_angles
from .setting import setting

_SHORTEST = 1 / 16  # smoothing length in edges, where curvature is fitted over two rings


@dataclass(frozen=True)
class MeshingSettings:
    """What :func:`principal_quads` and :func:`principal_triangles` take for a surface. One setting serves all.

    Attributes:
        smoothing: Length over which directions are smoothed, in edge lengths of the new mesh; ``"auto"`` takes
            1/16, and more where there is noise: it grows with the square of the rings, up to one.
        noise: Over how many rings of vertices curvature is fitted, from 2 on; ``"auto"`` finds it by the noise.
        merging: Singular vertices that are closer than this are merged, in edge lengths of the new mesh.
        align_boundary: Whether parts of the boundary that nearly follow a direction become lines of the mesh.
        boundary_angle: How far they, or creases, may turn from the direction, radians.
        corner_angle: Vertices where the boundary or a crease turns by more are corners and stay, radians.
        crease_angle: Edges that bend by more are creases, which are kept, radians; 0 for none.
        adaptive: Whether edges are shorter where the surface bends more, in proportion to ``1 / sqrt|k|`` across a
            curvature k, rather than of one length.
        spacing_range: The longest of these lengths over the shortest, at most.
        curved: Whether vertices lie on a smooth surface through those given, which bends as its curvature is found,
            not on its flat triangles.
        fallback: Whether other settings are tried where these give no valid mesh; what was taken is said.
        time_limit: No other settings are tried after so many seconds of processor time for a component.

    Raises:
        SettingsError: a setting is out of its range; names it.
    """

    smoothing: float | Literal["auto"] = "auto"
    noise: int | Literal["auto"] = "auto"
    merging: float = 1.0
    align_boundary: bool = True
    boundary_angle: float = setting(math.radians(12.0), unit="radians")
    corner_angle: float = setting(math.radians(40.0), unit="radians")
    crease_angle: float = setting(math.radians(40.0), unit="radians")
    adaptive: bool = False
    spacing_range: float = 4.0
    curved: bool = True
    fallback: bool = True
    time_limit: float = setting(40.0, unit="seconds")

    def __post_init__(self) -> None:
        if self.smoothing != "auto":
            check_number("smoothing (or 'auto')", self.smoothing, above=True, finite=True)
        if self.noise != "auto":
            check_count("noise (or 'auto')", self.noise, least=2)
        check_number("merging", self.merging, finite=True)
        check_number("spacing_range", self.spacing_range, least=1, finite=True)
        for name in ("align_boundary", "adaptive", "curved", "fallback"):
            if not isinstance(getattr(self, name), bool):
                raise SettingsError(f"{name} must be True or False, got {getattr(self, name)!r}")
        check_angles(self)
        check_number("boundary_angle", self.boundary_angle, most=math.pi / 4)
        check_number("corner_angle", self.corner_angle, above=True)
        check_number("time_limit", self.time_limit)

    def smoothing_length(self, rings: int) -> float:
        """Over how many edge lengths directions are smoothed, where curvature is averaged over so many rings."""
        if self.smoothing == "auto":
            return min(_SHORTEST * (rings / 2) ** 2, 1.0)
        return float(self.smoothing)
