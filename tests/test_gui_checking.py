"""The checker: remarks where an editor has them, formulas, and no harm from any text."""

from __future__ import annotations

import asyncio
import re
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from quito_cli.gui import checking
from quito_cli.gui.checking import Checked, Checker, Remark
from quito_cli.problem.library import bundled
from quito_cli.problem.load import load_text
from quito_cli.problem.mathematics import render
from quito_cli.solvers import AUTOMATIC

SECONDS, MEMORY, MOST = 20.0, 2 * 10**9, 200_000
TEXT = """\
title: A cart
time: {initial: 0, final: 1}
states: {x: {initial: 0, final: 1}, v: {initial: 0}}
controls: {u: {lower: -9, upper: 9}}
dynamics: {x: v, v: u}
cost: {lagrange: u^2}
options: {steps: 30}
"""


@pytest.fixture(scope="module")
def checker() -> Iterator[Checker]:
    made = Checker(SECONDS, MEMORY, MOST)
    yield made
    made.close()


@pytest.fixture(scope="module")
def check(checker: Checker) -> Callable[[str], Checked]:
    return lambda text: asyncio.run(checker.check(text, "cart"))


def places(checked: Checked) -> list[tuple[int | None, int | None]]:
    return [(remark.line, remark.column) for remark in checked.remarks]


# What is said


def test_a_right_text_has_formulas_and_options_and_no_remark(
    check: Callable[[str], Checked],
) -> None:
    checked = check(TEXT)
    assert checked.ok
    assert checked.complete
    assert checked.remarks == ()
    assert checked.title == "A cart"
    assert checked.options == {"steps": 30}
    assert checked.unicode == render(load_text(TEXT, "cart"), latex=False)
    first, second = checked.formulas[:2]
    assert (first.title, first.over) == ("minimise", "u")
    assert first.lines == (r"\int_0^1 u^2 \, \mathrm{d}t",)
    assert second.title == "subject to"
    assert second.lines[0] == r"\dot{x} = v"


def test_blocks_are_what_check_latex_prints(check: Callable[[str], Checked]) -> None:
    for name in ("van_der_pol", "robot_path", "inverted_pendulum"):
        text = bundled()[name].read_text(encoding="utf-8")
        whole = re.sub(r"\s+", "", render(load_text(text, name), latex=True))
        blocks = check(text).formulas
        assert [block.title for block in blocks] == ["minimise", "subject to", "with"]
        for block in blocks:
            assert block.lines
            assert all(re.sub(r"\s+", "", line) in whole for line in block.lines)


def test_all_mistakes_stand_at_their_lines(check: Callable[[str], Checked]) -> None:
    checked = check(TEXT.replace("v: u}", "v: w}").replace("u^2", "u^2 + y"))
    assert not checked.ok
    assert checked.formulas == ()
    assert places(checked) == [(5, 21), (6, 24)]
    assert all(remark.severity == "error" for remark in checked.remarks)
    assert "unknown name 'w'" in checked.remarks[0].message


def test_a_mistake_is_underlined_as_long_as_it_is(check: Callable[[str], Checked]) -> None:
    (remark,) = check(TEXT.replace("v: u}", "v: wrong + u}")).remarks
    assert (remark.line, remark.column, remark.length) == (5, 21, len("wrong"))


def test_warnings_stand_at_their_lines(check: Callable[[str], Checked]) -> None:
    checked = check(TEXT.replace("title: A cart", "constants: {k: 3}"))
    assert checked.ok
    assert checked.formulas
    assert [(remark.line, remark.severity) for remark in checked.remarks] == [(1, "warning")]
    assert "used nowhere" in checked.remarks[0].message


@pytest.mark.parametrize(
    ("before", "line", "column"),
    [
        ("# 😀😀\n", 6, 21),
        ("\ufeff", 5, 21),
        ("# one\u2028two\u2029three\x85four\n", 6, 21),
        ("# a\r\n# b\r# c\n", 8, 21),
    ],
)
def test_places_are_those_of_an_editor(
    check: Callable[[str], Checked], before: str, line: int, column: int
) -> None:
    text = before + TEXT.replace("v: u}", "v: w}")
    counted = re.split(r"\r\n|\n|\r", text.removeprefix("\ufeff"))
    assert counted[line - 1][column - 1] == "w"  # there is nothing but ASCII before it
    if "\u2028" not in before:
        assert places(check(text)) == [(line, column)]
    else:  # what ends a line for YAML ends the comment
        assert places(check(text))[-1][0] is not None


def test_columns_are_counted_in_utf_16(check: Callable[[str], Checked]) -> None:
    (remark,) = check(TEXT.replace("cost: {", "cost: {'😀': 1, ")).remarks
    assert (remark.line, remark.column, remark.length) == (6, 8, 1)
    (remark,) = check(TEXT.replace("A cart", "'😀😀'x")).remarks
    assert (remark.line, remark.column) == (1, 8 + 6)


def test_options_that_exclude_each_other_are_told(check: Callable[[str], Checked]) -> None:
    checked = check(TEXT.replace("steps: 30", "control: piecewise-constant, variance: 2"))
    assert not checked.ok
    assert "variance belongs to quasi-interpolants" in checked.remarks[0].message


def test_solvers_that_are_here_are_known(checker: Checker) -> None:
    found = asyncio.run(checker.solvers())
    assert {AUTOMATIC, "ipopt", "qrqp"} < set(found)
    assert not {"knitro", "snopt"} & set(found)


# Hostile texts


@pytest.mark.parametrize(
    "text",
    [
        "",
        "\0",
        "x" * (MOST + 1),
        "é" * MOST,
        "[" * 50_000,
        "{a: " * 20_000,
        "- " * 50_000,
        "a: &a [x, x]\nb: &b [*a, *a]\nc: &c [*b, *b]\nd: [*c, *c]\n",
        "<<: *a\n",
        "!!python/object/apply:os.system ['touch /tmp/owned']\n",
        TEXT.replace("u^2", "__import__('os').system('touch /tmp/owned')"),
        TEXT.replace("u^2", "(" * 5_000 + "u" + ")" * 5_000),
        TEXT.replace("u^2", "+".join(["u^2"] * 20_000)),
        TEXT.replace("u^2", "9^9^9^9^9^9*u"),
        TEXT.replace("x: {initial: 0, final: 1}", "x: {size: 1000000000}"),
        TEXT.replace("steps: 30", "solver_options: {hsllib: /tmp/evil.so}"),
        "\n".join(f"k{i}: 1" for i in range(30_000)),
        "title: " + "\ud800",
    ],
    ids=range(18),
)
def test_no_text_does_harm(checker: Checker, text: str) -> None:
    checked = asyncio.run(checker.check(text, "cart"))
    for remark in checked.remarks:
        assert "Traceback" not in remark.message
        assert len(remark.message) < 2_000
    assert len(checked.remarks) <= 100
    assert sum(len(line) for block in checked.formulas for line in block.lines) <= 40_000
    assert not checked.ok or checked.complete or checked.unicode


def test_a_text_may_be_named_anything(checker: Checker) -> None:
    assert asyncio.run(checker.check(TEXT, "../../etc/x\0\n")).title == "A cart"


def load_this_too(tell: Callable[[Any], None]) -> None:
    """Load this file in the worker before the clock runs, and what is needed."""
    checking.load(tell)


def late(text: str, name: str, tell: Callable[[Any], None]) -> Checked:
    """Read at once, and then never end."""
    tell(Checked((), "read", complete=False))
    time.sleep(600)
    raise AssertionError


def hang(text: str, name: str, tell: Callable[[Any], None]) -> Checked:
    time.sleep(600)
    raise AssertionError


def eat(text: str, name: str, tell: Callable[[Any], None]) -> Checked:
    held = []
    while True:
        held.append(bytearray(10_000_000))
        time.sleep(0.001)


def stumble(text: str, name: str, tell: Callable[[Any], None]) -> Checked:
    raise ZeroDivisionError("secret")


@pytest.mark.parametrize(
    ("function", "seconds", "said"),
    [
        (hang, 1.0, "could not be looked at within 1 seconds"),
        (eat, 60.0, "takes too much memory"),
        (stumble, 60.0, "its checker failed"),
    ],
)
def test_what_goes_wrong_is_a_remark(
    monkeypatch: pytest.MonkeyPatch, function: Callable[..., Any], seconds: float, said: str
) -> None:
    monkeypatch.setattr(checking, "look", function)
    checker = Checker(seconds, 250_000_000, MOST)
    try:
        checked = asyncio.run(checker.check(TEXT, "cart"))
        assert not checked.ok
        (remark,) = checked.remarks
        assert said in remark.message
        assert "secret" not in remark.message
    finally:
        checker.close()


def test_what_comes_too_late_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as patch:
        patch.setattr(checking, "load", load_this_too)
        checker = Checker(2.0, MEMORY, MOST)
    try:
        with monkeypatch.context() as patch:
            patch.setattr(checking, "look", late)
            checked = asyncio.run(checker.check(TEXT, "cart"))
        assert (checked.ok, checked.complete, checked.title) == (True, False, "read")
        again = asyncio.run(checker.check(TEXT, "cart"))
        assert (again.complete, again.title) == (True, "A cart")
    finally:
        checker.close()


def test_calls_take_turns(checker: Checker) -> None:
    async def together() -> list[Checked]:
        texts = [TEXT.replace("A cart", f"Cart {i}") for i in range(10)]
        return await asyncio.gather(*(checker.check(text, "cart") for text in texts))

    assert [found.title for found in asyncio.run(together())] == [f"Cart {i}" for i in range(10)]


def test_closing_ends_what_is_being_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(checking, "load", load_this_too)
    checker = Checker(3600.0, MEMORY, MOST)
    asyncio.run(checker.check(TEXT, "cart"))
    monkeypatch.setattr(checking, "look", late)

    async def close_it_in_between() -> Checked:
        look = asyncio.create_task(checker.check(TEXT, "cart"))
        await asyncio.sleep(0.3)
        await asyncio.to_thread(checker.close)
        return await look

    found = asyncio.run(asyncio.wait_for(close_it_in_between(), 120.0))
    assert not found.complete


def test_a_closed_checker_says_so() -> None:
    checker = Checker(2.0, MEMORY, MOST)
    checker.close()
    (remark,) = asyncio.run(checker.check(TEXT, "cart")).remarks
    assert isinstance(remark, Remark)
    assert remark.severity == "error"
