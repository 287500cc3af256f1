"""What a run has done so far, on disk: a line for each case, written when it has finished.

    {"format": "quito batch", "version": 1, "suite": "nightly", "fingerprint": "9f…"}
    {"case": "van_der_pol[steps=50]", "ending": "PASSED", "figures": {…}, …}

The first line is written aside and renamed, the others are appended whole. A run that is killed
leaves at worst a torn last line, which counts as not written: its case is solved again on resuming.
The fingerprint is of all that determines the cases; a journal of others is not resumed.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final, Self

from quito_cli import __version__
from quito_cli.batch.suite.case import Case, Check, Ending, Expectation, Figure, Finished
from quito_cli.errors import ResultFileError, UsageError
from quito_cli.solution.store import write_aside

_FORMAT: Final = "quito batch"
_VERSION: Final = 1


class Journal:
    """The journal of one run, open for more lines."""

    def __init__(self, path: Path, cases: Sequence[Case], *, resume: bool) -> None:
        """Begin a journal, or go on with the one that is there.

        Args:
            path: of the file; its folder is made where it is missing.
            cases: of the run.
            resume: whether to go on where an earlier run stopped.

        Raises:
            UsageError: there is nothing to resume, or it is a journal of other cases, or another
                run is writing it.
            ResultFileError: it cannot be read or written.
        """
        self.done: dict[str, Finished] = {}
        """What is finished already, by name of the case."""
        self._path = path
        fingerprint = fingerprint_of(cases)
        if resume:
            end = self._read(cases, fingerprint)
        else:
            head = {"format": _FORMAT, "version": _VERSION, "suite": path.name.split(".")[0]}
            line = json.dumps(head | {"fingerprint": fingerprint}) + "\n"
            end = len(line.encode())
            if path.exists():
                _refuse_a_second_run(path)

            def write(aside: Path) -> None:
                aside.write_text(line, encoding="utf-8")

            write_aside(path, write)
        try:
            self._file = path.open("r+b")
        except OSError as error:
            raise ResultFileError(f"{path} cannot be written: {error.strerror}") from None
        try:
            _lock(self._file.fileno(), path)
        except UsageError:
            self._file.close()
            raise
        self._file.truncate(end)
        self._file.seek(end)

    def write(self, finished: Finished) -> None:
        """Append a case that has finished; one that was interrupted has not."""
        if finished.ending is Ending.INTERRUPTED:
            return
        line = json.dumps(as_data(finished), ensure_ascii=False) + "\n"
        try:
            self._file.write(line.encode())
            self._file.flush()
        except OSError as error:
            raise ResultFileError(f"{self._path} cannot be written: {error.strerror}") from None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def _read(self, cases: Sequence[Case], fingerprint: str) -> int:
        """Fill in what is done; return where its whole lines end.

        A case whose result file is gone is not done.
        """
        try:
            content = self._path.read_bytes()
        except FileNotFoundError:
            raise UsageError(
                f"there is nothing to resume: no run has written {self._path}; leave --resume out"
            ) from None
        except OSError as error:
            raise ResultFileError(f"{self._path} cannot be read: {error.strerror}") from None
        by_name = {case.name: case for case in cases}
        lines = list(_whole_lines(content))
        if not lines or _head(lines[0][0]).get("fingerprint") != fingerprint:
            raise UsageError(
                f"{self._path} is of a run of other cases, or by another quito: the suite, its "
                "problems or their options have changed since. Leave --resume out to run all anew"
            )
        for line, _ in lines[1:]:
            try:
                finished = from_data(json.loads(line), by_name, self._path.parent)
            except (ValueError, KeyError, TypeError, AttributeError):
                raise ResultFileError(
                    f"{self._path} is damaged: leave --resume out to run all anew"
                ) from None
            if finished.result is None or finished.result.is_file():
                self.done[finished.case.name] = finished
        return lines[-1][1]


def fingerprint_of(cases: Sequence[Case]) -> str:
    """Return a hash of all that determines what becomes of cases: other texts, another hash."""
    texts: dict[str, str] = {}
    for case in cases:
        if case.problem not in texts:
            texts[case.problem] = case.text if case.text is not None else _text_at(case.problem)
    said = [__version__, texts, [asdict(case) for case in cases]]
    return hashlib.sha256(json.dumps(said, sort_keys=True, default=str).encode()).hexdigest()


def _text_at(problem: str) -> str:
    from quito_cli.problem.load import find

    try:
        return find(problem).read_text(encoding="utf-8", errors="replace")
    except (UsageError, OSError) as error:
        return str(error)


def as_data(finished: Finished) -> dict[str, Any]:
    """Return a finished case as a line of JSON has it; the case itself by its name."""
    return {
        "case": finished.case.name,
        "ending": finished.ending.name,
        "message": finished.message,
        "figures": dict(finished.figures),
        "checks": [asdict(check) for check in finished.checks],
        "seconds": finished.seconds,
        "result": None if finished.result is None else finished.result.name,
    }


def from_data(data: Mapping[str, Any], cases: Mapping[str, Case], folder: Path) -> Finished:
    """Return the finished case that a line of JSON tells of.

    Args:
        data: as `as_data` has it.
        cases: by name.
        folder: where its result file is.
    """
    checks = tuple(
        Check(
            Expectation(**one["expectation"] | {"target": _figure(one["expectation"]["target"])}),
            _figure(one["found"]),
            one["passed"],
            one["sentence"],
        )
        for one in data["checks"]
    )
    return Finished(
        cases[data["case"]],
        Ending[data["ending"]],
        data["message"],
        _tuples(data["figures"]),
        checks,
        data["seconds"],
        None if data["result"] is None else folder / data["result"],
    )


def _tuples(figures: Mapping[str, Any]) -> dict[str, Figure]:
    return {name: _figure(value) for name, value in figures.items()}


def _figure(value: Any) -> Figure:
    return tuple(value) if isinstance(value, list) else value


def _whole_lines(content: bytes) -> Iterator[tuple[bytes, int]]:
    """Yield each line that was written to its end, and where that is."""
    start = 0
    while (end := content.find(b"\n", start)) >= 0:
        yield content[start:end], end + 1
        start = end + 1


def _head(line: bytes) -> dict[str, Any]:
    try:
        head = json.loads(line)
    except ValueError:
        return {}
    known = isinstance(head, dict) and head.get("format") == _FORMAT
    return head if known and head.get("version") == _VERSION else {}


def _refuse_a_second_run(path: Path) -> None:
    """Refuse to replace a journal that another run is writing."""
    with path.open("rb") as file:
        _lock(file.fileno(), path)


def _lock(file: int, path: Path) -> None:
    """Keep other runs from the journal for as long as the file is open.

    Raises:
        UsageError: another run is writing it.
    """
    if os.name != "posix":
        return
    import fcntl

    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        raise UsageError(
            f"another run is writing {path}: wait for its end, or name another folder with -o"
        ) from None
