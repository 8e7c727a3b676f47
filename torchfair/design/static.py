"""The files of the page, and what goes with every answer."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

PAGE = Path(__file__).parent / "page"
_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
    ".png": "image/png",
    ".ico": "image/x-icon",
    ".webp": "image/webp",
    ".jpg": "image/jpeg",
    ".txt": "text/plain; charset=utf-8",
}
_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; connect-src 'self'; "
    "font-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors "
)


@dataclass(frozen=True)
class Page:
    """A file that may be served.

    Attributes:
        media: Its type.
        content: Its bytes.
    """

    media: str
    content: bytes


def pages(folder: Path = PAGE) -> dict[str, Page]:
    """The allow-list: files of a folder by their paths from it, and the empty path for index.html."""
    found = {}
    for path in sorted(folder.rglob("*")):
        if path.is_file() and path.suffix in _TYPES and not path.is_symlink():
            found[path.relative_to(folder).as_posix()] = Page(_TYPES[path.suffix], path.read_bytes())
    if "index.html" in found:
        found[""] = found["index.html"]
    return found


def page_at(target: str, known: Mapping[str, Page]) -> Page | None:
    """What stands at the target of a request, whatever the prefix is under which a proxy puts the page.

    Of all names that the path ends in, after a slash, the longest counts; nothing is ever looked up on the disk.
    """
    path = target.partition("?")[0].partition("#")[0]
    if not path.startswith("/"):
        return None
    parts = path.split("/")[1:]
    for first in range(len(parts)):
        page = known.get("/".join(parts[first:]))
        if page is not None:
            return page
    return None


def is_socket(target: str) -> bool:
    """Whether a path is that of the socket, under any prefix."""
    return target.partition("?")[0].endswith("/socket")


def headers(media: str, *, framed: Iterable[str] = ()) -> dict[str, str]:
    """Headers of every answer.

    Args:
        media: Type of the content.
        framed: Who may show the page in a frame, as sources of ``frame-ancestors``; by default nobody.
    """
    return {
        "Content-Type": media,
        "Content-Security-Policy": _POLICY + (" ".join(framed) or "'none'"),
        "X-Content-Type-Options": "nosniff",
        "Referrer-Policy": "no-referrer",
        "Cross-Origin-Resource-Policy": "same-origin",
        "Cache-Control": "no-cache",
    }
