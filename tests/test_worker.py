"""A worker: jobs one after another, and nobody else's harm when one of them goes wrong."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable, Iterator
from multiprocessing.connection import wait
from pathlib import Path
from typing import Any

import pytest

import quito_cli as quito
from quito_cli.batch.memory import in_words, resident
from quito_cli.batch.worker import Answer, Died, Raised, Returned, Told, Worker
from quito_cli.errors import QuitoError, UsageError
from quito_cli.problem.text.complaints import ProblemError
from quito_cli.solvers.outcome import Progress, Status

ROOT = Path(__file__).parent.parent
LONG = 60.0
"""Seconds that nobody waits for."""

Tell = Callable[[Any], None]


def double(number: int, tell: Tell) -> int:
    return 2 * number


def count(number: int, tell: Tell) -> int:
    for i in range(number):
        tell(i)
    return os.getpid()


def refuse(tell: Tell) -> None:
    raise UsageError("no such thing: take another")


def wrong_problem(tell: Tell) -> None:
    _text("states: {x: {}}")


def _text(text: str) -> Any:
    from quito_cli.problem.load import load_text

    return load_text(text, "wrong.yaml")


def stumble(tell: Tell) -> float:
    return 1 / 0


def opaque(tell: Tell) -> Any:
    return lambda: 0


def leave(code: int, tell: Tell) -> None:
    print("the last words", flush=True)
    os._exit(code)


def abort(tell: Tell) -> None:
    os.kill(os.getpid(), signal.SIGSEGV)
    time.sleep(LONG)


def chatter(tell: Tell) -> None:
    for _ in range(2000):
        print("x" * 1000)
    sys.stdout.flush()
    os._exit(3)


def sleep(tell: Tell) -> None:
    tell("asleep")
    time.sleep(LONG)


def with_child(tell: Tell) -> None:
    """Start a process as the solvers do, tell its number, and hang."""
    from quito_cli.solvers import child

    tell(child._started().pid)
    time.sleep(LONG)


def crash_with_child(tell: Tell) -> None:
    from quito_cli.solvers import child

    tell(child._started().pid)
    os._exit(1)


def hoard(size: int, tell: Tell) -> None:
    held = []
    while True:
        held.append(bytearray(os.urandom(1)) * size)
        time.sleep(0.01)


def hoard_in_child(size: int, tell: Tell) -> None:
    hold = f"import time; held = bytearray(b'1') * {size}; time.sleep({LONG})"
    subprocess.run([sys.executable, "-c", hold], check=True)


def hoard_in_silence(size: int, tell: Tell) -> None:
    """With nowhere to print."""
    os.close(1)
    os.close(2)
    hoard(size, tell)


def no_memory(tell: Tell) -> None:
    raise MemoryError


def keep(size: int, tell: Tell) -> int:
    KEPT.append(bytearray(b"1") * size)
    return os.getpid()


KEPT: list[bytearray] = []


def threads(tell: Tell) -> dict[str, str]:
    return {name: value for name, value in os.environ.items() if name.endswith("_NUM_THREADS")}


def group(tell: Tell) -> tuple[int, int]:
    return os.getpid(), os.getpgid(0)


def solve(problem: str, mesh: str, tell: Tell) -> tuple[str, float]:
    solution = quito.solve(problem, mesh=mesh, listener=tell)
    return solution.status.name, solution.cost


@pytest.fixture
def worker() -> Iterator[Worker]:
    with_limits = Worker(memory=None)
    yield with_limits
    with_limits.close()


def told(worker: Worker, *job: Any) -> list[Answer]:
    """Do a job; return every message of it."""
    worker.start(*job)
    answers = [worker.receive()]
    while isinstance(answers[-1], Told):
        answers.append(worker.receive())
    return answers


def gone(process: int) -> bool:
    """Whether a process ends within some seconds."""
    for _ in range(600):
        status = Path(f"/proc/{process}/stat")
        try:
            if status.read_text().rpartition(")")[2].split()[0] == "Z":
                return True
        except OSError:
            return True
        time.sleep(0.05)
    return False


def test_jobs_come_one_after_another_to_the_same_process(worker: Worker) -> None:
    first, second = told(worker, count, 3), told(worker, count, 0)
    assert first[:3] == [Told(0), Told(1), Told(2)]
    assert first[3] == second[0]
    assert told(worker, double, 21) == [Returned(42)]
    assert not worker.busy


def test_workers_are_waited_for_together() -> None:
    workers = [Worker(None), Worker(None)]
    try:
        for number, each in enumerate(workers):
            each.start(double, number)
        values: dict[int, Answer] = {}
        while len(values) < 2:
            for each in workers:
                if each.busy and wait([each.connection], 0.05):
                    values[workers.index(each)] = each.receive()
        assert values == {0: Returned(0), 1: Returned(2)}
    finally:
        for each in workers:
            each.close()


def test_exceptions_come_back(worker: Worker) -> None:
    (refused,) = told(worker, refuse)
    assert isinstance(refused, Raised)
    assert isinstance(refused.error, UsageError)
    assert str(refused.error) == "no such thing: take another"
    (wrong,) = told(worker, wrong_problem)
    assert isinstance(wrong, Raised)
    assert isinstance(wrong.error, QuitoError)
    with pytest.raises(ProblemError) as expected:
        _text("states: {x: {}}")
    assert str(wrong.error) == str(expected.value)
    assert wrong.error.exit_code == 2
    (unexpected,) = told(worker, stumble)
    assert isinstance(unexpected, Raised)
    assert str(unexpected.error).startswith("ZeroDivisionError: division by zero (test_worker.py:")
    (unsendable,) = told(worker, opaque)
    assert isinstance(unsendable, Raised)
    assert "pickle" in str(unsendable.error)
    assert told(worker, double, 1) == [Returned(2)]


def test_a_death_is_told_and_the_next_job_gets_a_new_process(worker: Worker) -> None:
    (died,) = told(worker, leave, 7)
    assert died == Died(7, "its process ended with code 7", False, "the last words")
    (signalled,) = told(worker, abort)
    assert isinstance(signalled, Died)
    assert (signalled.code, signalled.sentence) == (
        -signal.SIGSEGV,
        "its process ended by SIGSEGV",
    )
    assert told(worker, double, 2) == [Returned(4)]


def test_what_is_printed_is_bounded(worker: Worker) -> None:
    (died,) = told(worker, chatter)
    assert isinstance(died, Died)
    assert died.code == 3
    assert 0 < len(died.printed) <= 2000


def test_a_hanging_job_is_killed(worker: Worker) -> None:
    worker.start(sleep)
    assert worker.receive() == Told("asleep")
    began = time.perf_counter()
    worker.kill()
    assert time.perf_counter() - began < LONG / 2
    assert not worker.busy
    assert told(worker, double, 3) == [Returned(6)]


@pytest.mark.parametrize("end", ["kill", "close", "crash"])
def test_children_end_with_the_worker(worker: Worker, end: str) -> None:
    worker.start(crash_with_child if end == "crash" else with_child)
    answer = worker.receive()
    assert isinstance(answer, Told)
    if end == "crash":
        assert isinstance(worker.receive(), Died)
    else:
        getattr(worker, end)()
    assert gone(answer.message)


@pytest.mark.parametrize("hoarding", [hoard, hoard_in_silence, hoard_in_child])
def test_a_limit_of_memory_is_named(hoarding: Callable[..., None]) -> None:
    worker = Worker(memory=200_000_000)
    try:
        (died,) = told(worker, hoarding, 400_000_000 if hoarding is hoard_in_child else 20_000_000)
        assert isinstance(died, Died)
        assert died.out_of_memory
        assert died.sentence.startswith("it held ")
        assert died.sentence.endswith("the limit is 200 MB")
        assert told(worker, double, 4) == [Returned(8)]
    finally:
        worker.close()


def test_no_memory_is_named(worker: Worker) -> None:
    (died,) = told(worker, no_memory)
    assert isinstance(died, Died)
    assert died.out_of_memory


def test_a_worker_that_has_grown_is_replaced(worker: Worker) -> None:
    (first,), (same,) = told(worker, keep, 1), told(worker, keep, 600_000_000)
    assert first == same
    (other,) = told(worker, keep, 1)
    assert isinstance(other, Returned)
    assert other != first
    assert worker.rss() < 400_000_000


def test_there_is_one_thread_and_a_group_of_its_own(worker: Worker) -> None:
    (named,) = told(worker, threads)
    assert isinstance(named, Returned)
    assert set(named.value.values()) == {"1"}
    assert {"OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"} <= set(named.value)
    (answer,) = told(worker, group)
    assert isinstance(answer, Returned)
    assert answer.value[0] == answer.value[1] != os.getpgid(0)


@pytest.mark.parametrize("mesh", ["uniform", "adaptive"])
def test_an_interrupted_solve_returns_what_it_has(worker: Worker, mesh: str) -> None:
    worker.start(solve, "rayleigh", mesh)
    answer = worker.receive()
    assert isinstance(answer, Told)
    assert isinstance(answer.message, Progress)
    worker.interrupt()
    while isinstance(answer, Told):
        answer = worker.receive()
    assert isinstance(answer, Returned)
    assert answer.value[0] == Status.INTERRUPTED.name


def test_an_interruption_between_jobs_is_nobodys(worker: Worker) -> None:
    (process,) = told(worker, count, 0)
    assert isinstance(process, Returned)
    worker.interrupt()
    os.kill(process.value, signal.SIGINT)
    assert told(worker, count, 0) == [process]


@pytest.mark.parametrize("busy", [False, True])
def test_workers_end_with_a_parent_that_is_killed(busy: bool) -> None:
    script = textwrap.dedent(
        f"""
        import sys, time
        sys.path.insert(0, {str(ROOT / "tests")!r})
        from quito_cli.batch.worker import Worker
        import test_worker
        worker = Worker(None)
        worker.start(test_worker.count, 0)
        print(worker.receive().value, flush=True)
        if {busy}:
            worker.start(test_worker.with_child)
            print(worker.receive().message, flush=True)
        time.sleep({LONG})
        """
    )
    parent = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    with parent.stdout:
        left = [int(parent.stdout.readline()) for _ in range(1 + busy)]
        parent.kill()
        parent.wait()
    assert all(map(gone, left))


def test_memory_is_that_of_all_descendants() -> None:
    hold = "import time; held = bytearray(b'1') * 100_000_000; print(1, flush=True); "
    hold += f"time.sleep({LONG})"
    with subprocess.Popen([sys.executable, "-c", hold], stdout=subprocess.PIPE) as child:
        assert child.stdout is not None
        child.stdout.readline()
        assert resident(os.getpid()) - resident(child.pid) > 0
        assert 100_000_000 < resident(child.pid) < 200_000_000
        child.kill()
        child.wait()
        assert resident(child.pid) == 0


@pytest.mark.parametrize(
    ("size", "words"), [(1_500_000_000, "1.5 GB"), (200_000_000, "200 MB"), (12, "12 bytes")]
)
def test_sizes_in_words(size: int, words: str) -> None:
    assert in_words(size) == words
