"""``torchfair design``: pulls handles in the browser, the mesh answers."""

from __future__ import annotations

import argparse
import sys
import webbrowser
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .._reading_words import words_of
from .arguments import count
from .errors import CommandError
from .exit_codes import EXIT_OK
from .reading import add_repair, read_options

if TYPE_CHECKING:
    from ..design.engine.requests import Open
    from ..design.server import DesignServer

NAME = "torchfair design"
_DESCRIPTION = (
    "Opens a page in the browser in which a mesh follows the mouse: handles are pulled, vertices fixed, weights "
    "turned, and facets are shown as mirrors. Files are those of the folder in which the command is started. The page "
    "is reached from this machine alone, with the token in its address; from elsewhere through ssh -L."
)
_LOOPBACK = ("127.0.0.1", "localhost", "::1")
_MEBIBYTE = 1 << 20


def add_parser(subparsers: Any) -> None:
    """Adds ``design`` to the commands."""
    parser: argparse.ArgumentParser = subparsers.add_parser(
        "design", help="pull handles in the browser", description=_DESCRIPTION, allow_abbrev=False
    )
    add = parser.add_argument
    add("input", metavar="INPUT", nargs="?", help="mesh file, session file, or a built-in example:NAME (default: "
        "choose in the page)")  # fmt: skip
    add("--no-browser", action="store_true", help="print the address only")
    add("--port", type=count, default=0, metavar="N", help="port (default: any that is free)")
    add("--host", default="127.0.0.1", metavar="ADDRESS", help="address to listen on (default 127.0.0.1); with another "
        "one every machine that reaches it and knows the token may use the page")  # fmt: skip
    add("--name", action="append", default=[], metavar="HOST", help="a name under which browsers reach the server, "
        "besides those of this machine; repeatable")  # fmt: skip
    add("--frame", action="append", default=[], metavar="ORIGIN", help="let pages of this origin, such as a notebook "
        "server, show the page in a frame; repeatable")  # fmt: skip
    add("--upload", type=count, default=128, metavar="MIB", help="largest file that may be dropped (default 128)")
    add_repair(parser)
    parser.set_defaults(run=run, name=NAME)


def run(arguments: argparse.Namespace) -> int:
    """Serves until Ctrl-C."""
    import asyncio

    from ..design.running import require_websockets, serve

    require_websockets()
    from ..design.server import DesignServer, ServerSettings

    if arguments.port > 65535:
        raise CommandError(f"--port: expected at most 65535, got {arguments.port}")
    opening = _opening(arguments)
    names = list(arguments.name)
    if arguments.host not in _LOOPBACK:
        names.append(arguments.host)
        print(
            f"{NAME}: warning: the page can be reached from other machines; whoever knows its address with the token "
            "reads and writes files of this folder. Traffic is not encrypted: prefer ssh -L",
            file=sys.stderr,
        )
    settings = ServerSettings(
        Path.cwd(), arguments.host, arguments.port, names, arguments.frame, arguments.upload * _MEBIBYTE
    )

    def ready(server: DesignServer) -> None:
        print(f"{NAME}: {server.url}\nCtrl-C ends it", flush=True)
        if not arguments.no_browser:
            webbrowser.open(server.url)

    with suppress(KeyboardInterrupt):
        asyncio.run(serve(DesignServer(settings, opening), ready))
    return EXIT_OK


def _opening(arguments: argparse.Namespace) -> Open | None:
    """What is opened first."""
    from ..design.engine.requests import Open

    if arguments.input is None:
        return None
    repair = words_of(read_options(arguments))
    if not arguments.input.startswith("example:") and not Path(arguments.input).is_file():
        raise CommandError(f"{arguments.input}: there is no such file")
    title = arguments.input if arguments.input.startswith("example:") else Path(arguments.input).name
    return Open(0, arguments.input, None, title, repair, bool(repair))
