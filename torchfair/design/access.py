"""Who may talk to the server: names of hosts, origins, a token."""

from __future__ import annotations

import hmac
import secrets
from collections.abc import Iterable
from urllib.parse import urlsplit

LOOPBACK = ("localhost", "127.0.0.1", "::1")
_TOKEN_BYTES = 24


def new_token() -> str:
    """A token that nobody guesses, for the fragment of an address."""
    return secrets.token_urlsafe(_TOKEN_BYTES)


class Access:
    """What is let in.

    Names of hosts are compared without ports: an ssh tunnel changes these.

    Args:
        token: That every window has to say.
        hosts: Names under which the server is reached.
    """

    def __init__(self, token: str, hosts: Iterable[str] = LOOPBACK) -> None:
        self._token, self._hosts = token, {host.lower() for host in hosts}

    def host_is_right(self, header: str | None) -> bool:
        """Whether a request means this server; a page of elsewhere that rebinds its name does not."""
        return header is not None and _name(f"//{header}") in self._hosts

    def origin_is_right(self, header: str | None) -> bool:
        """Whether a socket is opened by a page of this server; programs that are no browsers send no origin."""
        if header is None:
            return True
        scheme, _, _ = header.partition("://")
        return scheme in ("http", "https") and _name(header) in self._hosts

    def token_is_right(self, token: str) -> bool:
        """Whether it is the token; takes as long whatever is wrong."""
        return hmac.compare_digest(token.encode("utf-8", "surrogatepass"), self._token.encode())


def _name(address: str) -> str | None:
    try:
        parts = urlsplit(address)
        parts.port  # noqa: B018  (ValueError for what is none)
    except ValueError:
        return None
    return None if parts.username is not None else parts.hostname
