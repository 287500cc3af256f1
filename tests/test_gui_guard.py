"""The guard: which hosts, origins and tokens are let in, and what every answer carries."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass
from http.cookies import SimpleCookie
from typing import Any
from urllib.parse import parse_qs, urlsplit

import pytest

pytest.importorskip("starlette", reason="the page is an extra: pip install 'quito[gui]'")

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket

from quito_cli.gui.guard import Doors, Guard, address, doors

PORT = 8431
OPEN = Doors("127.0.0.1", PORT, None)
KEPT = Doors("0.0.0.0", PORT, "the-token")
FOREIGN = "This host is not known here: open http://localhost with the port.\n"

Headers = list[tuple[str, str]]


async def page(request: Request) -> Response:
    return PlainTextResponse("page", headers={"X-Frame-Options": "ALLOWALL"})


async def talk(socket: WebSocket) -> None:
    await socket.accept()
    await socket.send_text("hello")
    await socket.close()


@dataclass(frozen=True)
class Got:
    """An answer."""

    status: int
    text: str
    headers: Headers

    def __getitem__(self, name: str) -> str:
        (value,) = [value for key, value in self.headers if key == name]
        return value


class Web:
    """Who asks: what it sends is what arrives, and it keeps its cookies as browsers do."""

    def __init__(self, allowed: Doors) -> None:
        routes = [WebSocketRoute("/ws", talk), Route("/{rest:path}", page, methods=["GET", "POST"])]
        self._app = Starlette(routes=routes)
        self._app.add_middleware(Guard, doors=allowed)
        self.cookies: dict[str, str] = {}

    def _messages(self, scope: dict[str, Any], url: str, headers: Headers) -> list[Any]:
        path, _, query = url.partition("?")
        cookie = "; ".join(f"{name}={value}" for name, value in self.cookies.items())
        usual = {"host": "localhost:8431"} | ({"cookie": cookie} if cookie else {})
        named = dict(headers)
        listed = [*((k, v) for k, v in usual.items() if k not in named), *headers]
        sent: list[Any] = []

        async def receive() -> dict[str, Any]:
            kind = {"http": "http.request", "websocket": "websocket.connect"}[scope["type"]]
            return {"type": kind, "body": b"", "more_body": False}

        async def send(message: Any) -> None:
            sent.append(message)

        whole = {
            **scope,
            "asgi": {"version": "3.0"},
            "http_version": "1.1",
            "path": path,
            "raw_path": path.encode(),
            "query_string": query.encode("utf-8"),
            "root_path": "",
            "headers": [(k.encode(), v.encode("utf-8")) for k, v in listed],
            "client": ("192.0.2.1", 5000),
            "server": ("127.0.0.1", PORT),
            "extensions": {},
        }
        asyncio.run(self._app(whole, receive, send))
        return sent

    def ask(self, url: str = "/", method: str = "GET", **headers: str) -> Got:
        named = [(name.replace("_", "-"), value) for name, value in headers.items()]
        return self.ask_with(url, named, method)

    def ask_with(self, url: str, headers: Headers, method: str = "GET") -> Got:
        scope = {"type": "http", "method": method, "scheme": "http"}
        start, *rest = self._messages(scope, url, headers)
        got = [(key.decode().lower(), value.decode("latin-1")) for key, value in start["headers"]]
        for key, value in got:
            if key == "set-cookie":
                self.cookies |= {name: one.value for name, one in SimpleCookie(value).items()}
        text = b"".join(part.get("body", b"") for part in rest).decode()
        return Got(start["status"], text, got)

    def talk(self, **headers: str) -> str:
        """Return what a WebSocket says; empty where it is refused before it is accepted."""
        scope = {"type": "websocket", "scheme": "ws", "subprotocols": []}
        sent = self._messages(scope, "/ws", list(headers.items()))
        if sent[0]["type"] == "websocket.close":
            assert len(sent) == 1
            return ""
        return str(sent[1]["text"])


# Who has to know the token


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "::1", "127.8.0.1"])
def test_the_loopback_needs_no_token(host: str) -> None:
    assert doors(host, PORT).token is None


@pytest.mark.parametrize("host", ["0.0.0.0", "", "::", "192.168.1.5", "fe80::1", "box.local"])
def test_every_other_address_needs_one(host: str) -> None:
    first, second = doors(host, PORT), doors(host, PORT)
    assert first.token
    assert len(first.token) >= 43  # 256 bits
    assert first.token != second.token


def test_the_address_to_open() -> None:
    assert address(OPEN) == "http://127.0.0.1:8431/"
    assert address(Doors("::1", PORT, None)) == "http://[::1]:8431/"
    parts = urlsplit(address(KEPT))
    assert parts.hostname not in (None, "0.0.0.0")
    assert parse_qs(parts.query) == {"token": ["the-token"]}


# Hosts


@pytest.mark.parametrize(
    "host",
    [
        "localhost:8431",
        "127.0.0.1:8431",
        "[::1]:8431",
        "LOCALHOST:8431",
        "localhost",
        "localhost:9",
    ],
)
def test_names_of_the_loopback_are_let_in(host: str) -> None:
    assert Web(OPEN).ask(host=host).status == 200
    assert Web(OPEN).talk(host=host) == "hello"


@pytest.mark.parametrize(
    "host",
    [
        "evil.example:8431",
        "evil.example",
        "localhost.evil.example",
        "127.0.0.1.nip.io:8431",
        "192.168.1.5:8431",
        "localhost:8431@evil.example",
        "localhost evil.example",
        "localhost:abc",
        "[::1",
        "",
    ],
)
def test_names_bound_anew_are_refused(host: str) -> None:
    refused = Web(OPEN).ask(host=host)
    assert (refused.status, refused.text) == (403, FOREIGN)
    assert Web(OPEN).talk(host=host) == ""


def test_two_hosts_are_none() -> None:
    headers = [("host", "localhost:8431"), ("host", "localhost:8431")]
    assert Web(OPEN).ask_with("/", headers).status == 403


# Origins


@pytest.mark.parametrize(
    ("origin", "let_in"),
    [
        ("http://localhost:8431", True),
        ("https://localhost:8431", True),
        ("http://localhost:3000", False),
        ("http://127.0.0.1:8431", False),
        ("http://evil.example", False),
        ("http://localhost:8431.evil.example", False),
        ("http://evil.example/localhost:8431", False),
        ("file://localhost:8431", False),
        ("null", False),
        ("", False),
    ],
)
def test_other_sites_may_not_use_it(origin: str, let_in: bool) -> None:
    assert Web(OPEN).ask(method="POST", origin=origin).status == (200 if let_in else 403)
    assert Web(OPEN).talk(origin=origin) == ("hello" if let_in else "")


def test_other_sites_may_link_to_it_and_no_more() -> None:
    web = Web(OPEN)
    assert web.ask(sec_fetch_site="cross-site", sec_fetch_mode="navigate").status == 200
    for mode in ("no-cors", "cors", "websocket"):
        assert web.ask(sec_fetch_site="cross-site", sec_fetch_mode=mode).status == 403
    assert web.ask(sec_fetch_site="same-origin", sec_fetch_mode="no-cors").status == 200


# Tokens


def test_the_token_is_asked_for_once_and_then_the_cookie_does() -> None:
    web = Web(KEPT)
    assert (web.ask().status, web.talk()) == (401, "")
    welcome = web.ask("/deep/er?a=1&token=the-token&b=%26")
    assert (welcome.status, welcome.text) == (303, "")
    assert welcome["location"] == "/deep/er?a=1&b=%26"
    parts = {part.strip() for part in welcome["set-cookie"].split(";")}
    assert {"HttpOnly", "SameSite=Lax", "Path=/"} < parts
    assert web.ask().status == 200
    assert web.talk() == "hello"


def test_a_websocket_takes_the_cookie_alone() -> None:
    assert Web(KEPT).talk(cookie=f"quito-{PORT}=the-token") == "hello"
    assert Web(KEPT).talk(cookie=f"quito-{PORT}=another") == ""


@pytest.mark.parametrize(
    "token", ["", "the-toke", "the-tokenx", "THE-TOKEN", "ü", "%00", "%FF%FE", "*", "None"]
)
def test_wrong_tokens_are_refused(token: str) -> None:
    refused = Web(KEPT).ask(f"/?token={token}")
    assert (refused.status, "page" in refused.text) == (401, False)
    assert Web(KEPT).ask(cookie=f"quito-{PORT}={token}").status == 401


@pytest.mark.parametrize(
    "cookie", ["quito-8431", "a=b; quito-8432=the-token", "=;=;", "quito-8431=\x01", "x" * 10_000]
)
def test_other_cookies_are_no_tokens(cookie: str) -> None:
    assert Web(KEPT).ask(cookie=cookie).status == 401


def test_tokens_are_compared_in_constant_time(monkeypatch: pytest.MonkeyPatch) -> None:
    compared: list[tuple[Any, Any]] = []

    def compare(a: bytes, b: bytes) -> bool:
        compared.append((a, b))
        return False

    monkeypatch.setattr("hmac.compare_digest", compare)
    assert Web(KEPT).ask("/?token=the-token").status == 401
    assert compared == [(b"the-token", b"the-token")]


def test_a_token_is_no_pass_for_other_sites() -> None:
    web = Web(KEPT)
    web.ask("/?token=the-token")
    assert web.ask(method="POST", origin="http://evil.example").status == 403
    assert web.talk(origin="http://evil.example") == ""
    assert web.ask(method="POST", origin="http://localhost:8431").status == 200


@pytest.mark.parametrize("path", ["//evil.example/", "/\\evil.example", "/\r\nset-cookie:a=b"])
def test_a_welcome_stays_on_this_host(path: str) -> None:
    web = Web(KEPT)
    welcome = web.ask(f"{path}?token=the-token")
    assert welcome.status == 303
    assert welcome["location"][0] == "/"
    assert welcome["location"][1] not in "/\\"
    assert "\n" not in welcome["location"]
    assert list(web.cookies) == [f"quito-{PORT}"]


# Headers


def test_every_answer_carries_the_headers_of_safety() -> None:
    answers = (Web(OPEN).ask(), Web(KEPT).ask(), Web(OPEN).ask(host="x"))
    assert [answer.status for answer in answers] == [200, 401, 403]
    for answer in answers:
        assert answer["x-content-type-options"] == "nosniff"
        assert answer["referrer-policy"] == "no-referrer"
        assert answer["x-frame-options"] == "DENY"
        assert answer["cross-origin-opener-policy"] == "same-origin"
        assert answer["cross-origin-resource-policy"] == "same-origin"


def test_the_policy_lets_nothing_in_from_elsewhere() -> None:
    policy = Web(OPEN).ask()["content-security-policy"]
    rules = {rule.split()[0]: set(rule.split()[1:]) for rule in policy.split("; ")}
    assert rules["default-src"] == {"'none'"}
    assert rules["frame-ancestors"] == rules["base-uri"] == {"'none'"}
    assert rules["connect-src"] == {"'self'", "ws://localhost:8431", "wss://localhost:8431"}
    allowed = set().union(*rules.values()) - rules["connect-src"]
    assert not [source for source in allowed if "*" in source or "//" in source]


def test_the_host_of_the_policy_is_nothing_else() -> None:
    answer = Web(KEPT).ask(host="a.example; script-src *", cookie=f"quito-{PORT}=the-token")
    assert answer.status == 403


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ([("content-length", "3000000")], 200),
        ([("content-length", "5000000")], 413),
        ([("content-length", "-1")], 413),
        ([("transfer-encoding", "chunked")], 413),
    ],
)
def test_nobody_brings_more_than_a_problem_file_has(headers: Headers, status: int) -> None:
    assert Web(OPEN).ask_with("/", headers, method="POST").status == status
