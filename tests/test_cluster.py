"""Cases on a Dask cluster of two worker processes: nothing lost, twice, or different."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest
from documents import run as command

import quito_cli as quito
from quito_cli.batch import cluster, connection, remote
from quito_cli.batch.axes import parse
from quito_cli.batch.case import Case, Ending, Expectation, Finished
from quito_cli.batch.cluster import run_on
from quito_cli.batch.figures import TIMES
from quito_cli.batch.limits import Limits
from quito_cli.batch.run import Setting, run
from quito_cli.batch.solving import BEGUN
from quito_cli.batch.sweep import expand
from quito_cli.errors import UnavailableError, UsageError
from quito_cli.problem.load import load_text
from quito_cli.solvers.interruption import interruptible

pytest.importorskip("distributed", reason="Dask is not installed: pip install 'quito[dask]'")

TESTS = Path(__file__).parent
LQ = """\
constants: {a: 1}
time: {initial: 0, final: 1}
states: {x: {initial: a}}
controls: {u: {}}
dynamics: {x: u}
cost: {lagrange: 0.5*(x^2 + u^2)}
"""
"""V = a² tanh(1)/2."""
TANH = 0.7615941559557649
PATIENCE = 120.0
"""Seconds for a process to start."""


# What workers do in the place of a solve; sent by reference, so that they import this file


def waits(case: Case, guess: Path | None, folder: Path, *rest: Any) -> Finished:
    rest[-1](BEGUN)
    end = time.monotonic() + float(case.options["seconds"])
    with interruptible() as interruption:
        while time.monotonic() < end and not interruption.requested:
            time.sleep(0.01)
    path = folder / "result"
    path.write_text(case.name)
    return Finished(case, Ending.PASSED, str(os.getppid()), {}, (), 0.0, path)


def crashes(case: Case, *_: Any) -> Finished:
    if case.options["crash"]:
        os.kill(os.getpid(), signal.SIGSEGV)
    return Finished(case, Ending.PASSED, "", {}, (), 0.0, None)


# A cluster


@dataclass
class Cluster:
    """A scheduler with two workers of one thread each."""

    address: str
    file: Path
    scheduler: subprocess.Popen[bytes]
    workers: list[subprocess.Popen[bytes]]


def dask(*arguments: str) -> subprocess.Popen[bytes]:
    paths = [str(TESTS.parent), str(TESTS), *filter(None, [os.environ.get("PYTHONPATH")])]
    return subprocess.Popen(
        [sys.executable, "-m", "dask", *arguments],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(paths)},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


def worker(file: Path) -> subprocess.Popen[bytes]:
    common = ("--scheduler-file", str(file), "--no-nanny", "--nthreads", "1")
    home = ("--local-directory", str(file.parent), "--no-dashboard")
    return dask("worker", *common, *home, "--host", "127.0.0.1")


@contextmanager
def ended(*processes: subprocess.Popen[bytes]) -> Iterator[None]:
    try:
        yield
    finally:
        for process in processes:
            process.kill()
            process.wait()


@contextmanager
def started(folder: Path) -> Iterator[Cluster]:
    file = folder / "scheduler.json"
    where = ("--host", "127.0.0.1", "--port", "0", "--dashboard-address", "127.0.0.1:0")
    scheduler = dask("scheduler", *where, "--scheduler-file", str(file))
    workers = [worker(file), worker(file)]  # they wait for the file
    with ended(scheduler, *workers):
        end = time.monotonic() + PATIENCE
        while not (file.is_file() and file.read_bytes().endswith(b"}")):
            assert scheduler.poll() is None, "the scheduler did not start"
            assert time.monotonic() < end
            time.sleep(0.05)
        yield Cluster(json.loads(file.read_text())["address"], file, scheduler, workers)


@pytest.fixture(scope="module")
def dask_cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    from distributed import Client

    with started(tmp_path_factory.mktemp("cluster")) as found:
        with Client(found.address, timeout=PATIENCE, set_as_default=False) as client:
            client.wait_for_workers(2, timeout=PATIENCE)
        yield found


def cases_over(over: str, *, warm: bool = False) -> tuple[Case, ...]:
    problem = load_text(LQ, "lq.yaml")
    options = {"steps": 15}
    sweep = expand(
        problem, "lq.yaml", parse([over], problem), options=options, constants={}, warm=warm
    )
    return tuple(replace(case, text=LQ) for case in sweep.cases)


def known(one: Finished) -> dict[str, Any]:
    return {name: value for name, value in one.figures.items() if name not in TIMES}


# What comes back


def test_answers_are_those_of_this_machine(dask_cluster: Cluster, tmp_path: Path) -> None:
    cases = cases_over("a=1:3:5", warm=True)
    cases = (
        replace(cases[0], expectations=(Expectation("cost", target=TANH / 2, absolute=1e-6),)),
        *cases[1:],
    )
    here = {one.case.name: one for one in run(cases, Setting(1, tmp_path / "here", "all"))}
    found = list(run_on(dask_cluster.address, cases, Setting(1, tmp_path / "there", "all")))
    assert [one.case for one in found] == list(cases)  # each waits for the one it follows
    for i, one in enumerate(found):
        assert one.ending is Ending.PASSED
        assert one.figures["cost"] == pytest.approx((1 + i / 2) ** 2 * TANH / 2, rel=1e-6)
        assert known(one) == known(here[one.case.name])
        assert one.checks == here[one.case.name].checks
        assert one.result == tmp_path / "there" / f"{one.case.name}.h5"
        solution = quito.Solution.load(one.result)
        assert solution.cost == one.figures["cost"]
        assert solution.origin.name == "lq"
        assert solution.options["guess"] == (None if i == 0 else f"{cases[i - 1].name}.h5")
    assert len(found[0].checks) == 1
    assert {path.suffix for path in (tmp_path / "there").iterdir()} == {".h5"}  # nothing aside


def test_what_is_refused_crashes_or_hangs_takes_only_its_case(
    dask_cluster: Cluster, tmp_path: Path
) -> None:
    (good,) = cases_over("a=1")
    wrong = replace(good, name="wrong", text=LQ.replace("lagrange", "lagrang"))
    missing = replace(good, name="missing", problem="/nowhere/at_all.yaml", text=None)
    unsolved = replace(good, name="unsolved", options={"max_iterations": 0})
    setting = Setting(1, tmp_path, "failed")
    found = {
        one.case.name: one
        for one in run_on(dask_cluster.address, [wrong, good, missing, unsolved], setting)
    }
    assert {name: one.ending for name, one in found.items()} == {
        "wrong": Ending.REFUSED,
        good.name: Ending.PASSED,
        "missing": Ending.REFUSED,
        "unsolved": Ending.UNSOLVED,
    }
    assert "lq.yaml:7:8" in found["wrong"].message or "lagrang" in found["wrong"].message
    assert "there is no file /nowhere/at_all.yaml" in found["missing"].message
    assert (found[good.name].result, found["unsolved"].result) == (None, tmp_path / "unsolved.h5")
    crashing = [Case(f"c{i}", "p", {"crash": i == 1}, text=LQ) for i in range(4)]
    setting = Setting(1, tmp_path, "none", job=crashes)
    endings = {one.case.name: one for one in run_on(dask_cluster.address, crashing, setting)}
    assert [endings[f"c{i}"].ending for i in range(4)] == [
        *(Ending.PASSED, Ending.CRASHED, Ending.PASSED, Ending.PASSED)
    ]
    assert "SIGSEGV" in endings["c1"].message
    hanging = [Case(f"h{i}", "p", {"seconds": 60.0 * (i == 0)}, text=LQ) for i in range(3)]
    limits = {case.name: Limits(1.0, None) for case in hanging}
    setting = Setting(1, tmp_path, "none", limits, job=waits)
    ended = {one.case.name: one for one in run_on(dask_cluster.address, hanging, setting)}
    assert [ended[f"h{i}"].ending for i in range(3)] == [
        *(Ending.TIMED_OUT, Ending.PASSED, Ending.PASSED)
    ]
    assert "limit of 1 s" in ended["h0"].message


def test_what_others_start_from_is_kept(dask_cluster: Cluster, tmp_path: Path) -> None:
    cases = cases_over("a=1,2", warm=True)
    found = list(run_on(dask_cluster.address, cases, Setting(1, tmp_path, "none")))
    assert [one.result is not None for one in found] == [True, False]


def test_what_is_done_is_not_done_again(dask_cluster: Cluster, tmp_path: Path) -> None:
    cases = cases_over("a=1,2,3", warm=True)
    setting = Setting(1, tmp_path, "all")
    first = next(iter(run(cases, setting)))
    again = list(run_on(str(dask_cluster.file), cases, setting, {first.case.name: first}))
    assert [one.case.name for one in again] == ["a=2", "a=3"]


def test_stopping_ends_what_is_under_way(dask_cluster: Cluster, tmp_path: Path) -> None:
    cases = [Case(f"c{i}", "p", {"seconds": 0.0 if i < 2 else 60.0}, text=LQ) for i in range(6)]
    found: list[Finished] = []
    setting = Setting(1, tmp_path, "all", stop=lambda: len(found) == 2, job=waits)
    began = time.monotonic()
    for one in run_on(dask_cluster.address, cases, setting):
        found.append(one)
    assert sorted(one.case.name for one in found) == ["c0", "c1"]
    more = Case("more", "p", {"seconds": 0.0}, text=LQ)
    (one,) = run_on(dask_cluster.address, [more], Setting(1, tmp_path, "all", job=waits))
    assert one.ending is Ending.PASSED  # the workers are free again
    assert time.monotonic() - began < 50  # of the minute that they would take


def test_sweeps_and_suites_go_there_by_the_command_line(
    dask_cluster: Cluster,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    (tmp_path / "lq.yaml").write_text(LQ)
    (tmp_path / "suite.yaml").write_text("cases: [{problem: lq.yaml, expect: {cost: <= 0.1}}]")
    monkeypatch.chdir(tmp_path)
    there = ["--cluster", dask_cluster.address, "--json"]
    assert command(["sweep", "lq.yaml", "--over", "a=1,2", "--no-plot", *there], monkeypatch) == 0
    said = json.loads(capsys.readouterr().out)
    costs = [case["figures"]["cost"] for case in said["cases"]]
    assert costs == pytest.approx([TANH / 2, 2 * TANH], rel=1e-6)
    assert Path(said["hdf5"]).is_file()
    assert command(["batch", "suite.yaml", *there], monkeypatch) == 3
    (case,) = json.loads(capsys.readouterr().out)["cases"]
    assert case["ending"] == "outside"
    assert command(["batch", "suite.yaml", *there, "-j", "2"], monkeypatch) == 2
    assert "a cluster has its own" in capsys.readouterr().err


# What is refused


def test_another_version_there_is_refused(
    dask_cluster: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connection, "__version__", "99.0")
    (case,) = cases_over("a=1")
    with pytest.raises(UnavailableError, match=r"quito .* is installed at .*, and 99.0 here"):
        list(run_on(dask_cluster.address, [case], Setting(1, tmp_path, "all")))


def test_a_worker_that_comes_late_with_another_version_ends_the_run(
    dask_cluster: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster, "__version__", "99.0")  # of what is sent, after the comparison
    cases = cases_over("a=1,2,3")
    with pytest.raises(UnavailableError, match=r"cannot do cases: a worker has quito .*--resume"):
        list(run_on(dask_cluster.address, cases, Setting(1, tmp_path, "all")))


def test_a_case_that_takes_workers_down_is_told_as_that() -> None:
    from distributed import KilledWorker

    assert cluster._killed(KilledWorker.__new__(KilledWorker))
    assert not cluster._killed(OSError("no space left"))


def test_a_worker_looks_at_the_version(tmp_path: Path) -> None:
    (case,) = cases_over("a=1")
    parcel = remote.Parcel("run", "99.0", case, None, Limits(None, None), "all", (), waits)
    with pytest.raises(UnavailableError, match=r"a worker has quito .*, and the cases come from"):
        remote.solve(parcel)


def test_no_scheduler_is_told_in_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connection, "_CONNECT", 0.5)
    with socket.socket() as silent:
        silent.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{silent.getsockname()[1]}"
        (case,) = cases_over("a=1")
        with pytest.raises(UnavailableError, match=f"no scheduler answers at {address} within"):
            list(run_on(address, [case], Setting(1, tmp_path, "all")))


@pytest.mark.parametrize("address", ["head-node", "http://head-node:8786"])
def test_what_is_no_address_is_refused(address: str, tmp_path: Path) -> None:
    (case,) = cases_over("a=1")
    with pytest.raises(UsageError, match=f"--cluster {address}: .* write tcp://HOST:PORT"):
        list(run_on(address, [case], Setting(1, tmp_path, "all")))


def test_a_file_that_is_no_scheduler_file_is_refused(tmp_path: Path) -> None:
    (case,) = cases_over("a=1")
    for text in ("{}", "no json", "[]"):
        path = tmp_path / "scheduler.json"
        path.write_text(text)
        with pytest.raises(UsageError, match="--cluster"):
            list(run_on(str(path), [case], Setting(1, tmp_path, "all")))


def test_a_scheduler_file_is_waited_for_a_while(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connection, "_CONNECT", 0.3)
    (case,) = cases_over("a=1")
    with pytest.raises(UnavailableError, match=r"no scheduler file .*none\.json: start"):
        list(run_on(str(tmp_path / "none.json"), [case], Setting(1, tmp_path, "all")))


def test_without_dask_it_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    (case,) = cases_over("a=1")
    with pytest.raises(UnavailableError, match=r"pip install 'quito\[dask\]'"):
        list(run_on("tcp://127.0.0.1:8786", [case], Setting(1, tmp_path, "all")))


# What dies, last of all: the cluster is one for all tests


def test_with_a_worker_killed_nothing_is_lost_and_nothing_twice(
    dask_cluster: Cluster, tmp_path: Path
) -> None:
    cases = [Case(f"c{i}", "p", {"seconds": 0.2}, text=LQ) for i in range(12)]
    found: list[Finished] = []
    for one in run_on(dask_cluster.address, cases, Setting(1, tmp_path, "all", job=waits)):
        found.append(one)
        if len(found) == 3:  # the one that did the last is at the next by now
            (victim,) = (w for w in dask_cluster.workers if str(w.pid) == one.message)
            victim.kill()
    assert sorted(one.case.name for one in found) == sorted(case.name for case in cases)
    assert {one.ending for one in found} == {Ending.PASSED}
    for one in found:
        assert one.result is not None
        assert one.result.read_text() == one.case.name
    assert [one.message for one in found[3:]].count(str(victim.pid)) <= 1  # that was on its way


def test_a_scheduler_that_goes_away_is_told(
    dask_cluster: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster, "_GONE", 1.0)
    cases = [Case(f"c{i}", "p", {"seconds": 0.3}, text=LQ) for i in range(20)]
    done = []

    def solve() -> None:
        for one in run_on(dask_cluster.address, cases, Setting(1, tmp_path, "all", job=waits)):
            done.append(one)
            dask_cluster.scheduler.kill()

    with pytest.raises(UnavailableError, match=r"is gone: .* --resume goes on from there"):
        solve()
    assert done
