"""The table of solvers: each row does what it says, and none is believed."""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray
from processor import within

import quito_cli as quito
from quito_cli.problem.load import load_text
from quito_cli.problem.model import Model
from quito_cli.selftest import PROBLEMS
from quito_cli.solvers import (
    SOLVERS,
    Backend,
    Outcome,
    Progress,
    Start,
    Status,
    availability,
    child,
    minimise,
)
from quito_cli.solvers.asking import Request, count_of, settings, status_of
from quito_cli.solvers.availability import available
from quito_cli.solvers.engines import ENGINES
from quito_cli.solvers.program import Program, start_at
from quito_cli.solvers.rows_absent import ROWS as ABSENT
from quito_cli.transcription.cells import Discretization
from quito_cli.transcription.control import ControlBasis
from quito_cli.transcription.generating import GENERATING_FUNCTIONS
from quito_cli.transcription.mesh import Mesh
from quito_cli.transcription.schemes import SCHEMES
from quito_cli.transcription.transcribe import Nlp, transcribe

Array = NDArray[np.float64]
Solve = Callable[..., quito.Solution]
Build = Callable[[str], Model]

PRESENT = [row.name for row in SOLVERS.values() if available(row)]
NONLINEAR = [name for name in PRESENT if SOLVERS[name].takes == "NLP"]
QUADRATIC = [name for name in PRESENT if SOLVERS[name].takes == "QP"]
WARM = [name for name in PRESENT if SOLVERS[name].warm is not None]
KNOWN_FAILURES = {
    ("qrsqp", "bryson_denham"): "stops with complementarity at 5e-7",
    ("fatrop", "bryson_denham"): "regularises every step at the fixed ends",
    ("highs", "bryson_denham"): "gives up where coefficients are weakly determined",
    ("osqp", "bryson_denham"): "needs more than 20 000 iterations",
    ("sleqp", "bressan"): "loses its multipliers",
    ("sleqp", "van_der_pol"): "runs differ, and one in eight does not end",
}
MANY = {"osqp": 20_000, "qpoases": 20_000}
"""Iteration limits of rows that count small steps."""
CURVED_COST = """
time: {initial: 0, final: 1}
states: {x: {initial: 1}}
controls: {u: {}}
dynamics: {x: u}
cost: {lagrange: u^2 + x^4}
"""


def made(model: Model, steps: int, function: str = "gaussian") -> Nlp:
    basis = ControlBasis(GENERATING_FUNCTIONS[function], steps, 2.0, True)
    method = Discretization(Mesh.uniform(steps), basis, SCHEMES["rk4"], 2)
    return transcribe(model, method, None, None)


def request(name: str, options: dict[str, Any] | None = None, limit: int = 100) -> Request:
    return Request(SOLVERS[name], 1e-9, limit, options or {}, None)


# Every row solves what it is for


@pytest.mark.parametrize("name", PRESENT)
def test_each_solves_the_linear_quadratic_problem(name: str, lq: str, solve: Solve) -> None:
    found = solve(lq, steps=20, solver=name)
    row = SOLVERS[name]
    assert found.success, found.statistics.solver_said
    assert found.statistics.solver == name
    assert found.statistics.program == "QP"
    assert found.options["solver"] == name
    assert found.cost == pytest.approx(math.tanh(1) / 2, abs=max(1e-8, 3 * row.accuracy))
    exact = np.sinh(1 - found.times) / math.cosh(1)
    accuracy = max(1e-6, 10 * row.accuracy)
    assert found.costates[:, 0] == pytest.approx(exact, abs=accuracy)  # multipliers of rows too
    assert found.evidence.tolerance == max(1e-9, row.accuracy)


CASES = [
    (name, problem)
    for problem in ("van_der_pol", "bressan", "bryson_denham")
    for name in PRESENT
    if (name in NONLINEAR or problem == "bryson_denham") and (name, problem) not in KNOWN_FAILURES
]


@pytest.mark.parametrize(("name", "problem"), CASES)
def test_each_finds_the_cost_that_ipopt_finds(name: str, problem: str, solve: Solve) -> None:
    found = solve(problem, steps=40, solver=name, max_iterations=MANY.get(name, 1000))
    usual = solve(problem, steps=40)
    assert found.success, found.statistics.solver_said
    accuracy = max(1e-8, 3 * SOLVERS[name].accuracy)
    assert found.cost == pytest.approx(usual.cost, rel=accuracy, abs=accuracy)


def test_failures_that_are_known_are_called_failures(solve: Solve) -> None:
    for name, problem in KNOWN_FAILURES:
        if name in PRESENT:
            found = solve(problem, steps=40, solver=name, max_iterations=200)
            usual = solve(problem, steps=40)
            assert not found.success or found.cost == pytest.approx(usual.cost, rel=1e-6)


@pytest.mark.parametrize("name", PRESENT)
def test_the_iteration_limit_means_the_same(name: str, solve: Solve) -> None:
    problem = "van_der_pol" if name in NONLINEAR else "bryson_denham"
    found = solve(problem, steps=20, solver=name, max_iterations=1)
    if name == "highs":  # it gives up before it counts
        assert not found.success
    else:
        assert found.status is Status.ITERATION_LIMIT
    assert found.statistics.iterations is None or found.statistics.iterations <= 2


@pytest.mark.parametrize("name", ["ipopt", "sqp-qpoases", "uno", "sleqp", "fatrop", "piqp"])
def test_the_tolerance_reaches_the_solver(name: str) -> None:
    row = SOLVERS[name]
    asked = settings(Request(row, 1e-3, 7, {}, None), warm=False)
    inner = asked if row.group is None else asked[row.group]
    assert {inner[option] for option in row.tolerances} == {1e-3 * row.sharper}
    assert {**asked, **inner}[str(row.iterations)] == 7
    sharp = settings(Request(row, 1e-14, 7, {}, None), warm=False)
    inner = sharp if row.group is None else sharp[row.group]
    assert inner[row.tolerances[0]] == row.sharper * max(1e-14, row.accuracy)


# Words and numbers


def test_statuses_are_translated() -> None:
    for row in SOLVERS.values():
        for word, status in row.statuses.items():
            assert status_of(row, {"return_status": word}) == (status, word)
        for ending, status in (
            ("SOLVER_RET_SUCCESS", Status.SOLVED),
            ("SOLVER_RET_LIMITED", Status.ITERATION_LIMIT),
            ("SOLVER_RET_NAN", Status.NOT_FINITE),
            ("SOLVER_RET_INFEASIBLE", Status.INFEASIBLE),
            ("SOLVER_RET_UNKNOWN", Status.FAILED),
        ):
            said = {"return_status": "no such word", "unified_return_status": ending}
            assert status_of(row, said)[0] is status
        assert status_of(row, {}) == (Status.FAILED, "unknown")
    assert all(status.value.endswith(".") for status in Status)


def test_counts_that_cannot_be_are_unknown() -> None:
    row = SOLVERS["ipopt"]
    assert count_of(row, {"iter_count": 12}) == 12
    for garbage in (-1, -1213504263, 10**12, math.nan, math.inf, None, "many"):
        assert count_of(row, {"iter_count": garbage}) is None
    assert count_of(row, {}) is None


# Options


def test_an_unknown_solver_is_told_with_the_nearest_name() -> None:
    with pytest.raises(quito.UsageError, match="solver"):
        quito.solve("bang_bang", steps=5, solver="ipop")
    with pytest.raises(quito.UsageError, match="did you mean 'ipopt'"):
        minimise(None, "ipop", 1e-9, 10, {}, None, None)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", PRESENT)
def test_an_unknown_option_is_refused_by_name(name: str, lq: str) -> None:
    with pytest.raises(quito.UsageError, match=r"no_such_option|refuses an option") as caught:
        quito.solve(
            load_text(lq, "lq.yaml"), steps=5, solver=name, solver_options={"no_such_option": 1}
        )
    assert caught.value.exit_code == 2


def test_a_misspelt_option_is_told_with_the_nearest_name(lq: str) -> None:
    for name, wrong, right in (
        ("uno", "TR_radios", "TR_radius"),
        ("sqp-qrqp", "max_iter_sl", "max_iter_ls"),
        ("qrqp", "min_lamb", "min_lam"),
        ("scipy-slsqp", "ftoll", "ftol"),
    ):
        with pytest.raises(quito.UsageError, match=f"{name} has no option.*'{right}'"):
            quito.solve(load_text(lq, "lq.yaml"), steps=5, solver=name, solver_options={wrong: 1})


def test_options_reach_each_kind_of_solver(solve: Solve) -> None:
    text = load_text(CURVED_COST, "curved.yaml")
    for name, options in (
        ("ipopt", {"linear_solver": "spral"}),
        ("uno", {"preset": "ipopt"}),
        ("sqp-qrqp", {"max_iter_ls": 5}),
        ("scipy-trust-constr", {"initial_tr_radius": 2.0}),
    ):
        found = quito.solve(text, steps=10, solver=name, solver_options=options)
        assert found.success
        assert found.options["solver_options"] == options
        assert found.cost == pytest.approx(quito.solve(text, steps=10).cost, abs=1e-5)


@pytest.mark.parametrize("row", ABSENT, ids=lambda row: str(row.name))
def test_a_solver_that_is_not_here_is_named_with_what_provides_it(
    row: Backend, capfd: pytest.CaptureFixture[str]
) -> None:
    if available(row):
        pytest.skip(f"{row.name} is here")
    with pytest.raises(quito.UnavailableError, match=row.name) as caught:
        quito.solve("bang_bang", steps=5, solver=row.name)
    assert row.provides in str(caught.value)
    assert caught.value.exit_code == 2
    assert capfd.readouterr() == ("", "")


def test_without_scipy_its_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(availability, "_found", lambda engine, _: engine != "scipy")
    for name in ("scipy-slsqp", "scipy-trust-constr"):
        with pytest.raises(quito.UnavailableError, match=r"pip install 'quito\[scipy\]'"):
            quito.solve("bang_bang", steps=5, solver=name)


def test_a_program_too_large_for_dense_algebra_is_refused() -> None:
    with pytest.raises(quito.UsageError, match="up to 1000 unknowns"):
        quito.solve("van_der_pol", steps=400, solver="scipy-slsqp")


# Derivatives


@pytest.mark.parametrize("name", [n for n in NONLINEAR if SOLVERS[n].engine == "nlpsol"])
def test_exact_derivatives_are_those_the_plug_in_uses(name: str, model: Build) -> None:
    """What the plug-in holds under its own names is what was given, and agrees with CasADi's."""
    row = SOLVERS[name]
    nlp = made(model("van_der_pol"), 8)
    program = Program.of(nlp, None)
    given = program.derivatives(row.derivatives)
    cached = {key: value for key, value in given.items() if key.startswith("nlp_")}
    rest = {key: value for key, value in given.items() if key not in cached}
    quiet = {"print_time": False, **row.plugin_options, **rest}
    ours = ca.nlpsol("ours", row.plugin, program.values, quiet | {"cache": cached})
    plain = ca.nlpsol(
        "plain", row.plugin, program.values, {"print_time": False, **row.plugin_options}
    )
    names = [n for n in plain.get_function() if n in cached or "hess" in n or "jac" in n]
    assert names
    for function, mine in given.items():
        if function in cached:  # ours, not what the plug-in would have made
            assert ours.get_function(function).n_instructions() == mine.n_instructions()
    w = nlp.guess + 0.1 * np.random.default_rng(3).normal(size=len(nlp.guess))
    lam = np.random.default_rng(4).normal(size=len(nlp.row_lower))
    for function in names:
        arguments: tuple[Any, ...] = (w, [], 0.7, lam) if "hess" in function else (w, [])
        results = [s.get_function(function).call(arguments) for s in (ours, plain)]
        for one, other in zip(*results, strict=True):
            expected = np.array(ca.DM(other))
            assert np.array(ca.DM(one)) == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_the_program_of_free_unknowns_has_the_derivatives_of_the_whole(model: Build) -> None:
    nlp = made(model("bryson_denham"), 6)
    lam_g = np.random.default_rng(5).normal(size=len(nlp.row_lower))
    whole = Program.of(nlp, start_at(nlp, lam_g))
    free = whole.of_free_unknowns()
    w = np.where(whole.free, nlp.guess + 0.1, nlp.lower)
    keep = np.ix_(whole.free, whole.free)
    assert len(free.guess) == whole.free.sum() == len(whole.guess) - 4
    for small, large, pick in (
        (free.gradient(w[whole.free], [])[1], whole.gradient(w, [])[1], whole.free),
        (free.jacobian(w[whole.free], [])[0], whole.jacobian(w, [])[0], slice(None)),
        (free.hessian(w[whole.free], [], 2.0, lam_g), whole.hessian(w, [], 2.0, lam_g), keep),
        (free.values(w[whole.free], [])[1], whole.values(w, [])[1], slice(None)),
    ):
        assert np.array(small) == pytest.approx(np.array(ca.DM(large))[pick], abs=1e-12)
    assert free.start is not None
    assert whole.start is not None
    assert (free.start.lam_w == whole.start.lam_w[whole.free]).all()


# Nothing is believed


@pytest.mark.parametrize("shift", [0.0, 1e-3])
def test_a_backend_that_lies_is_found_out(
    shift: float, model: Build, monkeypatch: pytest.MonkeyPatch
) -> None:
    nlp = made(model("van_der_pol"), 20)
    honest, _ = minimise(nlp, "ipopt", 1e-9, 100, {}, None, None)

    def liar(program: Program, asked: Request) -> Outcome:
        free = int(np.argmax(program.upper - program.lower))
        moved = honest.w + shift * (np.arange(len(honest.w)) == free)
        return replace(honest, w=moved, status=Status.SOLVED, iterations=None)

    monkeypatch.setitem(ENGINES, "nlpsol", lambda: liar)
    outcome, found = minimise(nlp, "ipopt", 1e-9, 100, {}, None, None)
    assert outcome.status is (Status.INACCURATE if shift else Status.SOLVED)
    assert (found.largest > 1e-8) == bool(shift)


def test_an_answer_is_judged_at_what_its_solver_attains(
    model: Build, monkeypatch: pytest.MonkeyPatch
) -> None:
    nlp = made(model("van_der_pol"), 20)
    honest, _ = minimise(nlp, "ipopt", 1e-9, 100, {}, None, None)
    rough = replace(honest, lam_g=honest.lam_g + 1e-6)
    for engine in ("nlpsol", "scipy"):
        monkeypatch.setitem(ENGINES, engine, lambda: lambda *_: rough)
    monkeypatch.setattr("quito_cli.solvers.Program.of_free_unknowns", lambda program: program)
    judged = {
        name: minimise(nlp, name, 1e-9, 100, {}, None, None)[0].status
        for name in ("ipopt", "sqp-piqp")
    }
    assert set(judged.values()) == {Status.INACCURATE}
    loose = minimise(nlp, "ipopt", 1e-6, 100, {}, None, None)[0]
    assert loose.status is Status.SOLVED


# Quadratic programs


@pytest.mark.parametrize(
    ("problem", "why"),
    [
        ("inverted_pendulum", None),
        ("double_integrator_tracking", None),
        ("bryson_denham", None),
        ("van_der_pol", "the dynamics of x2 is not linear"),
        ("bressan", "the dynamics of x3 is not linear"),
        ("minimum_time", "the horizon is free"),
        (CURVED_COST, "cost.lagrange is not quadratic"),
    ],
)
def test_quadratic_programs_are_recognised(problem: str, why: str | None, model: Build) -> None:
    assert made(model(problem), 8).nonlinearity == why


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ("cost: {lagrange: u^2, mayer: x^3}", "cost.mayer is not quadratic"),
        ("cost: {lagrange: u^2, mayer: x^2}", None),
        ("cost: {lagrange: u^2}\nconstraints: {path: {tube: x^2 <= 4}}", "path constraint tube"),
        ("cost: {lagrange: u^2}\nconstraints: {path: {tube: x + t^2*u <= 4}}", None),
        ("cost: {lagrange: u^2}\nconstraints: {integral: {fuel: u^2 <= 5}}", "constraint fuel"),
        ("cost: {lagrange: exp(t)*u^2 + sin(t)*x}", None),
    ],
)
def test_what_is_not_quadratic_is_named(change: str, why: str | None, model: Build) -> None:
    text = CURVED_COST.replace("cost: {lagrange: u^2 + x^4}", change)
    found = made(model(text), 8).nonlinearity
    assert found is None if why is None else found is not None and why in found


def test_recognition_is_quick(model: Build) -> None:
    for problem in ("van_der_pol", "inverted_pendulum", "robot_arm"):
        nlp = made(model(problem), 20)
        for term in nlp.terms:
            _ = term.local  # formed for the solver anyway
        with within(2):
            _ = nlp.nonlinearity


@pytest.mark.parametrize("name", QUADRATIC)
def test_a_solver_of_quadratic_programs_refuses_others(name: str) -> None:
    with pytest.raises(quito.UsageError, match=r"the dynamics of x2 is not linear") as caught:
        quito.solve("van_der_pol", steps=5, solver=name)
    assert name in str(caught.value)


@pytest.mark.parametrize("problem", ["bryson_denham", "double_integrator_tracking"])
def test_auto_takes_a_solver_of_quadratic_programs(problem: str, solve: Solve) -> None:
    found = solve(problem, steps=60, solver="auto")
    assert found.success
    assert found.statistics.solver == "piqp"
    assert found.options["solver"] == "auto"
    assert found.cost == pytest.approx(solve(problem, steps=60).cost, rel=1e-8)


def test_auto_takes_ipopt_otherwise(solve: Solve) -> None:
    assert solve("van_der_pol", steps=20, solver="auto").statistics.solver == "ipopt"
    options = {"mu_strategy": "adaptive"}
    found = quito.solve("bryson_denham", steps=20, solver="auto", solver_options=options)
    assert found.statistics.solver == "ipopt"  # whose options they are
    sharp = quito.solve("bryson_denham", steps=20, solver="auto", tolerance=1e-11)
    assert sharp.statistics.solver == "ipopt"


def test_auto_falls_back_where_the_other_one_fails(
    lq: str, model: Build, monkeypatch: pytest.MonkeyPatch
) -> None:
    nlp = made(model(lq), 10)

    def fails(program: Program, asked: Request) -> Outcome:
        zeros = np.zeros(len(program.row_lower)), np.zeros(len(program.guess))
        status = Status.SOLVED
        return Outcome(status, program.guess, *zeros, None, {}, 0.0, 0.0, "lied", "piqp")

    monkeypatch.setitem(ENGINES, "conic", lambda: fails)
    outcome, found = minimise(nlp, "auto", 1e-9, 100, {}, None, None)
    assert (outcome.solver, outcome.status) == ("ipopt", Status.SOLVED)
    assert found.largest < 1e-8


# Processes of their own


def killed_by(code: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let every child run `code` in place of its own."""

    def started() -> subprocess.Popen[bytes]:
        return subprocess.Popen(
            [sys.executable, "-c", code],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )

    monkeypatch.setattr(child, "_started", started)


@pytest.mark.parametrize(
    ("code", "said"),
    [
        ("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", "by SIGSEGV"),
        ("import sys; sys.stdin.buffer.read(); sys.exit(7)", "with code 7"),
        ("print('no pickle'); import sys; sys.exit(3)", "with code 3"),
    ],
)
def test_the_death_of_a_child_is_reported_and_not_shared(
    code: str, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    killed_by(code, monkeypatch)
    found = quito.solve("bang_bang", steps=10, solver="uno")
    assert found.status is Status.FAILED
    assert found.statistics.solver_said == f"uno ended its process {said}"
    assert found.statistics.iterations is None
    assert found.evidence.diagnosis


def test_ctrl_c_ends_a_child(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(child, "GRACE", 0.2)
    ignores = "import signal, time; signal.signal(signal.SIGINT, signal.SIG_IGN); time.sleep(60)"
    killed_by(ignores, monkeypatch)
    timer = threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT))
    before, started = signal.getsignal(signal.SIGINT), time.perf_counter()
    timer.start()
    found = quito.solve("bang_bang", steps=10, solver="uno")
    assert time.perf_counter() - started < 10
    assert found.status is Status.INTERRUPTED
    assert signal.getsignal(signal.SIGINT) is before


def test_a_child_finds_what_the_engine_finds_here(model: Build) -> None:
    """Options, progress and numbers travel; so does what is raised."""
    program = Program.of(made(model("van_der_pol"), 10), None)
    told: list[Progress] = []
    asked = replace(request("ipopt"), listener=told.append)
    there, here = child.solve(program, asked), ENGINES["nlpsol"]()(program, request("ipopt"))
    assert (there.w == here.w).all()
    assert there.status is here.status is Status.SOLVED
    assert there.iterations == here.iterations
    assert len(told) == (here.iterations or 0) + 1
    with pytest.raises(quito.UsageError, match="IPOPT refuses"):
        child.solve(program, request("ipopt", {"no_such": 1}))


def test_no_solver_prints(capfd: pytest.CaptureFixture[str], lq: str) -> None:
    for name in PRESENT:
        quito.solve(load_text(lq, "lq.yaml"), steps=6, solver=name)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("name", ["sqp-qrqp", "qrsqp", "scipy-slsqp", "scipy-trust-constr"])
def test_ctrl_c_stops_solvers_that_tell_of_their_iterations(name: str) -> None:
    told: list[Progress] = []

    def listen(progress: Progress) -> None:
        told.append(progress)
        if len(told) == 2:
            os.kill(os.getpid(), signal.SIGINT)

    found = quito.solve("van_der_pol", steps=20, solver=name, listener=listen)
    assert found.status is Status.INTERRUPTED
    assert len(told) <= 4
    assert math.isfinite(found.cost)


# Starting warm


@pytest.mark.parametrize("problem", ["rayleigh", "van_der_pol"])
@pytest.mark.parametrize("name", ["ipopt", "sqp-qpoases"])
def test_a_warm_start_takes_a_third_of_the_iterations(
    name: str, problem: str, tmp_path: Path
) -> None:
    steps = 100 if name == "ipopt" else 40
    cold = quito.solve(problem, steps=steps, solver=name)
    assert cold.success
    cold.save(tmp_path / "a.h5")
    again = quito.solve(
        problem, steps=steps, solver=name, guess=str(tmp_path / "a.h5"), warm_start=True
    )
    assert again.success
    assert again.cost == pytest.approx(cold.cost, rel=1e-8)
    assert again.options["warm_start"] is True
    assert again.statistics.iterations is not None
    assert again.statistics.iterations <= (cold.statistics.iterations or 0) / 3


def test_a_warm_start_on_another_mesh_is_no_worse_than_a_cold_one() -> None:
    for problem in ("rayleigh", "van_der_pol", "bryson_denham"):
        coarse = quito.solve(problem, steps=40)
        cold = quito.solve(problem, steps=60)
        warm = quito.solve(problem, steps=60, guess=coarse, warm_start=True)
        assert warm.success
        assert warm.cost == pytest.approx(cold.cost, rel=1e-7)
        assert (warm.statistics.iterations or 99) <= (cold.statistics.iterations or 0)


def test_multipliers_of_an_answer_are_those_it_is_resumed_with(model: Build) -> None:
    from quito_cli.solution.follow import guided, resumed

    for problem in ("van_der_pol_state", "goddard", "rayleigh_mixed"):
        found = quito.solve(problem, steps=30)
        nlp = made(guided(model(problem), found), 30)
        nlp, start = resumed(nlp, found)
        assert residual_at(nlp, start) < 1e-4, problem


def residual_at(nlp: Nlp, start: Start) -> float:
    """The largest residual at the start itself."""
    from quito_cli.solvers.residuals import residuals

    claimed = Outcome(
        Status.SOLVED, nlp.guess, start.lam_g, start.lam_w, 0, {}, 0.0, 0.0, "", "ipopt"
    )
    return residuals(nlp, claimed).largest


def test_what_cannot_start_warm_says_so() -> None:
    with pytest.raises(quito.UsageError, match="--guess"):
        quito.solve("bang_bang", steps=5, warm_start=True)
    earlier = quito.solve("bang_bang", steps=5)
    with pytest.raises(quito.UsageError, match=r"uno cannot start warm; ipopt, .* can"):
        quito.solve("bang_bang", steps=5, solver="uno", guess=earlier, warm_start=True)


# The command


def test_the_self_test_solves_what_the_row_is_for(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from quito_cli.cli import solvers as command

    chosen = ["ipopt", "sqp-piqp", "piqp", "snopt"]
    monkeypatch.setattr(command, "_names", lambda: chosen)
    command.solvers(test=True, as_json=True)
    rows = {row["name"]: row for row in json.loads(capsys.readouterr().out)["solvers"]}
    assert list(rows) == chosen
    assert [tested["problem"] for tested in rows["ipopt"]["tests"]] == list(PROBLEMS)
    assert [tested["problem"] for tested in rows["piqp"]["tests"]] == ["quadratic"]
    for name in chosen[:3]:
        assert rows[name]["available"]
        assert all(t["success"] and t["cost_error"] < 1e-6 for t in rows[name]["tests"])
    command.solvers(test=True, as_json=False)
    printed = capsys.readouterr().out
    assert "solved" in printed
    assert "unknown" in printed  # piqp does not count


def test_every_row_is_in_the_table(capsys: pytest.CaptureFixture[str]) -> None:
    from quito_cli.cli.solvers import solvers

    solvers(test=False, as_json=False)
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines[1:]] == list(SOLVERS)
    for row in ABSENT:
        if not available(row):
            assert any(line.startswith(row.name) and row.provides in line for line in lines)


UNDEFINED = """
time: {initial: 0, final: 1}
states: {x: {initial: -1}}
controls: {u: {lower: -5, upper: 5}}
dynamics: {x: u - log(x)}
cost: {lagrange: (x + 1)^2 + 0.01*u^2}
"""
OUT_OF_REACH = """
time: {initial: 0, final: 1}
states: {x: {initial: 0, final: 3}}
controls: {u: {lower: -1, upper: 1}}
dynamics: {x: u}
cost: {lagrange: u^2}
"""


@pytest.mark.parametrize("name", ["scipy-trust-constr", "scipy-slsqp", "fatrop", "sleqp", "uno"])
def test_an_undefined_guess_is_told_and_does_not_hang(name: str) -> None:
    found = quito.solve(load_text(UNDEFINED, "test.yaml"), steps=8, solver=name)
    assert found.status is Status.NOT_FINITE
    assert "dynamics.x is not finite at node 0" in found.evidence.diagnosis[0]


@pytest.mark.parametrize("name", ["fatrop", "highs", "qrqp", "qpoases"])
def test_what_is_out_of_reach_is_not_called_a_matter_of_iterations(name: str) -> None:
    found = quito.solve(load_text(OUT_OF_REACH, "test.yaml"), steps=10, solver=name)
    assert not found.success
    assert found.status is not Status.ITERATION_LIMIT
    told = " ".join(found.evidence.diagnosis)
    assert "No condition fails by much" not in told
    assert "x ends at" in told


def test_a_warm_start_is_one_of_the_same_problem() -> None:
    other = quito.solve("van_der_pol", steps=10)
    with pytest.raises(quito.UsageError, match="the result is one of van_der_pol"):
        quito.solve("rayleigh", steps=10, guess=other, warm_start=True)
