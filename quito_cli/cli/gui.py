"""`quito gui`: the page, served to a browser on this machine."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from quito_cli.cli.text import plain


def gui(
    folder: Annotated[
        Path | None,
        typer.Argument(metavar="[DIR]", help="A folder of problem files to open and to save in."),
    ] = None,
    host: Annotated[
        str,
        typer.Option(help="Address to listen on; any but this machine's own demands a token."),
    ] = "127.0.0.1",
    port: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=65535,
            help="Port to listen on. [default: 8431, or the next one that is free]",
            show_default=False,
        ),
    ] = None,
    no_browser: Annotated[
        bool, typer.Option("--no-browser", help="Open no browser; the address is printed.")
    ] = False,
) -> None:
    """Solve by clicking: a page in the browser."""
    from quito_cli.gui.serve import serve

    def say(address: str) -> None:
        typer.echo(f"The page is at {plain(address)} until Ctrl-C.")

    serve(folder, host, port, browser=not no_browser, say=say)
