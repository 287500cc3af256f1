"""Baselines and reports on the command line, and the recipe for CI in the README."""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import xmlschema
from documents import Ran, blocks, run
from finished import answered, finished, outside

from quito_cli.batch import baseline_file, holding
from quito_cli.batch.baseline import Baseline
from quito_cli.batch.calibration import calibrate
from quito_cli.batch.case import Case, Ending, Figure, Finished
from quito_cli.batch.rules import Tolerance
from quito_cli.batch.suite import Suite
from quito_cli.batch.worker import Returned, Worker
from quito_cli.errors import QuitoError
from quito_cli.problem.text.strict_yaml import read

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
JUNIT = xmlschema.XMLSchema(ROOT / "tests" / "schemas" / "junit.xsd")
CART = """\
title: Cart
time: {initial: 0, final: 1}
states: {x: {initial: 0, final: 1}}
controls: {u: {}}
dynamics: {x: u}
cost: {lagrange: u^2}
options: {steps: 8}
"""
SUITE = """\
cases: [a.yaml, b.yaml]
"""
GOOD: dict[str, Figure] = {"cost": 1.0, "iterations": 10, "processor_seconds": 0.3}

Quito = Callable[..., Ran]


@pytest.fixture
def quito(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Quito:
    """Run a command in a folder with a suite of two problems."""
    monkeypatch.chdir(tmp_path)
    for name in ("a.yaml", "b.yaml"):
        (tmp_path / name).write_text(CART, encoding="utf-8")
    (tmp_path / "nightly.yaml").write_text(SUITE, encoding="utf-8")

    def ran(*arguments: str) -> Ran:
        code = run(list(arguments), monkeypatch)
        return Ran(code, *capsys.readouterr())

    return ran


@pytest.fixture
def comes_to(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Let the next runs come to these cases, without solving any; a calibration takes 0.1 s."""
    monkeypatch.setattr("quito_cli.batch.holding._calibration", lambda jobs: 0.1)

    def set_to(*cases: Finished, interrupted: bool = False) -> None:
        def ran(suite: Suite, *_: Any, **__: Any) -> tuple[tuple[Finished, ...], bool]:
            names = [case.name for case in suite.cases]
            return tuple(case for case in cases if case.case.name in names), interrupted

        monkeypatch.setattr("quito_cli.batch.running._finished", ran)

    return set_to


Comes = Callable[..., None]
BOTH = (answered("a", GOOD), answered("b", GOOD))


def test_a_baseline_from_its_first_run_to_its_update(quito: Quito, comes_to: Comes) -> None:
    comes_to(*BOTH)
    arguments = ["batch", "nightly.yaml", "--baseline", "base.yaml"]
    none_yet = quito(*arguments)
    assert none_yet.code == 2
    assert "there is no baseline base.yaml: --update-baseline makes one" in none_yet.err
    made = quito(*arguments, "--update-baseline")
    assert made.code == 0
    assert "The baseline was written anew. (base.yaml)" in made.out
    recorded = baseline_file.read(Path("base.yaml"))
    assert recorded.cases["a"] == {"cost": 1.0, "iterations": 10, "processor_time": 3.0}
    assert "As the baseline has it. (base.yaml)" in quito(*arguments).out

    comes_to(BOTH[0], answered("b", GOOD | {"iterations": 30}))
    worse = quito(*arguments)
    assert worse.code == 3
    assert re.search(r"^worse +b +iterations +10 +30 +\+20 \(\+200 %\) +3$", worse.out, re.M)
    assert "nightly: 2 passed, 1 worse than the baseline" in worse.out
    silent = quito(*arguments, "-q")
    assert silent.code == 3
    assert "Against the baseline: 1 worse." in silent.out
    assert "passed" not in silent.out
    said = quito(*arguments, "--json")
    assert said.code == said.json["exit_code"] == 3
    assert said.json["baseline"]["counts"]["worse"] == 1
    assert said.json["failed"] == 1

    accepted = quito(*arguments, "--update-baseline")
    assert accepted.code == 0
    assert "worse" in accepted.out
    assert baseline_file.read(Path("base.yaml")).cases["b"]["iterations"] == 30
    assert quito(*arguments).code == 0


def test_a_case_that_is_gone_and_a_part_of_a_suite(quito: Quito, comes_to: Comes) -> None:
    comes_to(*BOTH)
    arguments = ["batch", "nightly.yaml", "--baseline", "base.yaml"]
    assert quito(*arguments, "--update-baseline").code == 0
    assert quito(*arguments, "--filter", "a").code == 0
    changed = answered("a", GOOD | {"cost": 0.5})
    comes_to(changed, BOTH[1])
    assert quito(*arguments, "--filter", "a", "--update-baseline").code == 0
    assert set(baseline_file.read(Path("base.yaml")).cases) == {"a", "b"}
    Path("nightly.yaml").write_text("cases: [a.yaml]\n", encoding="utf-8")
    gone = quito(*arguments)
    assert gone.code == 3
    assert re.search(r"^missing +b +solved +-$", gone.out, re.M)
    assert "1 passed, 1 missing" in gone.out
    assert quito(*arguments, "--update-baseline").code == 0
    assert set(baseline_file.read(Path("base.yaml")).cases) == {"a"}


def test_a_run_that_stopped_writes_no_baseline(quito: Quito, comes_to: Comes) -> None:
    comes_to(*BOTH)
    arguments = ["batch", "nightly.yaml", "--baseline", "base.yaml"]
    assert quito(*arguments, "--update-baseline").code == 0
    before = Path("base.yaml").read_bytes()
    comes_to(answered("a", GOOD | {"cost": 5.0}), interrupted=True)
    stopped = quito(*arguments, "--update-baseline")
    assert stopped.code == 130
    assert "base.yaml is as it was: the run stopped before its end" in stopped.err
    assert "missing" not in stopped.out
    comes_to(BOTH[0], finished("b", Ending.INTERRUPTED))
    assert quito(*arguments, "--update-baseline").err.startswith("base.yaml is as it was")
    assert Path("base.yaml").read_bytes() == before


def test_what_did_not_solve_is_graver_than_what_became_worse(quito: Quito, comes_to: Comes) -> None:
    comes_to(*BOTH)
    arguments = ["batch", "nightly.yaml", "--baseline", "base.yaml"]
    assert quito(*arguments, "--update-baseline").code == 0
    comes_to(answered("a", GOOD | {"iterations": 99}), finished("b", Ending.CRASHED, "signal 11"))
    assert quito(*arguments).code == 1


def test_all_reports_of_a_run(quito: Quito, comes_to: Comes) -> None:
    comes_to(BOTH[0], finished("b", Ending.OUTSIDE, checks=(outside(),), cost=2.0))
    paths = {"--junit": "out/j.xml", "--markdown": "out/m.md", "--html": "out/h.html"}
    arguments = [word for pair in paths.items() for word in pair]
    made = quito("batch", "nightly.yaml", *arguments)
    assert made.code == 3
    assert "Saved out/j.xml, out/m.md, out/h.html" in made.out
    JUNIT.validate("out/j.xml")
    assert Path("out/m.md").read_text(encoding="utf-8").startswith("## ❌ nightly\n")
    assert "cost is 2, expected 1" in Path("out/h.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--update-baseline"], "--update-baseline needs --baseline"),
        (["--html", "h.html", "--plots", "some"], "plots: expected failed, all or none"),
        (["--plots", "all"], "add --html with its file"),
        (["--html", "h.html", "--keep", "none"], "add --plots none"),
        (["--html", "h.html", "--keep", "failed", "--plots", "all"], "add --plots failed"),
        (["--junit", "."], "is a folder: name a file in it"),
        (["--markdown", "a.yaml/m.md"], "a.yaml is not a folder"),
        (["--baseline", "a.yaml"], "there is no section 'title'"),
        (["--baseline", "a.yaml/b.yaml", "--update-baseline"], "is not a folder"),
    ],
    ids=lambda given: " ".join(given) if isinstance(given, list) else None,
)
def test_what_cannot_be_made_is_refused_before_the_run(
    quito: Quito, monkeypatch: pytest.MonkeyPatch, arguments: list[str], message: str
) -> None:
    monkeypatch.setattr("quito_cli.batch.running._finished", lambda *_, **__: pytest.fail("it ran"))
    refused = quito("batch", "nightly.yaml", *arguments)
    assert refused.code == 2
    assert message in refused.err


# Calibration


def test_the_calibration_is_done_by_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    worker = Worker(None)
    worker.start(calibrate)
    answer = worker.receive()
    worker.close()
    assert isinstance(answer, Returned)
    assert 1e-3 < answer.value < 60
    monkeypatch.setattr(holding, "calibrate", _broken)
    with pytest.raises(QuitoError, match=r"the calibration solve failed.*out of order"):
        holding._calibration(1)


def _broken(_tell: Callable[[Any], None]) -> float:
    raise QuitoError("out of order")


def test_times_are_held_against_the_fastest_calibration(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    units = iter([0.3, 0.1])
    monkeypatch.setattr(holding, "_calibration", lambda jobs: next(units))
    path = tmp_path / "base.yaml"
    kept = Baseline({"a": {"processor_time": 3.0}}, {"processor_time": Tolerance(0.1, 0)})
    baseline_file.write(kept, path)
    ready = holding.prepare(path, 1, update=False)
    suite = Suite("nightly", "", (Case("a", "van_der_pol"),), {})
    done = [answered("a", {"processor_seconds": 0.31})]
    (row,) = holding.report_of(suite, done, 1.0, ready).differences
    assert row.found == pytest.approx(3.1)
    assert holding.prepare(path, None, update=False).calibration is None, "on other machines"
    ignoring = Baseline({}, {"processor_time": None})
    baseline_file.write(ignoring, path)
    assert holding.prepare(path, 1, update=False).calibration is None


# The recipe


def recipe(name: str) -> dict[str, Any]:
    """A file of the README, read as YAML 1.2, where `on` is a name."""
    (text,) = [block.text for block in blocks(README) if block.mark == f"file: {name}"]
    return read(text, name).data


def commands(lines: list[str]) -> list[list[str]]:
    """The commands of quito among those of a script."""
    return [shlex.split(line)[1:] for line in lines if line.startswith("quito ")]


def scripts() -> dict[str, list[list[str]]]:
    """The commands of both recipes."""
    (job,) = recipe(".github/workflows/nightly.yml")["jobs"].values()
    runs = [step["run"] for step in job["steps"] if "run" in step]
    return {
        "github": commands(runs),
        "gitlab": commands(recipe(".gitlab-ci.yml")["nightly"]["script"]),
    }


def test_the_workflow_is_one() -> None:
    flow = recipe(".github/workflows/nightly.yml")
    assert set(flow) == {"name", "on", "permissions", "jobs"}
    assert set(flow["on"]) == {"pull_request", "schedule"}
    assert re.fullmatch(r"(\S+ ){4}\S+", flow["on"]["schedule"][0]["cron"])
    (job,) = flow["jobs"].values()
    for step in job["steps"]:
        assert set(step) <= {"uses", "with", "run", "if"}
        assert ("uses" in step) != ("run" in step)
        assert re.fullmatch(r"[\w-]+/[\w-]+@v\d+", step.get("uses", "a/b@v1"))
    (publish,) = [s for s in job["steps"] if "action-junit-report" in s.get("uses", "")]
    (command,) = scripts()["github"]
    assert publish["with"]["report_paths"] == command[command.index("--junit") + 1]
    places = [i for i, s in enumerate(job["steps"]) if s.get("run", "").startswith("quito")]
    after = job["steps"][places[-1] + 1 :]
    assert len(after) == 3
    assert all(step["if"] == "${{ !cancelled() }}" for step in after), "reports of red runs, too"
    assert command[command.index("--markdown") + 1] in after[0]["run"]


def test_the_job_of_gitlab_is_one() -> None:
    job = recipe(".gitlab-ci.yml")["nightly"]
    assert set(job) == {"image", "script", "artifacts"}
    (command,) = scripts()["gitlab"]
    assert job["artifacts"]["reports"]["junit"] == command[command.index("--junit") + 1]
    assert job["artifacts"]["when"] == "always"
    folder = Path(command[command.index("--html") + 1]).parent
    assert job["artifacts"]["paths"] == [str(folder)]


def test_the_recipe_runs(quito: Quito) -> None:
    """In full, with workers and calibrations: recorded, compared, and reported where it failed."""
    (record,) = [shlex.split(b.text)[1:] for b in blocks(README) if b.mark == "command: baseline"]
    assert quito(*record).code == 0
    (command,) = scripts()["github"]
    assert command[: len(record) - 1] == record[:-1]
    passed = quito(*command)
    assert passed.code == 0, passed.out
    assert "As the baseline has it." in passed.out
    baseline = Path("nightly.baseline.yaml")
    text = baseline.read_text(encoding="utf-8")
    text = re.sub(r"processor_time: {.*", "processor_time: ignore", text)
    baseline.write_text(re.sub(r"cost: [\d.]+$", "cost: 0.5", text, flags=re.M), encoding="utf-8")
    failed = quito(*command, "--json")
    assert failed.code == 3
    figures = {row["figure"] for row in failed.json["baseline"]["differences"]}
    assert figures == {"cost"}
    JUNIT.validate("reports/junit.xml")
    assert "2 worse" in Path("reports/summary.md").read_text(encoding="utf-8")
    page = Path("reports/nightly.html").read_text(encoding="utf-8")
    assert page.count("data:image/svg+xml;base64,") == 2
    assert failed.json["failed"] == 2
    for case in failed.json["cases"]:
        assert 1e-3 < case["figures"]["processor_seconds"] < 1.5 * case["seconds"]
