"""The desk: solves in processes of their own, their queue, their limits, and their end."""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from quito_cli.batch.memory import QUICK, resident
from quito_cli.errors import UsageError
from quito_cli.gui import job as jobs
from quito_cli.gui.answer import Answer
from quito_cli.gui.desk import LIMITS, Desk, Failed, Finished, Limits, Request, Running, State
from quito_cli.gui.folders import new_folder
from quito_cli.gui.job import MOST_POINTS, Job, Waiting
from quito_cli.gui.work import Iterated, Noticed, Work
from quito_cli.solution.solution import Solution

LONG = 120.0
"""Seconds that nothing takes, even on a machine that has much else to do."""
REST_TO_REST = """\
title: From rest to rest
time: {initial: 0, final: 1}
states: {x: {initial: 0, final: 1}, v: {initial: 0, final: 0}}
controls: {u: {}}
dynamics: {x: v, v: u}
cost: {lagrange: u^2}
reference: {cost: 12, accuracy: 1.0e-9, verified: by hand}
"""
"""u = 6 − 12 t, and its cost is ∫u² = 12."""
SLOW = """\
time: {initial: 0, final: 20}
states: {x: {initial: 0}, v: {initial: 1}}
controls: {u: {lower: -1, upper: 1}}
dynamics: {x: v, v: (1 - x^2)*v - x + u}
cost: {lagrange: x^2 + v^2}
"""
ENDLESS = {"steps": 200, "tolerance": 1e-300, "max_iterations": 10_000}
"""A minute of quick iterations: no residual is ever so small."""

Tell = Callable[[Any], None]


def limits(**changed: float) -> Limits:
    return Limits(**{**vars(LIMITS), **changed})


@pytest.fixture(scope="module")
def desk() -> Iterator[Desk]:
    """A desk that gives a worker all the time it needs to notice that it is to stop."""
    made = Desk(limits(grace=LONG, judging=LONG), workers=1)
    yield made
    made.close()


@pytest.fixture
def session(desk: Desk, request: pytest.FixtureRequest) -> Iterator[str]:
    name = str(request.node.name)
    yield name
    desk.leave(name)


def ended(desk: Desk, job: str, within: float = LONG) -> State:
    return wait_for(desk, job, lambda state: isinstance(state, Finished | Failed), within)


def wait_for(desk: Desk, job: str, until: Callable[[State], bool], within: float = LONG) -> State:
    end = time.monotonic() + within
    while not until(state := desk.state(job)):
        assert time.monotonic() < end, state
        time.sleep(0.01)
    return state


def iterating(state: State) -> bool:
    assert not isinstance(state, Finished | Failed), state
    return isinstance(state, Running) and len(state.history) > 1


# An answer


def test_a_solve_leaves_its_answer_in_a_folder(desk: Desk, session: str) -> None:
    job = desk.submit(session, Request(REST_TO_REST, "rest", {"steps": 40}))
    state = ended(desk, job)
    assert isinstance(state, Finished)
    assert state.note == ""
    solution = Solution.load(state.folder / "result.h5")
    assert solution.success
    assert solution.cost == pytest.approx(12, rel=1e-4)
    assert len(solution.times) == 41
    answer = Answer.load(state.folder)
    assert (answer.kind, answer.name, answer.title) == ("solve", "rest", "From rest to rest")
    assert answer.status == "solved"
    assert answer.given == {"steps": 40}
    assert answer.figures["cost"] == solution.cost
    assert dict(answer.rows)["cost"].startswith("12, reference 12, difference ")


def test_iterations_are_told_on_the_way(desk: Desk, session: str) -> None:
    """So often that they are seen before the end, and the loop goes on meanwhile."""

    async def states() -> list[State]:
        job = desk.submit(session, Request(SLOW, "slow", ENDLESS))
        seen: list[State] = []
        enough: list[bool] = []
        async for state in desk.follow(job):
            seen.append(state)
            if not enough and len({len(history) for history in histories(seen)}) > 2:
                enough.append(True)
                desk.cancel(job)
        return seen

    def histories(seen: list[State]) -> list[tuple[Iterated, ...]]:
        return [each.history for each in seen if isinstance(each, Running) and each.history]

    seen = asyncio.run(states())
    assert isinstance(seen[-1], Finished)
    told = [each for each in histories(seen) if len(each) < MOST_POINTS // 2]  # not thinned
    for history in told:
        assert [point.count for point in history] == list(range(len(history)))
        assert history[0].iteration == 0
    assert all(a == b[: len(a)] for a, b in pairwise(told))
    last = histories(seen)[-1]
    assert last[-1].violation < last[0].violation


def test_mistakes_are_told_with_their_lines(desk: Desk, session: str) -> None:
    text = REST_TO_REST.replace("v: u}", "v: w}")
    state = ended(desk, desk.submit(session, Request(text, "rest")))
    assert isinstance(state, Failed)
    assert state.reason == "refused"
    assert "rest.yaml:5:" in state.message
    assert "'w'" in state.message


def test_options_are_refused_in_words(desk: Desk, session: str) -> None:
    state = ended(desk, desk.submit(session, Request(REST_TO_REST, "rest", {"degree": 4})))
    assert isinstance(state, Failed)
    assert (state.reason, "belongs to collocation" in state.message) == ("refused", True)


def test_a_comparison_takes_a_saved_answer(desk: Desk, session: str) -> None:
    text = REST_TO_REST.replace("by hand}", "by hand, control: {u: 6 - 12*t}}")
    solved = ended(desk, desk.submit(session, Request(text, "rest", {"steps": 40})))
    assert isinstance(solved, Finished)
    kept = solved.folder / "result.h5"
    state = ended(desk, desk.submit(session, Request(text, "rest", {}, ("lgr",), kept)))
    assert isinstance(state, Finished), state
    answer = Answer.load(state.folder)
    assert answer.kind == "compare"
    rows = {row["method"]: row for row in answer.figures["rows"]}
    assert list(rows) == ["quasi-interpolant:gaussian", "lgr"]
    assert rows["lgr"]["error_sup"] < 1e-6  # polynomials of degree one are exact for it
    kinds = {chart.kind for chart in answer.charts}
    assert kinds >= {"controls", "error", "logarithmic", "spectrum", "states"}


# The queue


def test_the_place_in_the_queue_is_told(desk: Desk) -> None:
    first = desk.submit("a", Request(SLOW, "slow", ENDLESS))
    wait_for(desk, first, lambda state: isinstance(state, Running))
    others = [desk.submit(name, Request(REST_TO_REST, "rest")) for name in "bcd"]
    assert [desk.state(job) for job in others] == [Waiting(1), Waiting(2), Waiting(3)]
    desk.cancel(others[0])
    assert isinstance(desk.state(others[0]), Failed)
    assert [desk.state(job) for job in others[1:]] == [Waiting(1), Waiting(2)]
    desk.drop(others[1])
    assert desk.state(others[2]) == Waiting(1)
    desk.cancel(first)
    assert isinstance(ended(desk, others[2]), Finished)
    for name in "abcd":
        desk.leave(name)


def test_a_session_has_one_solve_at_a_time(desk: Desk, session: str) -> None:
    job = desk.submit(session, Request(SLOW, "slow", ENDLESS))
    with pytest.raises(UsageError, match="cancel it first"):
        desk.submit(session, Request(REST_TO_REST, "rest"))
    desk.cancel(job)
    ended(desk, job)
    second = desk.submit(session, Request(REST_TO_REST, "rest"))
    assert isinstance(ended(desk, second), Finished)


def test_texts_and_queues_have_limits() -> None:
    desk = Desk(limits(characters=100, waiting=1), workers=0)
    try:
        with pytest.raises(UsageError, match="101 characters; at most 100"):
            desk.submit("a", Request("x" * 101, "long"))
        desk.submit("a", Request("x", "short"))
        with pytest.raises(UsageError, match="too many"):
            desk.submit("b", Request("x", "short"))
    finally:
        desk.close()


# Cancel, and limits


def test_cancel_keeps_the_iterate(desk: Desk, session: str) -> None:
    job = desk.submit(session, Request(SLOW, "slow", ENDLESS))
    wait_for(desk, job, iterating)
    desk.cancel(job)
    noticed = wait_for(desk, job, lambda s: not isinstance(s, Running) or s.stopped)
    assert isinstance(noticed, Finished) or (isinstance(noticed, Running) and noticed.stopping)
    state = ended(desk, job)
    assert isinstance(state, Finished)
    assert "best iterate" in state.note
    solution = Solution.load(state.folder / "result.h5")
    assert solution.status.name == "INTERRUPTED"
    assert Answer.load(state.folder).status == "interrupted"


def test_the_time_limit_keeps_the_iterate() -> None:
    desk = Desk(limits(seconds=3.0, grace=LONG, judging=LONG), workers=1)
    try:
        state = ended(desk, desk.submit("a", Request(SLOW, "slow", ENDLESS)))
        assert isinstance(state, Finished), state
        assert "limit of 3 s" in state.note
    finally:
        desk.close()


def hang(work: Work, tell: Tell) -> None:
    """Ignore what is asked, and never end."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    while True:
        time.sleep(1)


def dawdle(work: Work, tell: Tell) -> None:
    """Notice, with an iterate, and never end."""
    tell((Iterated(0, 0, 1.0, 1.0, ""),))
    tell(Noticed())
    while True:
        time.sleep(0.01)


def eat(work: Work, tell: Tell) -> None:
    held = []
    while True:
        held.append(bytearray(10_000_000))
        time.sleep(0.001)


def die(work: Work, tell: Tell) -> None:
    os.kill(os.getpid(), signal.SIGSEGV)


def stumble(work: Work, tell: Tell) -> None:
    raise ZeroDivisionError("secret")


def leave_a_child(work: Work, tell: Tell) -> None:
    """Start a process of its own session-mates, say its number, and never end."""
    child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
    tell((Iterated(0, child.pid, 0.0, 0.0, ""),))
    hang(work, tell)


def with_work(
    monkeypatch: pytest.MonkeyPatch, function: Callable[..., Any], **changed: float
) -> Desk:
    monkeypatch.setattr(jobs, "carry_out", function)
    return Desk(limits(**changed), workers=1)


def test_what_hangs_is_ended_soon_after_cancel(monkeypatch: pytest.MonkeyPatch) -> None:
    desk = with_work(monkeypatch, hang)
    try:
        job = desk.submit("a", Request("", "x"))
        wait_for(desk, job, lambda state: isinstance(state, Running))
        desk.cancel(job)
        state = ended(desk, job)
        assert isinstance(state, Failed)
        assert state.reason == "cancelled"
        monkeypatch.undo()  # and its place is taken by another process
        assert isinstance(ended(desk, desk.submit("a", Request(REST_TO_REST, "x"))), Finished)
    finally:
        desk.close()


def test_what_hangs_is_ended_by_the_time_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    desk = with_work(monkeypatch, hang, seconds=0.5, grace=0.2)
    try:
        state = ended(desk, desk.submit("a", Request("", "x")))
        assert isinstance(state, Failed)
        assert state.reason == "time"
        assert "0.5 s" in state.message
    finally:
        desk.close()


INVERTED = """\
time: {initial: 0, final: 1}
states: {x: {size: 7, initial: 1}}
controls: {u: {size: 7}}
dynamics: {x: "inv(diag(x) + transpose(diag(u) @ ROWS)) @ u"}
cost: {lagrange: "dot(u, u)"}
""".replace("ROWS", "[" + ", ".join(["[" + ", ".join(f"x[{i}]" for i in range(7)) + "]"] * 7) + "]")
"""The inverse is written out by minors: building it takes half a minute, and C++ listens to no
signal."""


def test_a_problem_that_is_never_built_is_cancelled_too() -> None:
    desk = Desk(LIMITS, workers=1)
    try:
        job = desk.submit("a", Request(INVERTED, "inverted"))
        wait_for(desk, job, lambda state: isinstance(state, Running) and state.seconds > 0.5)
        desk.cancel(job)
        state = ended(desk, job, within=20.0)  # building it takes longer
        assert isinstance(state, Failed), state
        assert state.reason == "cancelled"
    finally:
        desk.close()


@pytest.mark.parametrize(("judging", "times"), [(0.5, 1), (2 * LONG, 2)])
def test_a_judgement_has_its_time_and_is_ended_by_a_second_cancel(
    monkeypatch: pytest.MonkeyPatch, judging: float, times: int
) -> None:
    desk = with_work(monkeypatch, dawdle, judging=judging)
    try:
        job = desk.submit("a", Request("", "x"))
        wait_for(desk, job, lambda state: not isinstance(state, Waiting))
        for _ in range(times):
            desk.cancel(job)
        assert isinstance(ended(desk, job), Failed)
    finally:
        desk.close()


@pytest.mark.skipif(not QUICK, reason="memory is looked at too rarely here")
def test_what_eats_memory_is_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    desk = with_work(monkeypatch, eat, memory=500_000_000)
    try:
        state = ended(desk, desk.submit("a", Request("", "x")))
        assert isinstance(state, Failed)
        assert state.reason == "memory"
        assert "limit is 500 MB" in state.message
    finally:
        desk.close()


@pytest.mark.parametrize(("function", "said"), [(die, "process"), (stumble, "bug in quito")])
def test_a_crash_is_told_without_a_traceback(
    monkeypatch: pytest.MonkeyPatch, function: Callable[..., Any], said: str
) -> None:
    desk = with_work(monkeypatch, function)
    try:
        state = ended(desk, desk.submit("a", Request("", "x")))
        assert isinstance(state, Failed)
        assert state.reason == "crashed"
        assert said in state.message
        assert "Traceback" not in state.message
        assert "\n" not in state.message
    finally:
        desk.close()


# The end


def children() -> set[int]:
    """Return the processes that this one has started."""
    found: set[int] = set()
    for task in Path("/proc/self/task").iterdir():
        found |= set(map(int, (task / "children").read_text().split()))
    return found


def clerks_at_work() -> int:
    return sum(thread.name == "quito desk" for thread in threading.enumerate())


@pytest.mark.skipif(not QUICK, reason="there is no /proc to look into")
def test_nothing_is_left_at_the_end(
    desk: Desk, session: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = desk.submit(session, Request(REST_TO_REST, "rest"))
    assert isinstance(ended(desk, other), Finished)  # and replaces nobody any more
    before, clerks = children(), clerks_at_work()
    desk = with_work(monkeypatch, leave_a_child)
    job = desk.submit("a", Request("", "x"))
    state = wait_for(desk, job, lambda s: isinstance(s, Running) and bool(s.history))
    assert isinstance(state, Running)
    grandchild = state.history[0].iteration
    os.kill(grandchild, 0)
    folder = desk.folder
    (folder / "something").write_text("")
    assert children() > before
    desk.close()
    desk.close()
    assert children() == before
    assert not folder.exists()
    assert clerks_at_work() == clerks
    with pytest.raises(ProcessLookupError):
        alive(grandchild)
    with pytest.raises(UsageError, match="closed"):
        desk.submit("a", Request("", "x"))


def alive(process: int) -> None:
    """Look whether a process is there, for a while: the system buries orphans in its own time."""
    end = time.monotonic() + LONG
    while time.monotonic() < end:
        os.kill(process, 0)
        try:
            status = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
        except OSError:
            raise ProcessLookupError from None
        if status == "Z":
            raise ProcessLookupError
        time.sleep(0.02)


def test_folders_of_servers_that_were_killed_are_removed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    gone = subprocess.run(
        [sys.executable, "-c", "import os; print(os.getpid())"],
        capture_output=True,
        text=True,
        check=True,
    ).stdout.strip()
    kept = [f"quito-gui-{os.getpid()}-abc", "quito-gui-1-abc", f"quito-gui-{gone}", "quito-gui-x-y"]
    for name in [f"quito-gui-{gone}-abc", f"quito-gui-{'9' * 30}-abc", *kept]:
        (tmp_path / name / "job1").mkdir(parents=True)
    (tmp_path / f"quito-gui-{gone}-link").symlink_to(tmp_path / kept[0])
    made = new_folder()
    names = {path.name for path in tmp_path.iterdir()}
    assert names >= {*kept, f"quito-gui-{gone}-link", made.name}
    assert f"quito-gui-{gone}-abc" not in names
    assert (tmp_path / kept[0] / "job1").exists()
    assert made.stat().st_mode & 0o077 == 0


def test_what_is_dropped_is_gone(desk: Desk, session: str) -> None:
    job = desk.submit(session, Request(REST_TO_REST, "rest", {"steps": 40}))
    state = ended(desk, job)
    assert isinstance(state, Finished)
    desk.drop(job)
    assert not state.folder.exists()
    for look in (desk.state, desk.cancel):
        with pytest.raises(UsageError, match="run it again"):
            look(job)
    desk.drop(job)
    running = desk.submit(session, Request(SLOW, "slow", ENDLESS))
    wait_for(desk, running, iterating)
    desk.leave(session)
    with pytest.raises(UsageError, match="run it again"):
        desk.state(running)
    another = desk.submit(session, Request(REST_TO_REST, "rest"))
    assert isinstance(ended(desk, another), Finished)
    assert {path.name for path in desk.folder.iterdir()} - {"warm-up"} == {another}


@pytest.mark.skipif(not QUICK, reason="there is no /proc to look into")
def test_twenty_solves_leave_memory_flat() -> None:
    desk = Desk(LIMITS, workers=1)
    try:
        held = []
        for i in range(24):
            job = desk.submit("a", Request(REST_TO_REST, "rest", {"steps": 20}))
            assert isinstance(ended(desk, job), Finished)
            desk.drop(job)
            held.append(resident(os.getpid()))  # with all that it has started
            assert i < 4 or held[-1] < 1.1 * held[3]
    finally:
        desk.close()


def test_a_long_history_is_thinned_and_ends_at_its_end() -> None:
    job = Job("job1", "a", Request("", "x"), Path("nowhere"))
    for i in range(0, 10_000, 7):
        job.heard(tuple(Iterated(i + k, 0, 0.0, 0.0, "") for k in range(7)))
    job.tell()
    assert isinstance(job.state, Running)
    shown = [point.count for point in job.state.history]
    assert len(shown) <= MOST_POINTS
    assert (shown[0], shown[-1]) == (0, 10_002)
    assert shown == sorted(set(shown))
