"""The page inside a notebook."""

from __future__ import annotations

import atexit
import html
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from torch import Tensor

    from ..topology import Topology
    from .document import Document
    from .running import BackgroundServer

_FRAMED = ("'self'", "http://localhost:*", "http://127.0.0.1:*", "vscode-webview:")


class DesignView:
    """A page on a server of its own, which a notebook shows in a frame.

    Attributes:
        url: Address of the page, for a window of its own.
        height: Of the frame, pixels.
    """

    def __init__(self, server: BackgroundServer, height: int) -> None:
        self._server, self.height = server, height
        self.url = server.url
        atexit.register(self.close)

    def _repr_html_(self) -> str:
        address = html.escape(self.url, quote=True)
        style = f"width:100%;height:{int(self.height)}px;border:0"
        return f'<iframe src="{address}" style="{style}" allow="fullscreen"></iframe>'

    @property
    def document(self) -> Document | None:
        """What is on the screen."""
        return self._server.server.session.document

    @property
    def mesh(self) -> tuple[Tensor, Topology]:
        """Vertices (V, 3) float64 and topology of the last settled shape, to go on with in the notebook.

        Raises:
            LookupError: nothing is open yet.
        """
        from .engine.recipes import tensor_of, topology_of

        document = self._server.server.session.history.now
        return tensor_of(document.vertices), topology_of(document)

    def close(self) -> None:
        """Ends the server."""
        self._server.stop()


def view(
    vertices: Tensor, topology: Topology, *, title: str = "mesh", height: int = 640, folder: str | Path = "."
) -> DesignView:
    """Shows a mesh in the page of ``torchfair design``, inside a notebook.

    Args:
        vertices: (V, 3) positions, any length unit.
        topology: Connectivity; any polygons.
        title: What it is called.
        height: Of the frame, pixels.
        folder: Where files are saved.

    Returns:
        What a notebook shows as the page; its ``mesh`` is what has become of the mesh.

    Raises:
        ShapeError: vertices do not fit the topology.
        TorchfairError: websockets is not installed.

    Example::

        page = view(vertices, topology)
        page  # in a cell of its own
        vertices, topology = page.mesh
    """
    from .engine.requests import Open
    from .running import BackgroundServer, require_websockets

    require_websockets()
    from .server import ServerSettings
    from .session_file import SUFFIX
    from .session_writing import session_bytes

    document = _document(vertices, topology, title)
    opening = Open(0, f"{title}{SUFFIX}", session_bytes([document], 0), title)
    settings = ServerSettings(folder=Path(folder), framed=_FRAMED)
    return DesignView(BackgroundServer(settings, opening), height)


def _document(vertices: Tensor, topology: Topology, title: str) -> Document:
    import torch

    from .._one_mesh import one_mesh
    from .document import Document, Faces

    places = one_mesh(vertices, topology).detach().to("cpu", torch.float64).numpy().copy()
    faces = Faces(topology.corners.cpu().numpy(), topology.face_offsets.cpu().numpy())
    return Document(title, "fair", faces, places, places, history=({"do": "open", "source": title},))
