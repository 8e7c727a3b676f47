"""Ways to differentiate the residuals of ready-made terms: sums, ``jacrev``, ``jacfwd``, closed forms.

Run ``python benchmarks/bench_derivatives.py [--vertices 10000] [--repeats 5] [--json FILE]``, on one thread.

Microseconds of processor time for an element: Jacobians of all elements of a term, least of the repetitions, in turns.
All ways agree to rounding (tested for every term). The default is what the term says, else the closed form if it has
one, else ``sums``, or ``jacfwd`` where an element has more components than unknowns. The last column says how much
longer the default takes than the fastest of all.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import torch
from barrel_problem import barrel
from symmetric_problems import RING

from torchfair import constraints as c
from torchfair.geometry import ReferenceSurface, corner_angles, face_areas
from torchfair.principal import principal_edges_of_lattice
from torchfair.projection import ElementTerm
from torchfair.projection.differentiation import Way
from torchfair.projection.layout import State
from torchfair.shapes import Torus, principal_quads, principal_triangles

WAYS: tuple[Way, ...] = ("closed form", "sums", "jacrev", "jacfwd")


def products(x: torch.Tensor) -> torch.Tensor:
    """All nine products of two coordinates of a vertex ``x`` (1, 3)."""
    return torch.outer(x[0], x[0]).reshape(-1)


def cases(count: int) -> Iterator[tuple[str, State, ElementTerm]]:
    """Terms with their names, at states of meshes of about ``count`` vertices."""
    vertices, topology = barrel(count)
    state, planes = {"vertices": vertices}, c.TangentPlanes(ReferenceSurface(vertices, topology))
    own = [
        *c.normal_variation_terms(topology, smoothing=0.1),
        *c.absolute_curvature_terms(topology, smoothing=0.1)[:1],
        *c.interior_fairness_terms(topology, weight=1.0),
        *c.tangential_fairness_terms(topology, weight=1.0),
        *c.polyline_fairness_terms(topology, weight=1.0),
        *c.corner_angle_terms(topology, 0.01, 1.5 * corner_angles(vertices, topology), weight=1.0),
        *c.face_area_terms(topology, 2.5 * face_areas(vertices, topology), weight=1.0),
        *c.closeness_terms(planes, torch.arange(topology.num_vertices), weight=1.0),
    ]
    yield from ((term.name, state, term) for term in own)
    every = torch.arange(topology.num_vertices)[:, None]
    yield "products of coordinates, more than unknowns", state, ElementTerm("products", products, [("vertices", every)])
    lifted = {**state, **c.lifted_normal_variation_blocks(vertices, topology)}
    planar = torch.ones(topology.num_faces, dtype=torch.bool)
    terms = c.lifted_normal_variation_terms(vertices, topology, planar, weight=1.0, constraint_weight=1.0)
    yield from ((f"lifted E: {term.name}", lifted, term) for term in terms)
    lifted = {**state, **c.lifted_absolute_curvature_blocks(vertices, topology)}
    known = set()
    for term in c.lifted_absolute_curvature_terms(topology, smoothing=0.1):
        if term.name not in known and term.num_elements > count // 2:
            known.add(term.name)
            yield f"lifted C: {term.name}", lifted, term
    side = round((count / 1.5) ** 0.5)
    quads = principal_quads(Torus(2.0, 0.8), side, round(1.5 * side))
    bent = {"vertices": quads.vertices + 0.02 * quads.vertices.roll(1, 1).sin()}
    for term in (
        *c.normal_variation_terms(quads.topology, smoothing=0.1),
        *c.planarity_terms(quads.topology, torch.arange(quads.topology.num_faces), weight=1.0),
    ):
        yield f"quads: {term.name}", bent, term
    mesh = principal_triangles(RING, 2 * (side // 2), round(1.5 * side))
    principal = principal_edges_of_lattice(mesh, "u")
    stars = principal.stars()
    edges = c.between_stars(principal.topology.edges[principal.mask], stars)
    spheres = {"vertices": mesh.vertices, **c.sphere_blocks(mesh.vertices, stars)}
    for term in (*c.cospherical_terms(stars, weight=1.0), *c.coplanar_terms(edges, stars, weight=1.0)):
        yield f"spheres: {term.name}", spheres, term
    for term in c.eliminated_principal_symmetric_terms(edges, stars, weight=1.0):
        yield f"eliminated: {term.name}", spheres, term
    lifted = {"vertices": mesh.vertices, **c.lifted_principal_symmetric_blocks(mesh.vertices, edges, stars)}
    saddles = torch.ones_like(stars.vertices, dtype=torch.bool)
    for term in c.lifted_principal_symmetric_terms(edges, stars, saddles, weight=1.0):
        yield f"lifted conditions: {term.name}", lifted, term


def seconds(term: ElementTerm, arguments: tuple[torch.Tensor, ...]) -> float:
    begin = time.process_time()
    term.jacobians(arguments)
    return time.process_time() - begin


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--vertices", type=int, default=10_000)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    options = parser.parse_args()
    torch.set_num_threads(1)
    rows = []
    print(f"{'term':44}{'elements':>9}{'m':>4}{'K':>4}" + "".join(f"{way:>13}" for way in WAYS) + f"{'default':>9}")
    for name, state, term in cases(options.vertices):
        arguments = term.arguments(state)
        values, jacobians = term.linearised(arguments)
        possible = WAYS if term.jacobian is not None else WAYS[1:]
        ways = {way: replace(term, derivatives=way) for way in possible}
        times = {way: float("inf") for way in ways}
        for _ in range(options.repeats):
            for way, chosen in ways.items():
                times[way] = min(times[way], seconds(chosen, arguments))
        each = {way: 1e6 * spent / term.num_elements for way, spent in times.items()}
        m, k = values.shape[1], jacobians.shape[2]
        default = term.derivatives or (possible[0] if m <= k else "jacfwd")
        loss = each[default] / min(each.values())
        shown = "".join(f"{each[way]:13.3f}" if way in each else f"{'-':>13}" for way in WAYS)
        print(f"{name:44}{term.num_elements:9}{m:4}{k:4}{shown}{loss:9.2f}", flush=True)
        row = {"term": name, "elements": term.num_elements, "components": m, "unknowns": k}
        rows.append({**row, "microseconds": each, "default_over_fastest": loss})
    if options.json:
        options.json.write_text(json.dumps(rows, indent=2) + "\n")


if __name__ == "__main__":
    main()
