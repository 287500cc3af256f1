"""The journal of a run: what is on disk survives anything, and a run goes on where it stopped."""

from __future__ import annotations

import json
import math
import os
import random
import signal
import subprocess
import sys
import textwrap
import time
from dataclasses import replace
from pathlib import Path

import pytest

import quito_cli as quito
from quito_cli.batch.suite.case import Case, Check, Ending, Expectation, Finished
from quito_cli.batch.workers.journal import Journal, as_data, fingerprint_of, from_data
from quito_cli.errors import ResultFileError, UsageError

ROOT = Path(__file__).parent.parent
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
CASES = (Case("a", "bang_bang"), Case("b[k=1]", "bang_bang", axes={"k": 1}), Case("c", "bressan"))
LIMIT = Expectation("switching_error", most=2.0)
TIMES = Expectation("switching_times", (1.0, 2.5), absolute=0.1)


def finished(case: Case, folder: Path, *, result: bool = False) -> Finished:
    path = folder / f"{case.name}.h5"
    if result:
        path.write_bytes(b"whole")
    return Finished(
        case,
        Ending.OUTSIDE,
        "Solved — ü",
        {"cost": 0.1 + 0.2, "switching_times": (1.0, 2.0), "status": "solved", "error_l2": None},
        (
            Check(TIMES, (1.0, 2.0), False, "no"),
            Check(Expectation("x", most=math.inf), 1, True, ""),
        ),
        0.25,
        path if result else None,
    )


def test_a_line_has_all_of_a_finished_case(tmp_path: Path) -> None:
    one = finished(CASES[1], tmp_path, result=True)
    line = json.dumps(as_data(one))
    again = from_data(json.loads(line), {case.name: case for case in CASES}, tmp_path)
    assert again == one


def test_a_journal_goes_on_where_it_stopped(tmp_path: Path) -> None:
    path = tmp_path / "results" / "x.batch.jsonl"
    first = finished(CASES[0], tmp_path)
    with Journal(path, CASES, resume=False) as journal:
        assert journal.done == {}
        journal.write(first)
        journal.write(replace(finished(CASES[1], tmp_path), ending=Ending.INTERRUPTED))
    with Journal(path, CASES, resume=True) as journal:
        assert journal.done == {"a": first}, "an interrupted case is not done"
        journal.write(finished(CASES[2], tmp_path))
    with Journal(path, CASES, resume=True) as journal:
        assert list(journal.done) == ["a", "c"]
    with Journal(path, CASES, resume=False) as journal:
        assert journal.done == {}
    assert len(path.read_text(encoding="utf-8").splitlines()) == 1


def test_a_torn_last_line_counts_as_not_written(tmp_path: Path) -> None:
    path = tmp_path / "x.batch.jsonl"
    with Journal(path, CASES, resume=False) as journal:
        journal.write(finished(CASES[0], tmp_path))
        whole = path.stat().st_size
        journal.write(finished(CASES[1], tmp_path))
    content = path.read_bytes()
    for cut in (*range(whole, len(content), 29), len(content) - 1):
        path.write_bytes(content[:cut])
        with Journal(path, CASES, resume=True) as journal:
            assert list(journal.done) == ["a"]
            journal.write(finished(CASES[2], tmp_path))
        with Journal(path, CASES, resume=True) as journal:
            assert list(journal.done) == ["a", "c"]


def test_a_case_whose_result_is_gone_is_not_done(tmp_path: Path) -> None:
    path = tmp_path / "x.batch.jsonl"
    with Journal(path, CASES, resume=False) as journal:
        journal.write(finished(CASES[0], tmp_path, result=True))
        journal.write(finished(CASES[2], tmp_path, result=True))
    (tmp_path / "a.h5").unlink()
    with Journal(path, CASES, resume=True) as journal:
        assert list(journal.done) == ["c"]


@pytest.mark.parametrize(
    "changed",
    [
        CASES[:2],
        (replace(CASES[0], options={"steps": 3}), *CASES[1:]),
        (replace(CASES[0], constants={"k": 3}), *CASES[1:]),
        (replace(CASES[0], expectations=(TIMES,)), *CASES[1:]),
        (replace(CASES[0], problem="rayleigh"), *CASES[1:]),
        (replace(CASES[0], text="title: x"), *CASES[1:]),
        tuple(reversed(CASES)),
    ],
)
def test_other_cases_are_not_resumed(changed: tuple[Case, ...], tmp_path: Path) -> None:
    path = tmp_path / "x.batch.jsonl"
    with Journal(path, CASES, resume=False) as journal:
        journal.write(finished(CASES[0], tmp_path))
    before = path.read_bytes()
    with pytest.raises(UsageError, match=r"is of a run of other cases.*--resume out"):
        Journal(path, changed, resume=True)
    assert path.read_bytes() == before


def test_a_problem_that_has_changed_is_another(tmp_path: Path) -> None:
    problem = tmp_path / "a.yaml"
    problem.write_text("title: one", encoding="utf-8")
    case = Case("a", str(problem))
    before = fingerprint_of([case])
    assert fingerprint_of([case]) == before
    problem.write_text("title: two", encoding="utf-8")
    assert fingerprint_of([case]) != before


def test_what_is_no_journal(tmp_path: Path) -> None:
    path = tmp_path / "x.batch.jsonl"
    with pytest.raises(UsageError, match=r"nothing to resume: no run has written"):
        Journal(path, CASES, resume=True)
    for content in (b"", b"{}\n", b"no json\n", b"[1]\n", b'{"format": "quito batch"}\n'):
        path.write_bytes(content)
        with pytest.raises(UsageError, match=r"other cases"):
            Journal(path, CASES, resume=True)
    with Journal(path, CASES, resume=False) as journal:
        journal.write(finished(CASES[0], tmp_path))
    content = path.read_bytes()
    for line in (b'{"case": "nobody"}\n', b"no json\n", b"[]\n"):
        path.write_bytes(content + line)
        with pytest.raises(ResultFileError, match=r"is damaged"):
            Journal(path, CASES, resume=True)


def test_two_runs_do_not_share_a_journal(tmp_path: Path) -> None:
    path = tmp_path / "x.batch.jsonl"
    with Journal(path, CASES, resume=False) as journal:
        journal.write(finished(CASES[0], tmp_path))
        for resume in (True, False):
            with pytest.raises(UsageError, match=r"another run is writing"):
                Journal(path, CASES, resume=resume)
        journal.write(finished(CASES[1], tmp_path))
    with Journal(path, CASES, resume=True) as journal:
        assert list(journal.done) == ["a", "b[k=1]"]


# Killed at any moment


SCRIPT = textwrap.dedent(
    f"""
    import sys
    from pathlib import Path
    sys.path.insert(0, {str(ROOT / "tests")!r})
    import hostile
    from quito_cli.batch.suite.case import Case
    from quito_cli.batch.workers.recorded import recorded
    from quito_cli.batch.workers.run import Setting
    from quito_cli.batch.suite.suite import Suite
    folder = Path(sys.argv[1])
    cases = tuple(Case(f"{{i}}", sys.argv[2]) for i in range(60))
    how = Setting(2, folder, "all", job=hostile.copy)
    for one in recorded(Suite("killed", "", cases, {{}}), how, resume=sys.argv[3] == "resume"):
        print(one.case.name, flush=True)
    """
)


def test_killed_ten_times_at_random_moments(tmp_path: Path) -> None:
    """Files are whole whenever the parent is killed, and what is left is finished by resuming."""
    source, folder = tmp_path / "answer.h5", tmp_path / "results"
    quito.solve("bang_bang", steps=5).save(source)
    size, journal = source.stat().st_size, folder / "killed.batch.jsonl"
    moments = [random.uniform(0.0, 1.2) for _ in range(10)]
    print("killed after", moments, "seconds")
    done: list[str] = []
    whole: dict[Path, int] = {}
    for moment in moments:
        start_killed(folder, source, journal.exists(), moment)
        for path in (p for p in folder.glob("*.h5") if not p.name.startswith(".")):
            if whole.get(path) == path.stat().st_mtime_ns:  # not written since it was looked at
                continue
            assert quito.Solution.load(path).success
            assert path.stat().st_size == size
            whole[path] = path.stat().st_mtime_ns
        if journal.exists():
            lines = journal.read_bytes().split(b"\n")[1:-1]
            now = [json.loads(line)["case"] for line in lines]
            assert now[: len(done)] == done, "nothing that was written is lost"
            done = now
    command = [sys.executable, "-c", SCRIPT, str(folder), str(source)]
    command.append("resume" if journal.exists() else "anew")
    subprocess.run(command, check=True, env=ENVIRONMENT, capture_output=True)
    names = [json.loads(line)["case"] for line in journal.read_bytes().splitlines()[1:]]
    assert names[: len(done)] == done
    assert sorted(names, key=int) == [str(i) for i in range(60)], "each once"
    left = {path.name for path in folder.iterdir()}
    assert left == {f"{i}.h5" for i in range(60)} | {journal.name}, "and nothing half written"


def start_killed(folder: Path, source: Path, resume: bool, moment: float) -> None:
    """Start a run and kill it; it is given the time to begin first."""
    command = [sys.executable, "-c", SCRIPT, str(folder), str(source)]
    command.append("resume" if resume else "anew")
    with subprocess.Popen(command, stdout=subprocess.PIPE, env=ENVIRONMENT) as child:
        assert child.stdout is not None
        child.stdout.readline()
        time.sleep(moment)
        child.send_signal(signal.SIGKILL)


def test_a_killed_command_is_resumed(tmp_path: Path) -> None:
    text = "cases: [{problem: bang_bang, options: {steps: 5}, matrix: {variance: [1, 2, 3, 4, 5]}}]"
    (tmp_path / "suite.yaml").write_text(text, encoding="utf-8")
    command = [sys.executable, "-m", "quito_cli", "batch", "suite.yaml", "-j", "1"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, text=True, env=ENVIRONMENT, cwd=tmp_path
    ) as child:
        assert child.stdout is not None
        assert child.stdout.readline().startswith("passed")
        child.kill()
    again = subprocess.run(
        [*command, "--resume", "--json"],
        capture_output=True,
        text=True,
        check=True,
        env=ENVIRONMENT,
        cwd=tmp_path,
    )
    said = json.loads(again.stdout)
    assert said["counts"] == {"passed": 5}
    assert [case["set"] | case["options"] for case in said["cases"]] == [
        {"steps": 5, "variance": v} for v in (1, 2, 3, 4, 5)
    ]
