"""Principal-symmetric designs: handles, levels, strips, and pictures of them."""

from __future__ import annotations

import itertools
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import torch
from _common import Report, Results
from torch import Tensor

from torchfair import Topology
from torchfair.cameras import Camera
from torchfair.formfinding import SymmetricDesign, strip_normals
from torchfair.geometry import edge_lengths
from torchfair.principal import (
    DevelopableStrips,
    PrincipalEdges,
    developable_strips,
    save_strips_obj,
    save_strips_svg,
    strip_limits,
)
from torchfair.shapes import ShapeMesh
from torchfair.viewing import EdgeStyle, MeshView, ViewDirection, fit_camera
from torchfair.viewing.shading import FRONT, shade_faces
from torchfair.viewing.sheet import CAPTION, GAP, MARGIN, Sheet, points
from torchfair.viewing.wireframe import line_width

Handles = dict[int, list[float]]
TALLEST = 0.6  # of the height at which rulings meet
_STRIPS = torch.tensor([[0.00, 0.45, 0.70], [0.90, 0.62, 0.00], [0.00, 0.62, 0.45], [0.80, 0.42, 0.12]])
_RED, _GREY = torch.tensor([0.75, 0.22, 0.17]), torch.tensor([0.45, 0.49, 0.56])
_PULL = torch.tensor([0.00, 0.35, 0.70])


# ---- starts and handles --------------------------------------------------------------------------------


def vertex_at(mesh: ShapeMesh, u: float, v: float) -> int:
    """The vertex nearest to a point of the surface."""
    place = mesh.surface.position(*torch.tensor([[u], [v]], dtype=torch.float64))
    return int(torch.linalg.vector_norm(mesh.vertices - place, dim=1).argmin())


def extent(vertices: Tensor) -> float:
    """Diagonal of the bounding box: the size that pulls are measured by."""
    return float(torch.linalg.vector_norm(vertices.amax(0) - vertices.amin(0)))


def moved(vertices: Tensor, vertex: int, outwards: float = 0.0, upwards: float = 0.0) -> list[float]:
    """Where a vertex is after moving away from the z-axis and along it."""
    x, y, z = vertices[vertex].tolist()
    stretch = 1.0 + outwards / float(torch.linalg.vector_norm(vertices[vertex, :2]))
    return [stretch * x, stretch * y, z + upwards]


def largest_pull(vertices: Tensor, handles: Mapping[int, Sequence[float]]) -> float:
    """How far the farthest handle is moved, over the size of the mesh."""
    numbers = list(handles)
    ends = torch.tensor([handles[number] for number in numbers], dtype=vertices.dtype)
    return float(torch.linalg.vector_norm(ends - vertices[numbers], dim=1).max()) / extent(vertices)


# ---- designing -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Level:
    """A mesh of a design and what it took."""

    vertices: Tensor
    principal: PrincipalEdges
    report: Report

    @property
    def topology(self) -> Topology:
        """Of the mesh."""
        return self.principal.topology


def design_levels(design: SymmetricDesign, handles: Handles, levels: int) -> list[Level]:
    """Moves the handles, then refines and solves ``levels`` times."""
    done = []
    for level in range(levels + 1):
        design = design.refined() if level else design
        before, begin, cpu = design.measures(), time.perf_counter(), time.process_time()
        if level:
            design.solve()
        else:
            design.move(handles)
        times = {"seconds": time.perf_counter() - begin, "cpu_seconds": time.process_time() - cpu}
        report = {"before": before, "after": design.measures(), "steps": sum(run.iterations for run in design.runs)}
        counts = {"vertices": design.topology.num_vertices, "edges": design.topology.num_edges}
        done.append(Level(design.vertices, design.principal, counts | report | times))
        print(f"{counts['vertices']} vertices: {level_line(done[-1].report)}", flush=True)
    return done


def level_line(report: Report) -> str:
    """What a level meets, in one line."""
    after = report["after"]
    largest = max(after["largest_cospherical"], after["largest_coplanar"])
    return (
        f"largest relative residual {largest:.1e}, saddle sides right {100 * after['saddle_side_share']:.1f} % of "
        f"{after['negative_stars']:.0f}, pyramids crossing {after['crossing_pyramids_negative']:.0f}, "
        f"E/C {after['energy_over_curvature']:.3f}, {report['steps']} steps, {report['seconds']:.1f} s"
    )


# ---- strips --------------------------------------------------------------------------------------------


def level_strips(
    level: Level, height: float, files: tuple[str, str], results: Results
) -> tuple[DevelopableStrips, Report]:
    """Strips ``height`` mean edges high, lower where rulings would meet, written as OBJ and SVG, and their faults."""
    lines = level.principal.polylines()
    normals = strip_normals(level.vertices, level.principal)
    wanted = height * float(edge_lengths(level.vertices, level.topology).mean())
    tall = min(wanted, TALLEST * strip_limits(level.vertices, lines, normals).height)
    strips = developable_strips(level.vertices, lines, normals, tall)
    save_strips_obj(results.path(files[0]), strips, overwrite=results.force)
    save_strips_svg(results.path(files[1]), strips, overwrite=results.force)
    return strips, {
        "strips": len(strips.names),
        "quads": strips.topology.num_faces,
        "height": tall,
        "largest_planarity": float(strips.planarity.max()),
        "largest_isometry_error": float(strips.isometry_errors.max()),
        "sheet": strips.sheet,
    }


def strip_colors(strips: DevelopableStrips) -> Tensor:
    """(S, 3) the same colour for all pieces of a polyline, another one for the next."""
    return _STRIPS[strips.polylines % len(_STRIPS)]


def strips_picture(level: Level, strips: DevelopableStrips, camera: Camera, size: tuple[int, int]) -> Tensor:
    """Strips standing on the mesh, (height, width, 3)."""
    count = level.topology.num_vertices
    quads = (strips.topology.corners.view(-1, 4) + count).tolist()
    together = Topology.from_faces([*level.topology.triangles.tolist(), *quads])
    vertices = torch.cat([level.vertices, strips.vertices])
    owner = torch.repeat_interleave(torch.arange(len(strips.names)), strips.offsets.diff() - 1)
    white = torch.tensor(FRONT).expand(level.topology.num_faces, 3)
    colors = torch.cat([white, strip_colors(strips)[owner]]).to(torch.float64)
    view = MeshView(vertices, together, camera, size)
    widths = torch.where((together.edges < count).all(1), 0.4, 0.7)
    widths[(together.edges % count == together.edges).any(1) & (together.edges >= count).any(1)] = 0.0
    style = EdgeStyle(torch.tensor([0.15, 0.18, 0.24]), widths, opacity=0.5)
    return view.paint(shade_faces(vertices, together, camera, colors), edges=style)


def draw_sheet(sheet: Sheet, strips: DevelopableStrips, left: float, top: float, width: float) -> None:
    """The strips laid flat, ``width`` pixels broad."""
    from matplotlib.collections import PolyCollection

    across, high = strips.sheet
    axes = sheet.axes(left, top, width, width * high / across)
    axes.set(xlim=(0, across), ylim=(0, high))
    axes.set_axis_off()
    outlines = [outline.numpy() for outline in strips.outlines()]
    colors = strip_colors(strips).numpy()
    drawn = PolyCollection(outlines, facecolors=colors, edgecolors="#26303d", linewidths=points(0.8))
    axes.add_collection(drawn)


def strips_page(level: Level, strips: DevelopableStrips, view: ViewDirection, width: int) -> Sheet:
    """Strips on the mesh, and beside it laid flat."""
    half = (width - 2 * MARGIN - GAP) // 2
    camera, size = fit_camera(
        level.vertices, strips.vertices, towards_eye=view.towards_eye, up=view.up, width=half, margin=0.02
    )
    across, high = strips.sheet
    flat = round(half * high / across)
    height, left = max(size[0], flat), MARGIN + half + GAP
    sheet = Sheet(width, CAPTION + height + MARGIN)
    sheet.caption("strips along the principal edges", MARGIN, 0, half)
    sheet.image(strips_picture(level, strips, camera, size), MARGIN, CAPTION + (height - size[0]) // 2)
    sheet.caption("laid flat", left, 0, half)
    draw_sheet(sheet, strips, left, CAPTION + (height - flat) / 2, half)
    return sheet


def pulls_page(start: Level, design: Level, handles: Handles, view: ViewDirection, width: int) -> Sheet:
    """Start and design with their principal edges, and how the handles were pulled."""
    half = (width - 2 * MARGIN - GAP) // 2
    camera, size = fit_camera(
        start.vertices, design.vertices, towards_eye=view.towards_eye, up=view.up, width=half, margin=0.02
    )
    sheet = Sheet(width, CAPTION + size[0] + MARGIN // 2)
    pulled = list(handles)
    for column, (name, level) in enumerate({"start": start, "design": design}.items()):
        mesh, left = MeshView(level.vertices, level.topology, camera, size), MARGIN + column * (half + GAP)
        faces = shade_faces(level.vertices, level.topology, camera)
        picture = mesh.paint(faces, edges=principal_style(mesh, level.principal.mask))
        seen = visible_vertices(mesh)[pulled]
        before, after = (vertices[pulled][seen] for vertices in (start.vertices, level.vertices))
        places = lambda points: camera.project(points, size)[0, :, :2]  # noqa: E731
        sheet.caption(name, left, 0, half)
        sheet.image(mark_pulls(picture, places(before), places(after), 0.008 * half), left, CAPTION)
    return sheet


# ---- edges and marks on pictures ---------------------------------------------------------------------------------


def principal_style(view: MeshView, mask: Tensor) -> EdgeStyle:
    """Principal edges strong and red, others thin and grey."""
    thin = line_width(view, 0.04, 0.35, 1.0)
    return EdgeStyle(torch.where(mask[:, None], _RED, _GREY), torch.where(mask, 2.6 * thin, thin), mask.double())


def visible_vertices(view: MeshView) -> Tensor:
    """(V,) bool: vertices with one of their faces in the picture next to them."""
    seen = torch.zeros(view.topology.num_vertices, dtype=torch.bool)
    places = view.points[:, :2].round().long()
    rows, columns = view.face_index.shape
    for shift in itertools.product((-2, 0, 2), repeat=2):
        x, y = (places + torch.tensor(shift)).unbind(1)
        inside = (x >= 0) & (x < columns) & (y >= 0) & (y < rows)
        faces = view.face_index[y.clamp(0, rows - 1), x.clamp(0, columns - 1)].long()
        corners = view.topology.triangles[faces]
        seen |= inside & (faces >= 0) & (corners == torch.arange(len(seen))[:, None]).any(1)
    return seen


def mark_pulls(picture: Tensor, start: Tensor, end: Tensor, size: float) -> Tensor:
    """The picture with a dot at every end (n, 2), and a line to it from every start (n, 2); all in pixels."""
    for a, b in zip(start, end, strict=True):
        picture = _stroke(picture, a, b, 0.22 * size, _PULL)
        picture = _stroke(picture, b, b, size + 1.5, torch.ones(3))
        picture = _stroke(picture, b, b, size, _PULL)
    return picture


def _stroke(picture: Tensor, a: Tensor, b: Tensor, radius: float, color: Tensor) -> Tensor:
    """A line with round ends between two pixels, smooth at its rim."""
    rows, columns = picture.shape[:2]
    y, x = torch.meshgrid(torch.arange(rows) + 0.5, torch.arange(columns) + 0.5, indexing="ij")
    pixel, along = torch.stack([x, y], dim=-1).to(a), b - a
    share = ((pixel - a) @ along / along.dot(along).clamp_min(1e-12)).clamp(0, 1)
    distance = torch.linalg.vector_norm(pixel - a - share[..., None] * along, dim=-1)
    cover = (radius + 0.5 - distance).clamp(0, 1).to(picture)[..., None]
    return torch.lerp(picture, color.to(picture), cover)
