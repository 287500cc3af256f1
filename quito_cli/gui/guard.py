"""What stands before the page: the token, the hosts it answers to, and the headers of safety.

A page on the loopback is still open to every site that a browser visits: by a name that is bound
anew to 127.0.0.1 (DNS rebinding), or by a WebSocket, which asks no permission. So the Host of every
request must be one we know, and the Origin, where there is one, must be our own.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Doors:
    """Who may come in."""

    host: str
    """The address bound to."""
    port: int
    token: str | None
    """None on the loopback."""


def doors(host: str, port: int) -> Doors:
    """Return who may come in to a server: anyone on the loopback, else who has the token."""
    raise NotImplementedError


def address(doors: Doors) -> str:
    """Return the address to open, with the token in it where there is one."""
    raise NotImplementedError


class Guard:
    """ASGI middleware: `app.add_middleware(Guard, doors=doors(host, port))`."""
