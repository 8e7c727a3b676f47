"""Classes of vertex stars: convex, saddle-shaped, or neither (paper section 2)."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from enum import IntEnum

import torch
from torch import Tensor

from .._one_mesh import one_mesh
from .._side_by_side import side_by_side
from ..geometry import corner_angles, face_normals
from ..geometry._ops import dot
from ..geometry.angles import defects
from ..geometry.normals import angle_weighted
from ..topology import Topology
from ._groups import Planes, StarGroup, corner_planes, star_arms, star_parts
from ._judge import edge_signs, judge_stars
from ._patterns import run_lengths

_CHUNK = 1 << 12  # stars judged at a time: bounds the memory


class StarKind(IntEnum):
    """What the star of a vertex looks like. Boundary vertices and isolated ones are EXCLUDED."""

    CONVEX = 0
    SADDLE = 1
    NEITHER = 2
    EXCLUDED = 3


@dataclass(frozen=True)
class StarClasses:
    """Classes of all stars of one mesh; see :func:`classify_stars`.

    Sides are +1 for edges above a plane, -1 below, 0 in it, in the order of ``topology.ring_vertices``.

    Attributes:
        topology: connectivity of the mesh.
        kinds: (V,) int8 values of :class:`StarKind`.
        good: (V,) bool, the good saddles among the saddles.
        flat: (V,) bool, convex stars all of whose edges are flat.
        degenerate: (V,) bool, inner vertices with a sector without area, or coordinates that are not finite:
            they are NEITHER.
        normals: (V, 3) float64 unit normals of the best plane of saddles, of a plane onto which they project
            1-1 for convex stars; zero for others.
        sides: (R,) int8 sides at that plane.
        ordinary_sides: (R,) int8 sides at the plane orthogonal to the ordinary vertex normal (the mean of the
            face normals weighted by angles); zero for excluded vertices.
        inflections: (H,) bool by face corner: the face is an inflection face of the star of that corner.
        defect_signs: (V,) int8 sign of the angle defect: +1 where cone-like, -1 where the angles sum to more
            than a full turn, 0 within rounding and for excluded vertices.
    """

    topology: Topology
    kinds: Tensor
    good: Tensor
    flat: Tensor
    degenerate: Tensor
    normals: Tensor
    sides: Tensor
    ordinary_sides: Tensor
    inflections: Tensor
    defect_signs: Tensor

    def is_kind(self, kind: StarKind) -> Tensor:
        """(V,) bool mask of the vertices of one kind."""
        return self.kinds == int(kind)

    @property
    def bad_saddles(self) -> Tensor:
        """(V,) bool, saddles that are not good ones."""
        return self.is_kind(StarKind.SADDLE) & ~self.good

    @property
    def bad(self) -> Tensor:
        """(V,) bool, stars that are neither convex nor good saddles."""
        return self.bad_saddles | self.is_kind(StarKind.NEITHER)

    @property
    def inflection_counts(self) -> Tensor:
        """(V,) number of inflection faces of every star."""
        counts = torch.zeros_like(self.kinds, dtype=torch.int64)
        return counts.index_add(0, self.topology.corners, self.inflections.to(torch.int64))

    def pattern(self, vertex: int, *, ordinary: bool = False) -> tuple[int, ...]:
        """Lengths of the runs of edges above and below the best plane, or that of the ordinary normal.

        In a normal form that does not depend on start, sense of rotation and sides: ``(1, 2, 1, 2)``,
        ``(2, 2, 1, 1)``, ``(3, 1, 1, 1)``. ``(k,)`` if all are on one side; ``()`` without a plane.
        """
        start, stop = self.topology.ring_offsets[vertex : vertex + 2].tolist()
        return run_lengths((self.ordinary_sides if ordinary else self.sides)[start:stop].tolist())

    def pattern_counts(self, *, ordinary: bool = False, kind: StarKind | None = None) -> dict[tuple[int, ...], int]:
        """How many inner vertices (of one ``kind``) have each pattern, see :meth:`pattern`, the most frequent first."""
        packed = self.ordinary_sides if ordinary else self.sides
        total: Counter[tuple[int, ...]] = Counter()
        for centres, ring in self.topology.rings_by_valence.values():
            places = self.topology.ring_offsets[centres, None] + torch.arange(ring.shape[1], device=ring.device)
            rows = packed[places]
            if kind is not None:
                rows = rows[self.is_kind(kind)[centres]]
            unique, counts = _unique_rows(rows)
            for row, count in zip(unique.tolist(), counts.tolist(), strict=True):
                total[run_lengths(row)] += count
        return dict(sorted(total.items(), key=lambda item: (-item[1], item[0])))


def classify_stars(vertices: Tensor, topology: Topology) -> StarClasses:
    """Says of every inner vertex whether its star is convex, saddle-shaped or neither (paper section 2.1).

    *Saddle-shaped*: some plane through the vertex meets the star in exactly four segments that do not lie in a
    half-plane, and the star projects onto it 1-1; segments in just opposite directions, which is how every plane meets
    two faces in one plane, lie in none. *Convex*: the star lies on one side of the planes of all its faces and
    projects 1-1 onto some plane; flat edges and flat stars count as convex. Both tests are exact up to rounding of
    the coordinates.

    *Inflection face*: its two neighbours in the star lie on different sides of its plane; so the dihedral angles
    at its two edges differ in sign, and flat edges make none. *Good saddle*: a plane as above exists which meets
    all inflection faces of the star. Of valence 6 the paper asks besides for the pattern 1,2,1,2, and so does
    this function; of valence 4 every face of a saddle is an inflection face, and all saddles are good. The
    pyramid of a good saddle of any valence is free of self-intersections, for the proof of the paper's Prop. 1
    shows that it is star-shaped about the normal of the plane.

    Among the planes that show a saddle the *best* one is reported: that of the good saddle, otherwise a plane
    whose opposite runs of edges differ least in length, then with the shortest longest run, then with all edges
    farthest off (by angle) within the cone of admissible normals found for each pattern.

    Stars of polygon meshes consist of the sectors between neighbouring edges, which is right for planar faces.
    This function reads values: it is neither differentiable nor meant for ``vmap`` or ``torch.compile``.

    Args:
        vertices: positions (V, 3) of one mesh, any length unit.
        topology: connectivity; any polygons, mixed.

    Returns:
        A class for every vertex; boundary vertices and isolated ones are excluded. Stars of more than 24 edges
        are recognised as saddles only if they are good ones. Nothing depends on unit, position or numbering;
        reflecting or reversing the mesh changes signs only.

    Raises:
        ShapeError: if ``vertices`` is not a floating tensor (V, 3).
    """
    vertices = one_mesh(vertices, topology)
    planes = Planes(face_normals(vertices, topology), corner_angles(vertices, topology))
    classes = _empty(defects(planes.angles, topology), topology, torch.finfo(vertices.dtype).eps)
    ordinary = angle_weighted(planes.normals, planes.angles, topology).to(torch.float64)

    def judge(part: StarGroup) -> None:
        _judge(vertices, classes, planes, part)
        _take_sides(vertices, classes, planes, part, ordinary[part.centres])

    side_by_side(judge, star_parts(topology, lambda _: _CHUNK), vertices)
    return classes


def _empty(defects: Tensor, topology: Topology, eps: float) -> StarClasses:
    """Classes of a mesh with angle ``defects`` (V,), of which no star has been judged yet; ``eps`` of its positions."""
    count, device = topology.num_vertices, topology.device
    false = torch.zeros(count, dtype=torch.bool, device=device)
    zeros = torch.zeros(topology.ring_vertices.shape[0], dtype=torch.int8, device=device)
    # Each of the corner angles is rounded to a few units of the last place of its size.
    certain = defects.abs() > 8 * eps * topology.valences.clamp_min(1)
    inner = ~topology.is_boundary_vertex & (topology.valences > 0)
    return StarClasses(
        topology=topology,
        kinds=torch.full((count,), int(StarKind.EXCLUDED), dtype=torch.int8, device=device),
        good=false,
        flat=false.clone(),
        degenerate=false.clone(),
        normals=torch.zeros(count, 3, dtype=torch.float64, device=device),
        sides=zeros,
        ordinary_sides=zeros.clone(),
        inflections=torch.zeros(topology.corners.shape[0], dtype=torch.bool, device=device),
        defect_signs=torch.where(certain & inner, defects.sign(), 0.0).to(torch.int8),
    )


def _judge(vertices: Tensor, classes: StarClasses, planes: Planes, group: StarGroup) -> None:
    """Fills in kinds, good saddles and normals of the stars of a group."""
    classes.kinds[group.centres] = int(StarKind.NEITHER)
    for centres, arms, noise in star_arms(vertices, classes.topology, planes, group):
        verdicts = judge_stars(arms, noise)
        classes.kinds[centres] = verdicts.kinds
        classes.good[centres] = verdicts.good
        classes.normals[centres] = verdicts.normals
        classes.degenerate[centres] = ~torch.isfinite(noise)


def _take_sides(vertices: Tensor, classes: StarClasses, planes: Planes, group: StarGroup, ordinary: Tensor) -> None:
    """Fills in what is said edge by edge and face by face; ``ordinary`` (n, 3) are the vertex normals."""
    centres, ring, corners = group
    arms = (vertices[ring] - vertices[centres][:, None]).to(torch.float64)
    sectors, noise = corner_planes(vertices, classes.topology, planes, group, arms)
    arms = arms / torch.linalg.vector_norm(arms, dim=-1, keepdim=True)
    places = classes.topology.ring_offsets[centres, None] + torch.arange(ring.shape[1], device=ring.device)
    classes.sides[places] = _sides(arms, classes.normals[centres], noise)
    classes.ordinary_sides[places] = _sides(arms, ordinary, noise)
    signs = edge_signs(sectors, arms, noise)
    classes.inflections[corners] = signs * signs.roll(-1, 1) < 0
    classes.flat[centres] = (classes.kinds[centres] == int(StarKind.CONVEX)) & (signs == 0).all(1)


def _sides(arms: Tensor, normals: Tensor, noise: Tensor) -> Tensor:
    """(n, k) sides of unit arms at planes with the given normals (n, 3)."""
    heights = dot(arms, normals[:, None])
    return torch.where(heights.abs() > noise[:, None], heights.sign(), 0.0).to(torch.int8)


def _unique_rows(rows: Tensor) -> tuple[Tensor, Tensor]:
    """Different rows of sides (n, k) and how often each occurs; faster than ``torch.unique`` for up to 39 columns."""
    size = rows.shape[1]
    if size > 39:
        unique, counts = torch.unique(rows, dim=0, return_counts=True)
        return unique, counts
    digits = 3 ** torch.arange(size, device=rows.device)
    codes, counts = torch.unique(((rows + 1) * digits).sum(1), return_counts=True)
    return codes[:, None] // digits % 3 - 1, counts
