"""The `quito` command: its commands by name, and what becomes of errors.

Nothing heavy is imported here or at the top of a command's file: `quito --help` is quick.
"""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Callable, Iterable, Mapping
from typing import Annotated, Final

import typer

from quito_cli import __version__
from quito_cli.cli.batch import batch
from quito_cli.cli.check import check
from quito_cli.cli.compare import compare
from quito_cli.cli.generating_functions import generating_functions
from quito_cli.cli.gui import gui
from quito_cli.cli.list import list_problems
from quito_cli.cli.new import new
from quito_cli.cli.plot import plot
from quito_cli.cli.schema import schema
from quito_cli.cli.show import show
from quito_cli.cli.solve import solve
from quito_cli.cli.solvers import solvers
from quito_cli.cli.sweep import sweep
from quito_cli.errors import QuitoError

COMMANDS: Final[Mapping[str, Callable[..., None]]] = {
    "solve": solve,
    "compare": compare,
    "batch": batch,
    "sweep": sweep,
    "check": check,
    "list": list_problems,
    "show": show,
    "new": new,
    "plot": plot,
    "generating-functions": generating_functions,
    "gui": gui,
    "schema": schema,
    "solvers": solvers,
}


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"quito {__version__}")
        raise typer.Exit


def _quito(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_version, is_eager=True, help="Print the version."),
    ] = False,
) -> None:
    """Solve constrained optimal control problems written in YAML.

    Try: quito solve alychan -N 100 --variance 2
    """


def _with(commands: Iterable[str]) -> typer.Typer:
    """Return the command line with some of its commands."""
    made = typer.Typer(
        name="quito",
        no_args_is_help=True,
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
        epilog="Exit codes: 0 solved, 1 not converged, 2 wrong command line or file, 3 outside a "
        "limit that was set, 130 interrupted.",
    )
    made.callback()(_quito)
    for name in commands:
        made.command(name)(COMMANDS[name])
    return made


app = _with(COMMANDS)


def main() -> None:
    """Run the command line; errors become messages and exit codes, never tracebacks."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # a narrow locale must not turn output into a crash
            stream.reconfigure(errors="replace")
    gc.disable()  # one command makes no garbage worth the search: a third of a short solve
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")  # which takes a search for them
    # Typer makes all of the commands that it has, which takes longer than a problem file does.
    called = [name for name in sys.argv[1:2] if name in COMMANDS]
    try:
        (_with(called) if called else app)()
    except QuitoError as error:
        print(f"quito: {error}" if "\n" not in str(error) else str(error), file=sys.stderr)
        sys.exit(error.exit_code)
    except BrokenPipeError:  # the reader has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)
    except OSError as error:
        print(f"quito: {error.strerror or error}", file=sys.stderr)
        sys.exit(2)
    except MemoryError:
        print("quito: out of memory; try fewer --steps", file=sys.stderr)
        sys.exit(1)
    except Exception as error:
        if os.environ.get("QUITO_DEBUG"):
            raise
        message = f"{type(error).__name__}: {error}".splitlines()[0]
        print(
            f"quito: a bug in quito: {message}\n"
            "Please report it with the problem file; QUITO_DEBUG=1 shows where it happened.",
            file=sys.stderr,
        )
        sys.exit(1)
    finally:
        gc.freeze()  # nor at the exit
        gc.enable()
