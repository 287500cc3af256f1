"""The server of the page: desk, checker and shelf, then NiceGUI until Ctrl-C.

All that the page needs is in NiceGUI's package; nothing is fetched from elsewhere.
"""

from __future__ import annotations

import gc
import os
import socket
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from quito_cli.errors import UnavailableError, UsageError

if TYPE_CHECKING:
    from quito_cli.gui.page_state import Services

_ICON = (
    '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 32 32"><rect width="32" height="32" '
    'rx="6" fill="#0a5a9c"/><path d="M5 22H13V9h7c3 0 3 9 7 9" fill="none" stroke="#fff" '
    'stroke-width="3" stroke-linejoin="round" stroke-linecap="round"/></svg>'
)
"""A control with a jump and a singular arc."""
PORT = 8431
"""Where the page is unless another port is asked for; the next free one if it is taken."""
_TRIED = 50
"""Ports after it."""
_CHECK_SECONDS, _CHECK_MEMORY = 5.0, 1 << 30
"""What looking at a text may take."""
_EXPORT_SECONDS = 60.0
"""What making a download may take."""
_SWEEP = 60.0
"""Seconds between looks for tabs that are gone."""
_HISTORY = 100
"""Messages that a page without connection finds waiting; with more, it is made anew."""
_RECONNECT = 20.0
"""Seconds that a page without connection is waited for before it is made anew."""


def serve(
    folder: Path | None,
    host: str,
    port: int | None,
    *,
    browser: bool,
    say: Callable[[str], None],
) -> None:
    """Serve the page until it is interrupted.

    Args:
        folder: where own problems are, or None.
        host: the address to bind to.
        port: to listen on; None for `PORT`, or the next free one.
        browser: whether to open one.
        say: told the address.

    Raises:
        UnavailableError: NiceGUI is not installed.
        UsageError: the folder cannot be read, or the port is taken.
    """
    try:
        import latex2mathml
        import nicegui
    except ImportError:
        raise UnavailableError(
            'the page needs NiceGUI, which is not installed: pip install "quito[gui]"'
        ) from None
    del latex2mathml, nicegui  # they are there
    gc.enable()  # a command does without, but this one runs for days
    _serve(folder, host, free_port(host, port), browser, say)


def _serve(
    folder: Path | None, host: str, port: int, browser: bool, say: Callable[[str], None]
) -> None:
    from nicegui import app
    from starlette.requests import Request
    from starlette.responses import PlainTextResponse, Response

    from quito_cli.gui.guard import Guard, address, doors
    from quito_cli.gui.page import page
    from quito_cli.gui.settings import settings

    settings({})  # it takes a moment, and the first page wants to know
    with _services(folder) as services:
        allowed = doors(host, port)
        app.add_middleware(Guard, doors=allowed)

        async def root(request: Request) -> Response | None:
            if request.url.path != "/":  # NiceGUI asks for the page wherever there is nothing
                return PlainTextResponse("There is nothing here.\n", 404)
            await page(services)
            return None

        app.on_exception(_tell)
        app.on_page_exception(_apologise)
        app.on_startup(lambda: _announce(address(allowed), say, browser))
        app.on_startup(services.checker.solvers)  # so does this
        app.timer(_SWEEP, services.tabs.sweep)
        _run(root, host, port)


@contextmanager
def _services(folder: Path | None) -> Iterator[Services]:
    """What the page stands on, for as long as it is served."""
    from quito_cli.gui.checking import Checker
    from quito_cli.gui.desk import LIMITS, Desk
    from quito_cli.gui.exports import Exporter
    from quito_cli.gui.page_state import Services, Tabs
    from quito_cli.gui.shelf import Shelf

    shelf = Shelf(folder, LIMITS.characters)
    desk = Desk(LIMITS, workers=workers())
    checker = Checker(_CHECK_SECONDS, _CHECK_MEMORY, LIMITS.characters)
    exporter = Exporter(_EXPORT_SECONDS, LIMITS.memory)
    try:
        yield Services(desk, checker, exporter, shelf, Tabs(desk), LIMITS.characters)
    finally:
        checker.close()
        exporter.close()
        desk.close()
        shelf.close()


def _run(root: Callable[..., Any], host: str, port: int) -> None:
    """Run NiceGUI's server until Ctrl-C."""
    import logging

    from nicegui import ui

    if not os.environ.get("QUITO_DEBUG"):  # errors are told on the page, without tracebacks
        logging.getLogger("nicegui").setLevel(logging.CRITICAL)
    with suppress(KeyboardInterrupt):
        ui.run(
            root,
            host=host,
            port=port,
            title="quito",
            favicon=_ICON,
            dark=None,
            language="en-GB",
            show=False,
            reload=False,
            tailwind=False,
            gzip_middleware_factory=None,  # on the loopback it costs more than it saves
            show_welcome_message=False,
            reconnect_timeout=_RECONNECT,
            binding_refresh_interval=None,
            message_history_length=_HISTORY,
            uvicorn_logging_level="error",
            server_header=False,
            timeout_graceful_shutdown=2,
        )


async def _announce(where: str, say: Callable[[str], None], browser: bool) -> None:
    """Tell the address once it answers, and open it."""
    import asyncio
    import webbrowser

    from nicegui.server import Server

    while not Server.instance.started:
        await asyncio.sleep(0.01)
    say(where)
    if browser:
        await asyncio.to_thread(webbrowser.open, where)


def _tell(error: Exception) -> None:
    """Say on the page that something went wrong in it."""
    from nicegui import ui

    with suppress(RuntimeError):  # nobody is there to be told
        message = f"{type(error).__name__}: {error}".splitlines()[0]
        ui.notify(f"a bug in quito: {message}", type="negative", timeout=0, close_button="Close")


def _apologise(error: Exception) -> None:
    """Say that there is no page, in its place."""
    from nicegui import ui

    ui.label(f"quito could not make this page: {type(error).__name__}. Please load it again.")


def workers() -> int:
    """Return how many solves may run at once: one processor is left to the page."""
    count = len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count() or 1
    return max(1, count - 1)


def free_port(host: str, port: int | None) -> int:
    """Return a port that can be listened on.

    Raises:
        UsageError: the one asked for is taken, or the address is none of this machine.
    """
    wanted = range(PORT, PORT + _TRIED) if port is None else (port,)
    problem: OSError | None = None
    for each in wanted:
        try:
            _try(host, each)
        except OSError as error:
            problem = error
        else:
            return each
    if port is None:
        raise UsageError(f"cannot listen on {host}: {problem and problem.strerror}")
    raise UsageError(
        f"cannot listen on {host} port {port}: {problem and problem.strerror}; leave --port out to "
        "take the next free one"
    )


def _try(host: str, port: int) -> None:
    """Bind to a port and let it go again.

    Raises:
        OSError: it cannot be bound to.
    """
    family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
    with socket.socket(family, kind, protocol) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        probe.bind(address)
