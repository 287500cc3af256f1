"""`quito new`: a problem file to start from, a commented template or a copy of a known problem."""

from __future__ import annotations

import os
import shlex
from pathlib import Path
from typing import Annotated

import typer

from quito_cli.errors import UsageError

_ENDINGS = (".yaml", ".yml")
_NOT_IN_A_NAME = '<>:"|?*\\'
_LONGEST = 200  # bytes; file systems take 255, and results are named after it
_SHOWN = 60  # characters of a wrong name


def new(
    name: Annotated[
        str,
        typer.Argument(metavar="NAME", help="Its name, or where to write it; .yaml is added."),
    ],
    origin: Annotated[
        str | None,
        typer.Option(
            "--from", metavar="PROBLEM", help="Start from a bundled problem, or from a file."
        ),
    ] = None,
    force: Annotated[
        bool, typer.Option("--force", help="Replace a file that is there already.")
    ] = False,
) -> None:
    """Write a commented problem file to start from."""
    from quito_cli.cli.text import plain
    from quito_cli.problem.library import TEMPLATE, bundled
    from quito_cli.solution.store import write_content

    path = _path_of(name)
    source, what = TEMPLATE, "a template that solves as it stands"
    if origin is not None:
        from quito_cli.problem.load import find, load

        what = f"a copy of {load(origin).name}"
        source = find(origin)
    text = _pointed_to_schema(source.read_bytes().decode("utf-8-sig"), path.parent)
    if os.path.lexists(path) and not force:
        raise UsageError(f"{path} is there already; choose another name, or --force to replace it")
    write_content(path, text)
    shown = f"./{path}" if str(path).startswith("-") else str(path)
    typer.echo(f"Wrote {path}, {plain(what)}. Next:\n")
    for command in ("check", "solve"):
        typer.echo(f"  quito {command} {shlex.quote(shown)}")
    if path.stem in bundled():
        typer.echo(f"\nWithout its .yaml, {path.stem} is the bundled problem of that name.")


def _path_of(name: str) -> Path:
    """Return where to write.

    Raises:
        UsageError: that is no name for a file, or no place for one.
    """
    folder, last = os.path.split(name)
    if not last.strip():
        wanted = os.path.join(folder, "rocket")
        raise UsageError(f"name the file to write, such as: quito new {shlex.quote(wanted)}")
    stem, ending = os.path.splitext(last)
    if ending.lower() not in _ENDINGS:
        stem, ending = last, ".yaml"
    path = Path(folder, stem + ending)
    if objection := _objection(name, stem):
        raise UsageError(f"{last[:_SHOWN]!r} is no name for a problem: {objection}")
    for above in path.parents:
        if os.path.lexists(above) and not above.is_dir():
            raise UsageError(f"{path} cannot be written: {above} is not a folder")
    return path


def _objection(name: str, stem: str) -> str:
    """Say why a file should not be called so, on any system; nothing where it may."""
    if not name.isprintable():
        return "there are characters in it that cannot be printed"
    if not (stem[0].isalnum() or stem[0] == "_"):
        return "a name starts with a letter, a digit or _"
    for character in _NOT_IN_A_NAME:
        if character in stem:
            return f"a name has no {character} in it"
    if stem[-1] in " .":
        return "a name does not end with a blank or a dot"
    if len(os.fsencode(stem)) > _LONGEST:
        return "it is too long"
    return ""


def _pointed_to_schema(text: str, folder: Path) -> str:
    """Return the text with a first line by which editors find the schema from `folder`.

    Relative where both are in the same checkout; else a URI, which has no blanks in it: for the
    language server a blank is the end.
    """
    from quito_cli.problem.library import SCHEMA_LINE, data_folder

    schema = data_folder("schemas") / "problem.schema.json"
    folder = folder.resolve()
    if folder.is_relative_to(schema.parent.parent):
        where = Path(os.path.relpath(schema, folder)).as_posix()
    else:
        where = schema.as_uri()
    line = f"# yaml-language-server: $schema={where}"
    pointed, found = SCHEMA_LINE.subn(lambda _: line, text, count=1)
    ends = "\r\n" if "\r\n" in text else "\n"
    return pointed if found else line + ends + text
