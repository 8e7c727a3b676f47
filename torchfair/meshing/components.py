"""All components of a surface: read, meshed with one spacing, and put together."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import torch
from torch import Tensor

from .._numbers import check_count, check_number
from ..errors import MeshError, SettingsError
from ..fields import Directions, FaceFrames
from ..fields.frames import Floats
from ..geometry import FittedCurvature, ReferenceSurface
from ..settings.meshing_settings import MeshingSettings
from ..topology import Topology
from .curvature_sizes import CurvatureSizes
from .curved_surface import on_curved_surface
from .ladder import Again, mesh_component
from .lattice import Lattice
from .mesh_creases import MeshCreases
from .piece_mesh import PieceMesh
from .sizes import SizeField
from .surface import DesignSurface, components_of
from .surface_curvature import smooth_absolute_curvature
from .verification import Shape, shape_of, verify_corners
from .welded import check_welded


@dataclass(frozen=True, eq=False)
class ReadSurface:
    """A surface with its principal directions.

    Attributes:
        parts: components.
        fields: directions of each.
        fits: of the curvature of each.
        notes: what was found, in words.
        sizing: lengths of edges over the mean one, which is given, where they are not the same everywhere.
    """

    parts: list[DesignSurface]
    fields: list[Directions]
    fits: list[FittedCurvature]
    notes: list[str]
    sizing: Callable[[float], CurvatureSizes] | None = None

    @cached_property
    def whole(self) -> tuple[Tensor, Topology]:
        """Triangles of all components in order."""
        return _together([(part.vertices, part.topology) for part in self.parts])

    @cached_property
    def reference(self) -> ReferenceSurface:
        """Triangles of all components, for closest points."""
        return ReferenceSurface(*self.whole)

    def curved(self, points: Tensor) -> Tensor:
        """Points on the triangles, moved onto a smooth surface through their vertices, smooth but for creases."""
        smooth = self.smooth_frames
        normals, operators = (torch.cat([getattr(of, name) for of in self.fits]) for name in ("normals", "operators"))
        return on_curved_surface(points, torch.from_numpy(smooth.points), smooth.topology, normals, operators)

    @cached_property
    def frames(self) -> FaceFrames:
        """Of all components."""
        return FaceFrames.of(*self.whole)

    @cached_property
    def smooth_frames(self) -> FaceFrames:
        """Of all components, with triangles apart from each other along creases."""
        if not any(part.sharp.any() for part in self.parts):
            return self.frames
        smooth = [part.smooth_frames for part in self.parts]
        return FaceFrames.of(*_together([(torch.from_numpy(of.points), of.topology) for of in smooth]))

    @cached_property
    def directions(self) -> Directions:
        """Of all components."""
        return Directions(
            np.concatenate([of.at_corners for of in self.fields]),
            np.concatenate([of.means for of in self.fields]),
            np.concatenate([of.confidence for of in self.fields]),
        )

    @cached_property
    def total_absolute_curvature(self) -> float:
        """C of the smooth surface whose normals are those of the fits at the vertices, and of creases ``l l*``.

        It is nearer to that of smooth surfaces than :class:`torchfair.energies.TotalAbsoluteCurvature` of the
        triangles, which misses half of the stars at the boundary, and takes noise for curvature.
        """
        smooth = self.smooth_frames
        normals = torch.cat([of.normals for of in self.fits])
        inside = smooth_absolute_curvature(torch.from_numpy(smooth.points), smooth.topology, normals)
        return float(inside) + sum(part.crease_variation for part in self.parts)

    def component(self, number: int) -> ReadSurface:
        """One component by itself."""
        if len(self.parts) == 1:
            return self  # with what has been made of it
        only = slice(number, number + 1)
        return ReadSurface(self.parts[only], self.fields[only], self.fits[only], [])

    def sized(self, sizes: SizeField) -> list[DesignSurface]:
        """The components with spacings that differ."""
        counts = [part.topology.num_faces for part in self.parts]
        return [replace(part, sizes=of) for part, of in zip(self.parts, sizes.split(counts), strict=True)]

    @cached_property
    def shape(self) -> Shape:
        """Euler number, loops and components."""
        return shape_of(self.whole[1])


def read_surface(
    vertices: Tensor, topology: Topology, settings: MeshingSettings, count: int | None = None
) -> ReadSurface:
    """The components of a mesh with their directions. Errors as of :func:`principal_quads`, for a count of faces."""
    if count is not None:
        check_count("count", count, least=1)
        check_welded(vertices, topology, count)
    parts = components_of(vertices, topology, settings.crease_angle)
    found = [part.directions(settings.noise) for part in parts]
    notes = [
        f"{_name(number, len(parts))}the surface is rough: curvature fitted over {fitted.rings} rings"
        for number, (_, fitted) in enumerate(found)
        if fitted.rings > 2 and settings.noise == "auto"
    ]
    return ReadSurface(parts, [of for of, _ in found], [fitted for _, fitted in found], notes)


def spacing_of(surface: ReadSurface, face_area: float, count: int | None, spacing: float | None) -> float:
    """The spacing asked for, or that of a count of faces, each with an area over the squared spacing.

    Raises:
        SettingsError: if neither or both are given, or the spacing is out of range; counts are checked before.
    """
    if (count is None) == (spacing is None):
        raise SettingsError("give either count or spacing")
    if spacing is not None:
        check_number("spacing", spacing, above=True, finite=True)
        return float(spacing)
    assert count is not None
    return math.sqrt(math.fsum(part.frames.areas.sum() for part in surface.parts) / (count * face_area))


@dataclass(frozen=True, eq=False)
class Pieces:
    """The meshes of all components as one.

    Attributes:
        positions: (V, 3).
        faces: vertices counterclockwise; of lattices with rows triangles.
        rows: edges with the second coordinate constant, the smaller vertex first.
        creases: edges along creases.
        places: (n, 3) singular points.
        indices: (n,) of the field.
        notes: what was changed, in words.
        plans: (components) number of the plan that gave each.
        counts: (components) vertices of each, one after the other.
        sizes: what lengths were asked for, None if they were the same everywhere.
    """

    positions: Floats
    faces: list[list[int]]
    rows: set[tuple[int, int]]
    creases: MeshCreases
    places: Tensor
    indices: Tensor
    notes: list[str]
    plans: list[int]
    counts: list[int]
    sizes: CurvatureSizes | None

    def moved(self, positions: Floats) -> Pieces:
        """The same with vertices elsewhere, (V, 3); singular points that lie on vertices go with them."""
        places = self.places.clone()
        which, vertex = np.nonzero((places.numpy()[:, None] == self.positions).all(-1))
        places[torch.from_numpy(which)] = torch.from_numpy(positions[vertex])
        return replace(self, positions=positions, places=places)


def mesh_components(
    surface: ReadSurface,
    lattices: list[Lattice],
    spacing: float,
    settings: MeshingSettings,
    again: list[Again] | None = None,
) -> Pieces:
    """Meshes every component with a lattice.

    Args:
        surface: with its directions.
        lattices: of the components.
        spacing: length of edges.
        settings: of the meshes.
        again: what is kept of meshes of the components with another spacing; by default there are none.

    Raises:
        NoMeshError: if one has no valid mesh.
    """
    made: list[PieceMesh] = []
    notes, taken = [], []
    sizes = surface.sizing and surface.sizing(spacing)
    parts = surface.parts if sizes is None else surface.sized(sizes.field)
    for number, (part, directions) in enumerate(zip(parts, surface.fields, strict=True)):
        smoothing = settings.smoothing_length(surface.fits[number].rings)
        kept = None if again is None else again[number]
        mesh, words, plan = mesh_component(part, directions, lattices[number], spacing, smoothing, settings, kept)
        taken.append(plan)
        if words:
            name = _name(number, len(surface.parts))
            notes.append(f"{name}not as asked for, which gave no valid mesh: {words}")
        made.append(mesh)
    offsets = np.cumsum([0, *(len(mesh.positions) for mesh in made[:-1])]).tolist()
    both = list(zip(made, offsets, strict=True))
    return Pieces(
        np.concatenate([mesh.positions for mesh in made]),
        [[node + offset for node in face] for mesh, offset in both for face in mesh.faces],
        {(a + offset, b + offset) for mesh, offset in both for a, b in mesh.rows},
        MeshCreases(
            torch.from_numpy(np.concatenate([mesh.creases + offset for mesh, offset in both])),
            torch.from_numpy(np.concatenate([mesh.sharp for mesh in made])),
        ),
        torch.from_numpy(np.concatenate([mesh.singular_places for mesh in made])),
        torch.from_numpy(np.concatenate([mesh.singular_charges / 4 for mesh in made])),
        notes,
        taken,
        [len(mesh.positions) for mesh in made],
        sizes,
    )


def on_surface(pieces: Pieces, surface: ReadSurface, settings: MeshingSettings) -> Pieces:
    """Pieces with vertices and singular points where the settings want them: on the curved surface or on triangles.

    Those on creases stay; all do where a face would have a corner without an angle, and a note says so.
    """
    if not settings.curved:
        return pieces
    flat, on_creases = torch.from_numpy(pieces.positions), pieces.creases.edges.flatten()
    moved = surface.curved(torch.cat([flat, pieces.places]))
    positions, places = moved[: len(flat)].index_copy(0, on_creases, flat[on_creases]), moved[len(flat) :]
    try:
        verify_corners(positions.numpy(), pieces.faces)
    except MeshError as error:
        return replace(pieces, notes=[*pieces.notes, f"vertices lie on flat triangles: on the curved surface {error}"])
    return replace(pieces, positions=positions.numpy(), places=places)


def _name(number: int, count: int) -> str:
    return f"component {number + 1}: " if count > 1 else ""


def _together(meshes: list[tuple[Tensor, Topology]]) -> tuple[Tensor, Topology]:
    """Triangles of meshes as one mesh, in order."""
    if len(meshes) == 1:
        return meshes[0]
    offsets = np.cumsum([0, *(topology.num_vertices for _, topology in meshes)])
    faces = [topology.triangles + int(offset) for (_, topology), offset in zip(meshes, offsets, strict=False)]
    vertices = torch.cat([points for points, _ in meshes])
    return vertices, Topology.from_faces(torch.cat(faces), len(vertices))
