"""The form: options of a solve with their help, choices and ranges; and the command line for them.

All of it is read off the schema of options, so that an option that is added there is here too.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Choice:
    """One of several words."""

    value: str
    help: str
    """What it is; empty where nothing is to be said."""
    available: bool
    """Whether it is there on this machine; else `help` says why not."""


@dataclass(frozen=True)
class Setting:
    """A field of the form."""

    name: str
    """Of the option: `generating_function`."""
    label: str
    """`generating function`."""
    help: str
    kind: str
    """integer, number, choice or switch."""
    choices: tuple[Choice, ...]
    """Of a choice."""
    least: float | None
    """Smallest value allowed; `least_excluded` says that it is just not."""
    most: float | None
    least_excluded: bool
    default: Any
    """The file's own value, else that of Options; None where it is found from the problem."""
    from_file: bool
    """Whether the default is the file's."""
    advanced: bool
    """Whether it may be hidden until it is asked for."""


def settings(file_options: Mapping[str, Any]) -> tuple[Setting, ...]:
    """Return the fields of the form for a file, the usual ones first.

    Args:
        file_options: what the file asks for, as `Checked.options` has it.
    """
    raise NotImplementedError


def idle(chosen: Mapping[str, Any], file_options: Mapping[str, Any]) -> frozenset[str]:
    """Return the names of the options that mean nothing beside those chosen: to be disabled."""
    raise NotImplementedError


def given(chosen: Mapping[str, Any], file_options: Mapping[str, Any]) -> dict[str, Any]:
    """Return what is to be asked for: what differs from file and defaults, and is not idle.

    It is what `Request.options` takes.

    Raises:
        UsageError: a value is out of its range, or options exclude each other.
    """
    raise NotImplementedError


def command(problem: str, given: Mapping[str, Any]) -> str:
    """Return the `quito solve` command line that does the same, quoted for a shell."""
    raise NotImplementedError
