"""The one tree of errors; each knows the exit code of the command that meets it.

Whatever a user can cause is a `QuitoError`, and its message says what to do. The exit codes are
those of the README: 0 solved, 1 not converged, 2 a wrong command line or problem file or something
that is not available here, 3 a comparison outside its tolerance, 130 interrupted. An answer that
did not converge is no error: it is a `Solution` whose status says so.
"""

from __future__ import annotations

from typing import ClassVar


class QuitoError(Exception):
    """Anything that quito refuses or fails at; `str(error)` is the message for the user."""

    exit_code: ClassVar[int] = 1


class UsageError(QuitoError):
    """A wrong command line, option or call."""

    exit_code = 2


class ResultFileError(UsageError):
    """A result file that is missing, damaged, or of a newer format."""


class UnavailableError(UsageError):
    """Something asked for by its right name that this installation does not have."""


class GateError(QuitoError):
    """An answer outside a limit that was set for it."""

    exit_code = 3
