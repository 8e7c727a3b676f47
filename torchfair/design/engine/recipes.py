"""Live sessions made from documents."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from ...errors import MeshError
from ...formfinding import FairRecipe, FormRecipe, Session, SymmetricRecipe
from ...principal import PrincipalEdges, principal_edges_from_directions
from ...topology import Topology
from ..document import Document, Faces
from .sliders import settings_of

AnyRecipe = FairRecipe | FormRecipe | SymmetricRecipe


def tensor_of(array: np.ndarray) -> Tensor:
    """A copy of an array of a document, which nothing may change."""
    return torch.from_numpy(array.copy())


def topology_of(document: Document) -> Topology:
    """Connectivity of a document."""
    return Topology.from_packed_faces(document.faces.corners, document.faces.offsets, document.count)


def faces_of(topology: Topology) -> Faces:
    """The polygons of a topology."""
    return Faces(topology.corners.numpy(), topology.face_offsets.numpy())


def principal_of(document: Document, topology: Topology) -> PrincipalEdges:
    """Principal edges of a document: those that are marked, else those along principal directions.

    Raises:
        MeshError: the mesh has other faces than triangles, or no family of edges fits.
    """
    if not topology.is_triangular:
        raise MeshError("principal-symmetric meshes are triangle meshes: mesh this surface with triangles first")
    if document.principal is not None:
        return PrincipalEdges(topology, tensor_of(document.principal))
    found = principal_edges_from_directions(tensor_of(document.vertices), topology, allow_exceptions=True)
    return found.edges


def session_of(document: Document) -> Session[AnyRecipe]:
    """A live session that stands where the document does.

    Raises:
        TorchfairError: the job is not possible on this mesh, with the reason.
    """
    session = _at_the_start(document)
    put(session, document)
    return session


def put(session: Session[AnyRecipe], document: Document) -> None:
    """Brings a session of the same job to where the document stands: places, handles, fixed vertices, weights."""
    recipe = session.recipe
    recipe.pulls.free(torch.arange(document.count))
    recipe.take_settings(settings_of(document))
    session.place(tensor_of(document.vertices))
    if document.held:
        session.hold(document.held)
    if document.handles:
        session.move(document.handles)


def same_job(one: Document, other: Document) -> bool:
    """Whether a session of one can be put where the other stands."""
    if one.mode != other.mode or one.choices.get(one.mode, {}) != other.choices.get(one.mode, {}):
        return False
    same = one.faces.same(other.faces) and np.array_equal(one.start, other.start)
    if not same or not _same_labels(one, other):
        return False
    if one.coarse is None or other.coarse is None:
        return one.coarse is other.coarse
    return one.coarse is other.coarse or (
        same_job(one.coarse, other.coarse) and np.array_equal(one.coarse.vertices, other.coarse.vertices)
    )


def _same_labels(one: Document, other: Document) -> bool:
    if one.principal is None or other.principal is None:
        return one.principal is other.principal
    return np.array_equal(one.principal, other.principal)


def _at_the_start(document: Document) -> Session[AnyRecipe]:
    settings = settings_of(document)
    if document.coarse is not None:
        return session_of(_in_the_same_job(document.coarse, document)).refined()
    topology, start = topology_of(document), tensor_of(document.start)
    if document.mode == "fair":
        return Session(FairRecipe(start, topology, settings=settings))
    if document.mode == "form":
        return Session(FormRecipe(start, topology, settings=settings))
    return Session(SymmetricRecipe(start, principal_of(document, topology), settings=settings))


def _in_the_same_job(coarse: Document, fine: Document) -> Document:
    """The coarser mesh, with the choices of the finer one."""
    chosen = fine.choices.get(fine.mode, {})
    return coarse.choosing(chosen) if chosen else coarse
