"""Paper section 6, outlook: do triangle meshes with good saddles go over into meshes of nice planar hexagons?

The polar dual of a triangle mesh has a planar face for every inner vertex, a hexagon where six triangles meet. If the
planes around a vertex have the centre of the duality on the same side, its face is a section of the normal pyramid: it
crosses itself exactly where the pyramid does. So Prop. 1 says that good saddles dualise to simple hexagons. Counted is
how often faces are simple, by the class of the vertex, for saddle surfaces sampled in several ways, with the centre far
below and with the centre in the middle of the surface; and how nice simple hexagons are: how many of their corners are
convex, and their area over that of the convex hull. Those of saddles are not convex.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass

import torch
from _common import ExperimentConfig, Report, Results, run_experiment, setting
from _layouts import EQUILATERAL, HEXAGONAL_15, IRREGULAR, SADDLES, layout
from scipy.spatial import ConvexHull
from torch import Tensor

from torchfair import MeshError, Topology
from torchfair.geometry import vertex_normals
from torchfair.shapes import ShapeMesh
from torchfair.stars import StarKind, classify_stars, polar_dual, pyramid_self_intersections
from torchfair.viewing import picture_mesh

NAME = "polar_duals"
KINDS = ("good saddle", "bad saddle", "neither", "convex")
DUAL, MESH, PICTURE = "dual.obj", "mesh.obj", "dual.png"


@dataclass(frozen=True)
class Config(ExperimentConfig):
    """Settings of the experiment."""

    surfaces: tuple[str, ...] = setting(tuple(SADDLES), "saddle surfaces", choices=tuple(SADDLES))
    layouts: tuple[str, ...] = setting(
        (EQUILATERAL, HEXAGONAL_15, IRREGULAR), "meshes of them", choices=(EQUILATERAL, HEXAGONAL_15, IRREGULAR)
    )
    rows: int = setting(16, "vertices along a side, about", least=6)
    distance: float = setting(4.0, "of the centre below the mesh, in its size", least=0)


# ---- polygons ------------------------------------------------------------------------------------------


def flattened(corners: Tensor) -> Tensor:
    """(n, k, 2) the planar polygons ``corners`` (n, k, 3) in their planes, about their means, of size 1."""
    centred = corners - corners.mean(1, keepdim=True)
    frames = torch.linalg.svd(centred).Vh[:, :2]
    flat = centred @ frames.mT
    return flat / flat.abs().amax((1, 2), keepdim=True)


def turns(a: Tensor, b: Tensor, c: Tensor) -> Tensor:
    """Twice the signed areas of triangles in the plane."""
    first, second = b - a, c - a
    return first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]


def is_simple(polygons: Tensor) -> Tensor:
    """(n,) bool: no two sides of the polygons (n, k, 2) without a common corner cross."""
    count = polygons.shape[1]
    crosses = torch.zeros(len(polygons), dtype=torch.bool)
    nexts = polygons.roll(-1, 1)
    for i in range(count):
        for j in range(i + 2, count - (i == 0)):
            a, b, c, d = polygons[:, i], nexts[:, i], polygons[:, j], nexts[:, j]
            crosses |= (turns(a, b, c) * turns(a, b, d) < 0) & (turns(c, d, a) * turns(c, d, b) < 0)
    return ~crosses


def area_shares(polygons: Tensor) -> Tensor:
    """(n,) areas of simple polygons over those of their convex hulls."""
    x, y = polygons.unbind(-1)
    areas = 0.5 * (x * y.roll(-1, 1) - y * x.roll(-1, 1)).sum(1).abs()
    hulls = [ConvexHull(polygon).volume for polygon in polygons.numpy()]
    return areas / torch.tensor(hulls, dtype=areas.dtype)


def convex_corners(polygons: Tensor) -> Tensor:
    """(n,) how many corners of simple polygons are convex."""
    bends = turns(polygons.roll(1, 1), polygons, polygons.roll(-1, 1))
    x, y = polygons.unbind(-1)
    sense = (x * y.roll(-1, 1) - y * x.roll(-1, 1)).sum(1, keepdim=True).sign()
    return (bends * sense > 0).sum(1)


# ---- what is counted -----------------------------------------------------------------------------------


def centre_below(vertices: Tensor, topology: Topology, distance: float) -> Tensor:
    """A point against the mean normal, ``distance`` sizes of the mesh away."""
    normal = vertex_normals(vertices, topology).mean(0)
    size = (vertices.amax(0) - vertices.amin(0)).max()
    return vertices.mean(0) - distance * size * normal / torch.linalg.vector_norm(normal)


def judge(vertices: Tensor, topology: Topology, centre: Tensor) -> Report:
    """Faces of the dual by the class of their vertices."""
    dual = polar_dual(vertices, topology, centre)
    classes = classify_stars(vertices, topology)
    folded = pyramid_self_intersections(vertices, topology) > 0
    report: Report = {kind: {"faces": 0, "simple": 0, "hexagons": []} for kind in KINDS}
    report |= {"one_sided": int(dual.one_sided.sum()), "faces": len(dual.mesh_vertices), "disagree": 0}
    sizes, faces = dual.topology.face_sizes, dual.topology.face_lists()
    for size in sizes.unique().tolist():
        chosen = torch.nonzero(sizes == size).squeeze(1)
        corners = torch.tensor([faces[face] for face in chosen.tolist()])
        polygons = flattened(dual.vertices[corners])
        numbers = dual.mesh_vertices[chosen]
        simple = is_simple(polygons)
        report["disagree"] += int(((simple == folded[numbers]) & dual.one_sided[chosen]).sum())
        saddle, good = classes.is_kind(StarKind.SADDLE)[numbers], classes.good[numbers]
        masks = (
            good,
            saddle & ~good,
            classes.is_kind(StarKind.NEITHER)[numbers],
            classes.is_kind(StarKind.CONVEX)[numbers],
        )
        for kind, mask in zip(KINDS, masks, strict=True):
            report[kind]["faces"] += int(mask.sum())
            report[kind]["simple"] += int((mask & simple).sum())
            if size == 6:
                report[kind]["hexagons"].append(polygons[mask & simple])
    for kind in KINDS:
        hexagons = torch.cat(report[kind].pop("hexagons") or [torch.zeros(0, 6, 2, dtype=vertices.dtype)])
        some = bool(len(hexagons))
        report[kind] |= {
            "convex_corners": float(convex_corners(hexagons).to(vertices.dtype).mean()) if some else None,
            "area_share": float(area_shares(hexagons).mean()) if some else None,
        }
    return report


def inside(mesh: ShapeMesh) -> Report | str:
    """The same with the centre in the middle of the mesh, or why that is not possible."""
    try:
        return judge(mesh.vertices, mesh.topology, mesh.vertices.mean(0))
    except MeshError as error:
        return str(error)


def added(reports: list[Report], kind: str) -> Report:
    """Counts of several meshes for one class of vertices, shapes of hexagons in the mean over meshes."""
    rows = [report[kind] for report in reports]
    shapes = {key: [row[key] for row in rows if row[key] is not None] for key in ("convex_corners", "area_share")}
    means = {key: sum(values) / len(values) if values else None for key, values in shapes.items()}
    return {key: sum(row[key] for row in rows) for key in ("faces", "simple")} | means


# ---- experiment ----------------------------------------------------------------------------------------


def experiment(config: Config, results: Results) -> Report:
    """Dualises, counts, and draws one dual."""
    below: list[Report] = []
    within: list[Report] = []
    rows: Report = {}
    for name in config.surfaces:
        for kind in config.layouts:
            mesh = layout(SADDLES[name], kind, config.rows, config.seed)
            centre = centre_below(mesh.vertices, mesh.topology, config.distance)
            report, middle = judge(mesh.vertices, mesh.topology, centre), inside(mesh)
            below.append(report)
            within += [] if isinstance(middle, str) else [middle]
            rows[f"{name}, {kind}"] = {"below": report, "inside": middle}
    overall = {
        place: {kind: added(found, kind) for kind in KINDS}
        | {key: sum(report[key] for report in found) for key in ("faces", "one_sided", "disagree")}
        for place, found in (("below", below), ("inside", within))
    }
    for place, row in overall.items():
        words = ", ".join(f"{row[kind]['simple']} of {row[kind]['faces']} {kind}" for kind in KINDS)
        print(f"centre {place}: simple faces {words}; one-sided {row['one_sided']} of {row['faces']}")
    save(config, results)
    return {"all": overall, "meshes": rows}


def save(config: Config, results: Results) -> None:
    """The first mesh and its dual."""
    mesh = layout(SADDLES[config.surfaces[0]], config.layouts[0], config.rows, config.seed)
    dual = polar_dual(mesh.vertices, mesh.topology, centre_below(mesh.vertices, mesh.topology, config.distance))
    results.mesh(MESH, mesh.vertices, mesh.topology)
    results.mesh(DUAL, dual.vertices, dual.topology)
    width = config.width
    picture_mesh(results.path(PICTURE), dual.vertices, dual.topology, width=width, overwrite=results.force)


def main(arguments: list[str] | None = None) -> int:
    """The experiment from the command line."""
    return run_experiment(NAME, __doc__, Config, experiment, [MESH, DUAL, PICTURE], arguments)


if __name__ == "__main__":
    sys.exit(main())
