"""What the edges that pass through a pixel change in it: its exact mean colour, and how that follows their motion."""

from __future__ import annotations

import torch
from torch import Tensor

from ..rasterisation.crossings import cut_at_crossings
from ..rasterisation.segments import Segments, pixel_segments
from ..rasterisation.sides import seen_beside
from ._scene import Scene
from ._shading import Shader

_APEX = (6e-8, 6e-10)  # from the pixel centre to where the rasteriser's rule for ties puts it, in pixels


def edge_terms(
    scene: Scene, shade: Shader, shape: tuple[int, int], *, smooth: bool, antialias: bool
) -> tuple[Tensor, Tensor]:
    r"""Corrections of pixels that were sampled at their centre: pixel numbers (S,) and changes (S, channels + 1).

    In a pixel crossed by edges, the colour at its centre c stands for the whole square. Seen from c, a segment of
    an edge casts a shadow over the part of the square behind it, where the colour is that of its outer side instead
    of its inner side::

        +---------+      exact mean = colour at c + sum over segments of
        |   \#####|                   shadow area (outer colour - inner colour)
        |  c \####|
        |     \###|      since along every ray from c the changes of colour add up.
        +---------+

    The derivative of the shadow areas is the motion of the edges across themselves, times the jump of colour.

    Without ``antialias`` the changes have the value 0 and only these derivatives.
    """
    height, width = shape
    points = scene.points.detach().to(torch.float64)
    ends = points[scene.edges][..., :2]
    segments = pixel_segments(ends, scene.edge_pictures, width, height)
    segments = cut_at_crossings(segments, ends, _outline(scene), scene.num_pictures * height * width)
    sides = seen_beside(points[scene.triangles], scene.pictures, segments, ends, (scene.num_pictures, height, width))
    own = _own(scene, segments, sides)
    segments, sides = Segments(*(part.index_select(0, own) for part in segments)), sides.index_select(0, own)

    start, along = ends[segments.edge, 0], (ends[:, 1] - ends[:, 0])[segments.edge]
    position = ((segments.begin + segments.end) / 2)[:, None]
    centre = _centres(segments.pixel, width, height).to(start)
    # Colours of flat faces are those at the centre of the square, as for its sample: then no area changes colour.
    places = start + position * along if smooth else centre
    jump = shade(sides[:, 1], places) - shade(sides[:, 0], places)
    shadow = _shadows(segments, start - centre, along).to(jump)[:, None]
    corrections = shadow * jump if antialias else shadow * (jump - jump.detach())

    across = torch.stack([along[:, 1], -along[:, 0]], dim=-1) * (segments.end - segments.begin)[:, None]
    tail, head = (scene.points[:, :2].index_select(0, scene.edges[segments.edge, k]) for k in (0, 1))
    moved = torch.lerp(tail, head, position.to(tail))
    motion = (across.to(moved) * (moved - moved.detach())).sum(-1, keepdim=True)
    shares = scene.edge_shares.index_select(0, segments.edge)[:, None].to(jump)
    return segments.pixel, shares * (corrections - motion * jump.detach())


def _centres(pixel: Tensor, width: int, height: int) -> Tensor:
    column, row = torch.remainder(pixel, width), torch.div(pixel, width, rounding_mode="floor")
    return torch.stack([column, torch.remainder(row, height)], dim=-1) + 0.5


def _outline(scene: Scene) -> Tensor:
    """(E,) mask of the edges where the surface ends or turns away, and perhaps of some others."""
    a, b, c = scene.points.detach()[:, :2][scene.triangles].unbind(1)
    u, v = b - a, c - a
    facing = torch.sign(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
    count = int(scene.faces.amax()) + 1 if scene.faces.shape[0] else 0
    face = scene.pictures * count + scene.faces
    sides = facing.new_full((2, scene.num_pictures * count), 2)
    sides[0].scatter_reduce_(0, face, facing, "amin")
    sides[1].scatter_reduce_(0, face, facing.neg(), "amin")
    beside = scene.edge_pictures[:, None] * count + scene.edge_faces
    first, second = sides[:, beside].unbind(-1)
    alone = scene.edge_faces[:, 0] == scene.edge_faces[:, 1]
    return alone | (first != second).any(0) | (first[0] != -first[1])


def _own(scene: Scene, segments: Segments, sides: Tensor) -> Tensor:
    """Numbers of the segments of edges that are seen, and part what is seen on their sides."""
    faces = torch.cat([scene.faces, scene.faces.new_tensor([-1])])[sides]
    beside = (faces[:, :, None] == scene.edge_faces.index_select(0, segments.edge)[:, None]).any(-1)
    parting = beside.any(1) & (faces[:, 0] != faces[:, 1])
    return torch.nonzero(parting).squeeze(1)


def _shadows(segments: Segments, start: Tensor, along: Tensor) -> Tensor:
    """Area of each pixel behind its segment as seen from its centre; negative if the first side is the outer one.

    Args:
        segments: pieces of edges.
        start: (S, 2) from the centre to where the edge starts.
        along: (S, 2) from there to its other end.
    """
    start = start - start.new_tensor(_APEX)
    first, second = (start + position[:, None] * along for position in (segments.begin, segments.end))
    doubled = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    turn = _round_the_square(second) - _round_the_square(first)
    turn = turn - 4 * torch.round(turn / 4)
    # Half a turn goes the way that the sign of the area says, whatever rounding made of it.
    turn = torch.where((turn.abs() > 1.5) & (turn * doubled < 0), turn - 4 * torch.sign(turn), turn)
    return turn / 4 - doubled / 2


def _round_the_square(direction: Tensor) -> Tensor:
    """Length along the border of the unit square, from the middle of its right side, to where a direction meets it."""
    x, y = direction.unbind(-1)
    flat = x.abs() >= y.abs()
    slope = torch.where(flat, y, -x) / torch.where(flat, torch.where(x == 0, 1, x), torch.where(y == 0, 1, y))
    side = torch.where(flat, torch.where(x >= 0, 0, 2), torch.where(y >= 0, 1, 3))
    return side + slope / 2
