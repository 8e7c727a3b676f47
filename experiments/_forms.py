"""What the form-finding experiments share: boundary curves, surfaces to compare with, and their figures.

The minimal-area surface and the one of least bending (the integral of k1^2 + k2^2, the Willmore energy but for
constants and boundary terms) start like the surface of least C, on the same mesh with the same boundary vertices. A
weak tangential fairness spreads their inner vertices.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence

import numpy as np
import torch
from _common import Report, Results
from scipy.spatial import ConvexHull
from torch import Tensor
from torch.linalg import cross, vector_norm

from torchfair import Topology
from torchfair.constraints import absolute_curvature_terms, tangential_fairness_terms
from torchfair.constraints.absolute_curvature import closed_star, open_star
from torchfair.curves import ClosedCurve
from torchfair.energies import normal_variation, total_absolute_curvature, willmore_energy
from torchfair.formfinding import JobResult, Level, minimise_absolute_curvature
from torchfair.geometry import corner_angles, face_areas
from torchfair.normalisation import Normalisation
from torchfair.projection import ElementTerm, ProjectionSettings, SmoothAbsolute, guided_projection
from torchfair.subdivision import loop

Mesh = tuple[Tensor, Topology]
START, AREA, BENDING, LEAST = "start", "least area", "least bending", "least C"
_TURN = 2.0 * math.pi
_SPREAD = 0.05  # weight of tangential fairness
_SMOOTHING = 1e-3  # areas below it count as zero, in squared mean edge lengths


# ---- boundary curves -----------------------------------------------------------------------------------


def closed_curve(position: Callable[[Tensor], Sequence[Tensor | float]]) -> ClosedCurve:
    """The curve of three coordinates that are functions of an angle from 0 to 2 pi."""

    def point(t: Tensor) -> Tensor:
        return torch.stack([c + torch.zeros_like(t) for c in position(_TURN * t)], dim=1)

    return ClosedCurve.from_function(point)


def circle(radius: float, height: float, *, shift: float = 0.0, tilt: float = 0.0) -> ClosedCurve:
    """A circle moved along x and z, turned by ``tilt`` radians about the line through its centre parallel to y."""

    def point(t: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        across = radius * t.cos()
        return shift + across * math.cos(tilt), radius * t.sin(), height + across * math.sin(tilt)

    return closed_curve(point)


def polygon(corners: Sequence[tuple[float, float, float]], rise: float = 0.0, points: int = 16) -> ClosedCurve:
    """Sides between given corners, each a parabola that rises above its chord by ``rise`` in its middle."""
    ends = torch.tensor(corners, dtype=torch.float64)
    share = torch.arange(points, dtype=torch.float64)[:, None] / points
    sides = [torch.lerp(a, b, share) for a, b in zip(ends, ends.roll(-1, 0), strict=True)]
    lift = 4.0 * rise * share * (1.0 - share) * torch.tensor([0.0, 0.0, 1.0], dtype=torch.float64)
    return ClosedCurve(torch.cat([side + lift for side in sides]), corners=range(0, len(corners) * points, points))


# ---- surfaces to compare with --------------------------------------------------------------------------


def least_area(vertices: Tensor, topology: Topology, iterations: int) -> Tensor:
    """The minimal-area surface with the same boundary vertices."""
    term = ElementTerm("area", _area_vector, [("vertices", topology.triangles)], loss=SmoothAbsolute(_SMOOTHING))
    return _relaxed(vertices, topology, [term], iterations)


def least_bending(vertices: Tensor, topology: Topology, iterations: int) -> Tensor:
    """The surface of least integral of k1^2 + k2^2 with the same boundary vertices."""
    bends = {closed_star: _closed_bend, open_star: _open_bend}
    stars = absolute_curvature_terms(topology, smoothing=1.0)
    terms = [ElementTerm("bending", bends[star.residual], star.stencil) for star in stars]
    return _relaxed(vertices, topology, terms, iterations)


def _relaxed(vertices: Tensor, topology: Topology, terms: list[ElementTerm], iterations: int) -> Tensor:
    normalisation = Normalisation.of(vertices, topology)
    settings = ProjectionSettings(
        max_iterations=iterations, initial_damping=1e-2, damping_scale="identity", merit_tolerance=1e-5
    )
    found = guided_projection(
        {"vertices": normalisation.apply(vertices)},
        [*terms, *tangential_fairness_terms(topology, weight=_SPREAD)],
        fixed={"vertices": topology.is_boundary_vertex},
        settings=settings,
    )
    return normalisation.invert(found.blocks["vertices"])


def _area_vector(x: Tensor) -> Tensor:
    vector: Tensor = 0.5 * cross(x[1] - x[0], x[2] - x[0])
    return vector


def _closed_bend(x: Tensor) -> Tensor:
    """Shape operator of a star over the root of its area, whose square integrates k1^2 + k2^2."""
    spokes = x[1:] - x[0]
    bend: Tensor = closed_star(x) / (vector_norm(cross(spokes, spokes.roll(-1, 0)), dim=1).sum() / 6.0).sqrt()
    return bend


def _open_bend(x: Tensor) -> Tensor:
    spokes = x[1:] - x[0]
    bend: Tensor = open_star(x) / (vector_norm(cross(spokes[:-1], spokes[1:]), dim=1).sum() / 6.0).sqrt()
    return bend


def developable_hull(curves: Sequence[ClosedCurve], points: int = 720) -> Mesh:
    """The convex hull of two curves without the facets in the planes of either curve: a developable strip."""
    places = torch.cat([curve.at(curve.spaced(points)) for curve in curves])
    faces = ConvexHull(places.numpy()).simplices
    faces = faces[np.ptp(faces // points, axis=1) == 1]
    corners = places.numpy()[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = ((corners.mean(1) - places.numpy().mean(0)) * normals).sum(1) < 0
    faces[inward] = faces[inward, ::-1]
    return places, Topology.from_faces(torch.from_numpy(faces.astype(np.int64)), len(places))


# ---- figures -------------------------------------------------------------------------------------------


def figures(vertices: Tensor, topology: Topology) -> Report:
    """C by both estimators, and what the other surfaces minimise."""
    return {
        "total_absolute_curvature": float(total_absolute_curvature(vertices, topology, boundary="extrapolated")),
        "corrected_estimate": float(total_absolute_curvature(vertices, topology, estimator="corrected")),
        "normal_variation": float(normal_variation(vertices, topology)),
        "area": float(face_areas(vertices, topology).sum()),
        "squared_curvature": float(willmore_energy(vertices, topology, density="bending")),
        "willmore_energy": float(willmore_energy(vertices, topology, boundary="extrapolated")),
        "smallest_angle_degrees": math.degrees(float(corner_angles(vertices, topology).min())),
    }


def solve(vertices: Tensor, topology: Topology, **arguments: object) -> tuple[JobResult[Level], Report]:
    """The surface of least C and what it cost."""
    begin, cpu = time.perf_counter(), time.process_time()
    found = minimise_absolute_curvature(vertices, topology, **arguments)  # type: ignore[arg-type]
    times = {"seconds": time.perf_counter() - begin, "cpu_seconds": time.process_time() - cpu}
    steps = [stage.iterations for stage in found.runs]
    return found, times | {"iterations": steps, "message": found.message, "after": found.after}


def compare(
    start: Mesh, curves: Sequence[ClosedCurve], levels: int, iterations: int
) -> tuple[dict[str, Tensor], Topology, Report]:
    """All three surfaces from one start, their mesh, and their figures by name.

    The surface of least C is found coarse to fine; the start of the others is refined at once.
    """
    found, report = solve(*start, curves=curves, levels=levels)
    vertices, topology = start
    for _ in range(levels):
        refinement = loop(topology, boundary="interpolate")
        vertices, topology = refinement.apply(vertices), refinement.topology
    vertices = torch.where(topology.is_boundary_vertex[:, None], found.vertices, vertices)
    surfaces = {
        START: vertices,
        AREA: least_area(vertices, topology, iterations),
        BENDING: least_bending(vertices, topology, iterations),
        LEAST: found.vertices,
    }
    table = {name: figures(surface, topology) for name, surface in surfaces.items()}
    least = table[LEAST]["total_absolute_curvature"]
    others = {name: table[name]["total_absolute_curvature"] for name in (AREA, BENDING)}
    report |= {"vertices": topology.num_vertices, "faces": topology.num_faces, "surfaces": table}
    return surfaces, topology, report | {"saved": {name: 1.0 - least / other for name, other in others.items()}}


def table_line(name: str, report: Report) -> str:
    """C of all surfaces in one line."""
    values = ", ".join(f"{kind} {row['total_absolute_curvature']:.4g}" for kind, row in report["surfaces"].items())
    return f"{name}: C = {values} ({report['vertices']} vertices, {report['seconds']:.1f} s)"


def save_meshes(results: Results, surfaces: dict[str, Tensor], topology: Topology, prefix: str) -> None:
    """One OBJ file for each surface, named by :func:`mesh_files`."""
    for file, surface in zip(mesh_files(prefix), surfaces.values(), strict=True):
        results.mesh(file, surface, topology)


def mesh_files(prefix: str) -> list[str]:
    """Names of the meshes of one boundary."""
    return [f"{prefix}_{name.replace(' ', '_').lower()}.obj" for name in (START, AREA, BENDING, LEAST)]
