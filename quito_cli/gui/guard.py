"""What stands before the page: the hosts it answers to, the token, and the headers of safety.

A page on the loopback is open to every site that a browser visits: by a name that is bound anew to
127.0.0.1 (DNS rebinding), or by a WebSocket, which asks no permission. So the `Host` of a request
must be one of ours, and the `Origin`, where there is one, the very same host. On any other address
whoever comes must know a token: it is in the address that is printed at the start, and in a cookie
from then on. Foreign names gain nothing there, for they have no cookie.
"""

from __future__ import annotations

import hmac
import ipaddress
import re
import secrets
import socket
from dataclasses import dataclass
from http.cookies import CookieError, SimpleCookie
from typing import TYPE_CHECKING, Final
from urllib.parse import parse_qsl, quote, urlencode, urlsplit

if TYPE_CHECKING:
    from starlette.types import ASGIApp, Message, Receive, Scope, Send

_LOOPBACK: Final = frozenset({"localhost", "127.0.0.1", "[::1]"})
_HOST: Final = re.compile(r"(?P<name>\[[0-9a-f:.]+\]|[0-9a-z._-]+)(:(?P<port>[0-9]{1,5}))?")
_PARAMETER: Final = "token"
_MOST_BYTES: Final = 4_000_000
"""Of what a request brings: an upload of the longest text in four bytes a character, and more."""
_HEADERS: Final = {
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "x-frame-options": "DENY",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "permissions-policy": "camera=(), geolocation=(), microphone=()",
}
_POLICY: Final = (
    "default-src 'none'",
    "script-src 'self' 'unsafe-inline' 'unsafe-eval'",  # NiceGUI starts inline; Vue compiles
    "style-src 'self' 'unsafe-inline'",  # Quasar's and Vue's styles are attributes
    "img-src 'self' data:",
    "font-src 'self'",
    "base-uri 'none'",
    "form-action 'self'",
    "frame-ancestors 'none'",
)
"""But for `connect-src`: what a browser counts as 'self' has no WebSockets everywhere."""


@dataclass(frozen=True)
class Doors:
    """Who may come in."""

    host: str
    """The address bound to."""
    port: int
    token: str | None
    """None on the loopback."""


def doors(host: str, port: int) -> Doors:
    """Return who may come in to a server: anyone on the loopback, else who knows a new token."""
    return Doors(host, port, None if _is_loopback(host) else secrets.token_urlsafe(32))


def address(doors: Doors) -> str:
    """Return the address to open, with the token in it where there is one."""
    everywhere = doors.host in ("", "0.0.0.0", "::")
    name = socket.gethostname() if everywhere else _bracketed(doors.host)
    query = f"?{urlencode({_PARAMETER: doors.token})}" if doors.token else ""
    return f"http://{name}:{doors.port}/{query}"


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:  # a name, which may be bound to anything but for this one
        return host == "localhost"


def _bracketed(host: str) -> str:
    return f"[{host}]" if ":" in host else host


class Guard:
    """ASGI middleware: `app.add_middleware(Guard, doors=doors(host, port))`."""

    def __init__(self, app: ASGIApp, doors: Doors) -> None:
        self._app, self._doors = app, doors
        self._names = _LOOPBACK | {_bracketed(doors.host).lower()}
        self._cookie = f"quito-{doors.port}"

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let a request through, with headers for its answer; or refuse it."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = _first_of_each(scope)
        host = headers.get("host", "").lower()
        if refusal := self._foreign(host, headers):
            await _refuse(scope, send, 403, refusal)
        elif scope["type"] == "http" and _too_much(headers):
            await _refuse(scope, send, 413, "That is more than a problem file has.")
        elif self._known(headers):
            await self._app(scope, receive, _dressed(send, host))
        elif scope["type"] == "http" and self._knows(_token_of(scope)):
            await self._welcome(scope, send)
        else:
            said = "Open the address that quito gui has printed: the token in it lets you in."
            await _refuse(scope, send, 401, said)

    def _foreign(self, host: str, headers: dict[str, str]) -> str:
        """Say why a request is not from a page of ours; nothing where it may be."""
        named = _HOST.fullmatch(host)
        if named is None or (self._doors.token is None and named["name"] not in self._names):
            return "This host is not known here: open http://localhost with the port."
        origin = headers.get("origin")
        if origin is not None:
            parts = urlsplit(origin.lower())
            if parts.scheme not in ("http", "https") or parts.netloc != host:
                return "Another site may not use this page."
        cross = headers.get("sec-fetch-site") in ("cross-site", "same-site")
        if cross and headers.get("sec-fetch-mode") != "navigate":
            return "Another site may not use this page."
        return ""

    def _known(self, headers: dict[str, str]) -> bool:
        if self._doors.token is None:
            return True
        cookies: SimpleCookie = SimpleCookie()
        try:
            cookies.load(headers.get("cookie", ""))
        except CookieError:
            return False
        return self._cookie in cookies and self._knows(cookies[self._cookie].value)

    def _knows(self, token: str) -> bool:
        """Whether that is the token; found in the same time whatever is wrong with it."""
        return self._doors.token is not None and hmac.compare_digest(
            token.encode("utf-8", "replace"), self._doors.token.encode()
        )

    async def _welcome(self, scope: Scope, send: Send) -> None:
        """Give the cookie, and go on without the token in the address."""
        query = parse_qsl(scope["query_string"].decode("latin-1"), keep_blank_values=True)
        rest = urlencode([(name, value) for name, value in query if name != _PARAMETER])
        path = "/" + quote(scope["path"]).lstrip("/")  # two slashes would be another host
        cookie = f"{self._cookie}={self._doors.token}; Path=/; HttpOnly; SameSite=Lax"
        await _answer(
            send, 303, "", {"location": path + (f"?{rest}" if rest else ""), "set-cookie": cookie}
        )


def _too_much(headers: dict[str, str]) -> bool:
    """Whether a request brings more than it may, or does not say how much: it would be kept."""
    length = headers.get("content-length", "0")
    return "transfer-encoding" in headers or not length.isdecimal() or int(length) > _MOST_BYTES


def _first_of_each(scope: Scope) -> dict[str, str]:
    """Return the headers by name; of a Host or Origin given twice no sense can be made."""
    found: dict[str, str] = {}
    for name, value in scope["headers"]:
        key = name.decode("latin-1").lower()
        text = value.decode("latin-1")
        found[key] = f"{found[key]}; {text}" if key in found else text
    return found


def _token_of(scope: Scope) -> str:
    query: bytes = scope["query_string"]
    return dict(parse_qsl(query.decode("latin-1"))).get(_PARAMETER, "")


def _dressed(send: Send, host: str) -> Send:
    """Return a `send` that adds the headers of safety to an answer."""
    policy = (*_POLICY, f"connect-src 'self' ws://{host} wss://{host}")
    added = {**_HEADERS, "content-security-policy": "; ".join(policy)}

    async def dressed(message: Message) -> None:
        if message["type"] == "http.response.start":
            kept = [
                (name, value)
                for name, value in message.get("headers", ())
                if name.decode("latin-1").lower() not in added
            ]
            ours = [(name.encode(), value.encode("latin-1")) for name, value in added.items()]
            message = {**message, "headers": [*kept, *ours]}
        await send(message)

    return dressed


async def _refuse(scope: Scope, send: Send, status: int, said: str) -> None:
    if scope["type"] == "websocket":
        await send({"type": "websocket.close", "code": 1008, "reason": said})
    else:
        await _answer(send, status, said + "\n", {})


async def _answer(send: Send, status: int, said: str, headers: dict[str, str]) -> None:
    body = said.encode()
    every = {
        "content-type": "text/plain; charset=utf-8",
        "content-length": str(len(body)),
        "cache-control": "no-store",
        **_HEADERS,
        **headers,
    }
    listed = [(name.encode(), value.encode("latin-1")) for name, value in every.items()]
    await send({"type": "http.response.start", "status": status, "headers": listed})
    await send({"type": "http.response.body", "body": body})
