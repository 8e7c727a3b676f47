"""Paper Fig. 12: a mesh pulled at handles, guided by fairness alone and by fairness together with E.

The mesh has the size of the paper's: an annulus of 189 vertices, 525 edges and 336 triangles. It starts as a dome
with an opening; the designer pulls both boundary curves onto a saddle (all their vertices are handles). Without E
(``energy_weight = 0``) only the fairness functional shapes the mesh; everything else is the same.

The Gauss image of the star of a vertex, its normal pyramid, is a spherical polygon whose signed area is the angle
defect. Where a pyramid intersects itself, a part of it runs the other way round. The *folded solid angle* is the sum
over all inner vertices of that part: the smaller of the areas with positive and with negative winding number. It is
zero if and only if no pyramid covers areas of both signs.

Besides the mesh that is drawn, whose rings are turned against each other by one cell (right triangles), a symmetric
lattice on a wider annulus is tried, both with several weights of E.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import torch
from _charts import BLUE, ORANGE, add_chart, add_legend
from _common import ExperimentConfig, Report, Results, run_experiment, setting
from torch import Tensor

from torchfair import Topology
from torchfair.energies import angle_variation, normal_variation
from torchfair.formfinding import FairSettings, JobResult, Level, minimise_normal_variation
from torchfair.geometry import dihedral_angles, gauss_image
from torchfair.viewing import EdgeStyle, MeshView, fit_camera, view_direction
from torchfair.viewing.shading import shade_faces
from torchfair.viewing.sheet import CAPTION, GAP, MARGIN, Sheet, points
from torchfair.viewing.sphere import draw_arcs, draw_points, draw_sphere, fit_sphere_view

if TYPE_CHECKING:
    from matplotlib.axes import Axes

NAME = "fig12_handles"
PICTURE, CHART = "handles.png", "weights.png"
MESHES = ("initial.obj", "without_energy.obj", "with_energy.obj")
Mesh = tuple[Tensor, Topology]

LATTICES = {"sheared": (3.0, 1.0), "symmetric": (5.0, 0.5)}
"""Outer over inner radius, and turn of each ring against the next in cells."""

FOLDED = 1e-4  # steradians from which on a pyramid counts as folded


@dataclass(frozen=True)
class Config(ExperimentConfig):
    """Settings of the experiment."""

    around: int = setting(21, "vertices on every ring", least=6)
    rings: int = setting(9, "rings of vertices, both boundaries included", least=3)
    rise: float = setting(0.4, "height of the dome, in outer radii")
    pull: float = setting(1 / 3, "largest height of the saddle that handles are pulled to, in outer radii")
    energy_weight: float = setting(0.03, "weight of E in the drawn result", least=0)
    fairness_weight: float = setting(1.0, "weight of fairness, with and without E", least=0)
    weights: tuple[float, ...] = setting((0.003, 0.01, 0.03, 0.1, 0.3, 1.0), "weights of E to try", least=0)
    lattices: tuple[str, ...] = setting(
        tuple(LATTICES), "connectivities to try; the first is drawn", choices=tuple(LATTICES)
    )
    samples: int = setting(96, "grid lines across a normal pyramid, for its area", least=8)


# ---- the mesh and its handles --------------------------------------------------------------------------


def dome(config: Config, ratio: float, shear: float) -> Mesh:
    """An annulus with radii 1 to ``ratio`` in geometric progression, each ring turned by ``shear`` cells."""
    ring = torch.arange(config.rings, dtype=torch.float64)[:, None]
    radius = ratio ** (ring / (config.rings - 1))
    angle = (torch.arange(config.around) + shear * ring) * (2 * math.pi / config.around)
    height = config.rise * ratio * (1 - ((radius - 1) / (ratio - 1)) ** 2)
    vertices = torch.stack([radius * angle.cos(), radius * angle.sin(), height.expand_as(angle)], dim=-1)
    index = torch.arange(config.around * config.rings).view(config.rings, config.around)
    a, b = index[:-1], index[1:]  # the vertex of the next ring lies between two of this one
    a_next, b_next = a.roll(-1, 1), b.roll(-1, 1)
    faces = [torch.stack(corners, dim=-1).reshape(-1, 3) for corners in ((a, b, a_next), (b, b_next, a_next))]
    return vertices.reshape(-1, 3), Topology.from_faces(torch.cat(faces))


def saddle_handles(vertices: Tensor, topology: Topology, pull: float) -> dict[int, list[float]]:
    """Targets of all boundary vertices: straight up or down onto the saddle ``z = pull (x^2 - y^2) / R``."""
    size = float(vertices[:, :2].norm(dim=1).max())
    handles = {}
    for vertex in topology.loop_vertices.tolist():
        x, y, _ = vertices[vertex].tolist()
        handles[vertex] = [x, y, pull * (x**2 - y**2) / size]
    return handles


def pulled(mesh: Mesh, config: Config, energy_weight: float) -> JobResult[Level]:
    """The mesh after the handles have been pulled."""
    settings = FairSettings(
        energy_weight=energy_weight,
        fairness_weight=config.fairness_weight,
        boundary="free",  # all boundary vertices are handles
        flat="none",  # pairs of triangles are coplanar at the start by symmetry, and are no panels
        smallest_angle=math.radians(5),  # the shape changes a lot: only collapse is forbidden
        smallest_area=0.05,
        faces_may_turn=True,  # a dome becomes a saddle
    )
    settings = replace(settings, projection=replace(settings.projection, max_iterations=200, merit_tolerance=1e-6))
    handles = saddle_handles(*mesh, config.pull)
    return minimise_normal_variation(*mesh, handles=handles, settings=settings)


# ---- normal pyramids -----------------------------------------------------------------------------------


def pyramid_areas(vertices: Tensor, topology: Topology, samples: int) -> tuple[Tensor, Tensor]:
    """Solid angles (n,) of the normal pyramids of inner vertices with positive and with negative winding number.

    Each region counts as often as the polygon winds around it. Positive minus negative is the angle defect.
    """
    parts = []
    for centres, ring in topology.rings_by_valence.values():
        arms = vertices[ring] - vertices[centres][:, None]
        normals = torch.nn.functional.normalize(torch.linalg.cross(arms, arms.roll(-1, 1)), dim=-1)
        parts.append(_winding_areas(*_gnomonic(normals), samples))
    positive, negative = zip(*parts, strict=True)
    return torch.cat(positive), torch.cat(negative)


def _gnomonic(normals: Tensor) -> tuple[Tensor, Tensor]:
    """Polygons (n, k, 2) in the planes that touch the sphere at the mean normals: great circles become lines.

    Also a mask (n,) of the pyramids that fit in an open half-sphere; the others are replaced by points.
    """
    axis = torch.nn.functional.normalize(normals.sum(1), dim=-1)
    side = torch.eye(3, dtype=normals.dtype)[axis.abs().argmin(1)]
    right = torch.nn.functional.normalize(torch.linalg.cross(axis, side), dim=-1)
    up = torch.linalg.cross(axis, right)
    height = (normals * axis[:, None]).sum(-1)
    fits = (height > 0.02).all(1)
    flat = torch.stack([(normals * right[:, None]).sum(-1), (normals * up[:, None]).sum(-1)], dim=-1)
    return torch.where(fits[:, None, None], flat / height.clamp_min(0.02)[..., None], 0.0), fits


def _winding_areas(polygons: Tensor, fits: Tensor, samples: int) -> tuple[Tensor, Tensor]:
    """Midpoint rule on a grid over each polygon; NaN where a pyramid does not fit in a half-sphere."""
    low, high = polygons.amin(1), polygons.amax(1)
    steps = (torch.arange(samples, dtype=polygons.dtype) + 0.5) / samples
    grid = low[:, None] + (high - low)[:, None] * steps[:, None]
    x, y = grid[:, :, None, 0], grid[:, None, :, 1]
    winding = torch.zeros(len(polygons), samples, samples, dtype=torch.int64)
    for start, stop in zip(polygons.unbind(1), polygons.roll(-1, 1).unbind(1), strict=True):
        (x0, y0), (x1, y1) = (end[:, :, None, None].unbind(1) for end in (start, stop))
        left = (x1 - x0) * (y - y0) - (x - x0) * (y1 - y0)
        winding += ((y0 <= y) & (y < y1) & (left > 0)).long() - ((y1 <= y) & (y < y0) & (left < 0)).long()
    cell = (high - low).prod(1)[:, None, None] / samples**2 / (1 + x**2 + y**2) ** 1.5
    positive, negative = ((sign * winding).clamp_min(0) * cell for sign in (1, -1))
    nan = torch.full_like(low[:, 0], math.nan)
    return tuple(torch.where(fits, part.sum((1, 2)), nan) for part in (positive, negative))  # type: ignore[return-value]


def measure(vertices: Tensor, topology: Topology, samples: int) -> Report:
    """Energies, the largest angle, and the Gauss image in numbers."""
    positive, negative = pyramid_areas(vertices, topology, samples)
    folded = torch.minimum(positive, negative)
    angles = dihedral_angles(vertices, topology).abs()
    return {
        "normal_variation": float(normal_variation(vertices, topology)),
        "angle_variation": float(angle_variation(vertices, topology)),
        "largest_dihedral_angle_degrees": math.degrees(float(angles.max())),
        "sum_of_dihedral_angles": float(angles.sum()),
        "solid_angle_of_pyramids": float(torch.maximum(positive, negative).nansum()),
        "folded_solid_angle": float(folded.nansum()),
        "folded_pyramids": int((folded > FOLDED).sum()),
        "pyramids_beyond_a_half_sphere": int(folded.isnan().sum()),
    }


# ---- pictures ------------------------------------------------------------------------------------------


def draw_meshes(
    meshes: dict[str, Tensor], measured: list[Report], topology: Topology, config: Config, results: Results
) -> None:
    """Above the meshes, below their Gauss images; handles are the red boundary curves."""
    first = next(iter(meshes.values()))
    towards_eye, up = view_direction(first, topology)
    panel = (config.width - 2 * MARGIN - 2 * GAP) // 3
    camera, size = fit_camera(*meshes.values(), towards_eye=towards_eye, up=up, width=panel)
    sheet = Sheet(config.width, 2 * CAPTION + size[0] + panel + 3 * MARGIN)
    images = [gauss_image(vertices, topology) for vertices in meshes.values()]
    vertical = torch.tensor([0.0, 0, 1], dtype=torch.float64)
    sphere = fit_sphere_view(*(image.points for image in images), towards_eye=vertical, up=towards_eye)
    below = CAPTION + size[0] + MARGIN
    for column, (name, vertices) in enumerate(meshes.items()):
        left, report, image = MARGIN + column * (panel + GAP), measured[column], images[column]
        sheet.caption(f"{name}:  $E$ = {report['normal_variation']:.4g}", left, 0, panel)
        mesh = MeshView(vertices, topology, camera, size)
        sheet.image(mesh.paint(shade_faces(vertices, topology, camera), edges=_handle_edges(mesh)), left, CAPTION)
        words = f"folded {report['folded_solid_angle']:.3f} of {report['solid_angle_of_pyramids']:.2f} sr"
        sheet.caption(words, left, below, panel)
        axes = sheet.axes(left, below + CAPTION, panel, panel)
        draw_sphere(axes, sphere)
        draw_arcs(axes, sphere, image.points, image.arcs, points(1.5), 0.85)
        draw_points(axes, sphere, image.points, points(4.5))
    sheet.write(results.path(PICTURE), overwrite=results.force)


def _handle_edges(mesh: MeshView) -> EdgeStyle:
    """Thin dark edges, and the boundary strong and red."""
    topology = mesh.topology
    boundary = torch.arange(topology.num_edges) >= topology.num_interior_edges
    red, ink = torch.tensor([0.80, 0.20, 0.05]), torch.tensor([0.15, 0.18, 0.24])
    return EdgeStyle(torch.where(boundary[:, None], red, ink), torch.where(boundary, 3.5, 0.8))


def draw_weights(lattices: dict[str, dict[str, Report]], results: Results) -> None:
    """E, the sum of angles and the folded solid angle over the weight of E."""
    sheet = Sheet(1900, 640)
    charts = {
        "normal_variation": ("$E$ over that without $E$", True),
        "sum_of_dihedral_angles": (r"$\sum|\alpha|$ over that without $E$", True),
        "folded_solid_angle": ("folded solid angle in msr", False),
    }
    for column, (key, (title, relative)) in enumerate(charts.items()):
        axes = add_chart(sheet, 100 + column * 620, 80, 520, 440, title=title, x="weight of $E$")
        for (name, rows), color, marker in zip(lattices.items(), (BLUE, ORANGE), "os", strict=False):
            _draw_series(axes, rows, key, relative, color, marker, name)
        axes.set_ylim(bottom=0)
        if column == 2:
            add_legend(axes, loc="upper right")
    sheet.write(results.path(CHART), overwrite=results.force)


def _draw_series(
    axes: Axes, rows: dict[str, Report], key: str, relative: bool, color: str, marker: str, name: str
) -> None:
    """One lattice; the value without E stands at the left end of the axis, named 0."""
    weights = sorted(float(weight) for weight in rows)
    values = [rows[f"{weight:g}"][key] for weight in weights]
    scaled = [value / values[0] if relative else 1000 * value for value in values]
    places = range(len(weights))
    axes.plot(places, scaled, color=color, marker=marker, markersize=6, linewidth=1.8, label=f"{name} lattice")
    axes.set_xticks(places, [f"{weight:g}" for weight in weights])


# ---- experiment ----------------------------------------------------------------------------------------


def experiment(config: Config, results: Results) -> Report:
    """Pulls, measures, draws, and prints what came out."""
    lattices: dict[str, dict[str, Report]] = {}
    found: dict[float, Tensor] = {}
    for name in config.lattices:
        mesh = dome(config, *LATTICES[name])
        lattices[name] = {}
        for weight in sorted({0.0, config.energy_weight, *config.weights}):
            result = pulled(mesh, config, weight)
            row = measure(result.vertices, mesh[1], config.samples)
            row["status"], row["iterations"] = result.projection.status, result.projection.iterations
            row["largest_handle_distance"] = result.after["largest_handle_distance"]
            lattices[name][f"{weight:g}"] = row
            print(
                f"{name}, weight of E {weight:g}: E {row['normal_variation']:.4g}, sum of angles "
                f"{row['sum_of_dihedral_angles']:.4g}, folded {1000 * row['folded_solid_angle']:.3g} msr in "
                f"{row['folded_pyramids']} pyramids"
            )
            if name == config.lattices[0] and weight in (0.0, config.energy_weight):
                found[weight] = result.vertices
    return _report(config, lattices, found, results)


def _report(
    config: Config, lattices: dict[str, dict[str, Report]], found: dict[float, Tensor], results: Results
) -> Report:
    """Draws what was ``found`` for the first lattice without and with E."""
    vertices, topology = dome(config, *LATTICES[config.lattices[0]])
    meshes = {"initial": vertices, "without $E$": found[0.0], "with $E$": found[config.energy_weight]}
    for file, positions in zip(MESHES, meshes.values(), strict=True):
        results.mesh(file, positions, topology)
    initial = measure(vertices, topology, config.samples)
    rows = lattices[config.lattices[0]]
    drawn = [initial, rows["0"], rows[f"{config.energy_weight:g}"]]
    draw_meshes(meshes, drawn, topology, config, results)
    draw_weights(lattices, results)
    counts = {"vertices": topology.num_vertices, "edges": topology.num_edges, "faces": topology.num_faces}
    return {"counts": counts, "initial": initial, "by_weight": lattices}


def main(arguments: list[str] | None = None) -> int:
    """The experiment from the command line."""
    return run_experiment(NAME, __doc__, Config, experiment, [PICTURE, CHART, *MESHES], arguments)


if __name__ == "__main__":
    sys.exit(main())
