"""The page by NiceGUI's simulation of a user, with the real desk behind it; and its parts alone."""

from __future__ import annotations

import asyncio
import csv
import re
import socket
import sys
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from documents import run as run_command
from long_solve import LONG

nicegui = pytest.importorskip(
    "nicegui", reason='the page needs its extra: pip install "quito[gui]"'
)

from nicegui import Client, ui  # noqa: E402
from nicegui.testing import User  # noqa: E402
from nicegui.testing.user_download import UserDownload  # noqa: E402
from nicegui.testing.user_simulation import user_simulation  # noqa: E402

from quito_cli.errors import UsageError  # noqa: E402
from quito_cli.gui.answer import Answer, Chart, Line, Mark, Span  # noqa: E402
from quito_cli.gui.checking import Checker, Remark  # noqa: E402
from quito_cli.gui.desk import LIMITS, Desk  # noqa: E402
from quito_cli.gui.exports import Exporter  # noqa: E402
from quito_cli.gui.page import page  # noqa: E402
from quito_cli.gui.page_chart import picture  # noqa: E402
from quito_cli.gui.page_edit import decorations, tooltips  # noqa: E402
from quito_cli.gui.page_html import notes, table  # noqa: E402
from quito_cli.gui.page_mathematics import mathml  # noqa: E402
from quito_cli.gui.page_state import LINGER, Draft, Services, Tabs, draft_of  # noqa: E402
from quito_cli.gui.serve import free_port  # noqa: E402
from quito_cli.gui.shelf import Shelf  # noqa: E402
from quito_cli.problem.library import bundled  # noqa: E402

PATIENCE = 600
"""Tenths of a second that anything may take."""


@pytest.fixture(scope="module")
def services(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Services]:
    folder = tmp_path_factory.mktemp("folder")
    (folder / "mine.yaml").write_bytes(bundled()["bang_bang"].read_bytes())
    desk = Desk(replace(LIMITS, grace=60.0), workers=1)  # who is slow to notice is not ended
    checker = Checker(60.0, 1 << 30, LIMITS.characters)
    exporter = Exporter(60.0, LIMITS.memory)
    shelf = Shelf(folder, LIMITS.characters)
    yield Services(desk, checker, exporter, shelf, Tabs(desk), LIMITS.characters)
    checker.close()
    exporter.close()
    desk.close()
    shelf.close()


@dataclass
class Person:
    """A simulated user with a few more words."""

    user: User
    draft: dict[str, Any] | None = None
    """What the browser has kept."""

    async def open(self) -> None:
        known = {"dark": False, "colours": None}
        rules = self.user.javascript_rules
        rules[re.compile(r".*quito\.draft\(\).*")] = lambda _: known | {"draft": self.draft}
        await self.user.open("/")
        await self.until(lambda: self.label("count").text != "")
        await self.until(lambda: self.one("run").enabled or self.one("cancel").enabled)

    async def until(self, holds: Callable[[], object]) -> None:
        for _ in range(PATIENCE):
            if holds():
                return
            await asyncio.sleep(0.1)
        raise AssertionError(f"waited in vain: {self.label('status').text}")

    def one(self, mark: str) -> Any:
        (found,) = self.user.find(marker=mark).elements
        return found

    def label(self, mark: str) -> ui.label:
        found = self.one(mark)
        assert isinstance(found, ui.label)
        return found

    def html(self, mark: str) -> str:
        found = self.one(mark)
        assert isinstance(found, ui.html)
        return str(found.content)

    def type(self, text: str) -> None:
        with self.user:
            self.one("editor").value = text

    def set(self, name: str, value: object) -> None:
        with self.user:
            self.one(f"set-{name}").value = value

    def choose(self, key: str) -> None:
        with self.user:
            self.one("problem").value = key

    async def solve(self) -> None:
        self.label("status").set_text("")
        self.user.find(marker="run").click()
        await self.until(lambda: self.label("status").text and self.one("run").enabled)

    @property
    def text(self) -> str:
        return str(self.one("editor").value)


@asynccontextmanager
async def visiting(services: Services) -> AsyncIterator[Person]:
    async def root() -> None:
        await page(services)

    async with user_simulation(root) as user:
        try:
            yield Person(user)
        finally:  # what a client still has to send must not outlive the loop
            for client in list(Client.instances.values()):
                client.delete()


def at_the_page(services: Services, doing: Callable[[Person], Awaitable[None]]) -> None:
    """Open the page and do something there."""

    async def visit() -> None:
        async with visiting(replace(services, tabs=Tabs(services.desk))) as person:
            await person.open()
            await doing(person)

    asyncio.run(visit())


def test_it_begins_with_a_problem_its_formulas_and_its_command(services: Services) -> None:
    async def doing(person: Person) -> None:
        assert person.text == services.shelf.read("library", "alychan")
        assert person.html("formulas").count("<math") > 5
        assert person.label("command").text == "quito solve alychan"
        assert person.one("set-steps").value == 100
        assert not person.one("cancel").enabled

    at_the_page(services, doing)


def test_choosing_and_coming_back_to_what_was_edited(services: Services) -> None:
    async def doing(person: Person) -> None:
        person.choose("folder/mine.yaml")
        await person.until(lambda: person.text == bundled()["bang_bang"].read_text("utf-8"))
        person.choose("library/van_der_pol")
        await person.until(lambda: "Van der Pol" in person.text)
        assert person.label("command").text == "quito solve van_der_pol"
        person.type(person.text + "# mine\n")
        await person.until(lambda: person.label("command").text == "quito solve van_der_pol.yaml")
        person.user.find(marker="new").click()
        await person.until(lambda: "weak motor" in person.text)
        person.choose("own/van_der_pol.yaml")
        await person.until(lambda: person.text.endswith("# mine\n"))

    at_the_page(services, doing)


def test_mistakes_stand_at_their_lines(services: Services) -> None:
    async def doing(person: Person) -> None:
        good = person.text
        person.type(good.replace("x2: u", "x2: w"))
        await person.until(lambda: person.label("count").text == "1 error")
        line = 1 + good[: good.index("x2: u")].count("\n")
        marks = {spec["kind"]: spec for spec in person.one("editor").decorations}
        assert marks["line"]["line"] == line
        assert person.text[marks["mark"]["from"] : marks["mark"]["to"]] == "w"
        assert list(person.one("editor").line_tooltips) == [line]
        await person.solve()
        assert "w" in person.label("status").text
        assert person.text == good.replace("x2: u", "x2: w")  # a refused solve takes nothing
        person.type(good)
        await person.until(lambda: person.label("count").text == "no complaints")
        assert person.one("editor").decorations == []

    at_the_page(services, doing)


def test_settings_become_the_command_line(services: Services) -> None:
    async def doing(person: Person) -> None:
        person.set("steps", 30.0)
        person.set("generating_function", "laguerre6")
        words = "quito solve alychan -N 30 --generating-function laguerre6"
        assert person.label("command").text == words
        person.set("discretization", "lgr")
        assert "disable" in person.one("set-variance").props
        assert "generating" not in person.label("command").text
        person.set("discretization", "rk4")
        assert "disable" not in person.one("set-variance").props
        person.set("steps", -3)
        assert person.label("command").text.startswith("# steps")
        person.user.find(marker="run").click()
        await person.until(lambda: "steps" in person.label("status").text)
        person.set("steps", None)  # back to what the file asks for
        person.set("generating_function", "gaussian")
        assert person.label("command").text == "quito solve alychan"

    at_the_page(services, doing)


def test_what_a_file_asks_for_is_the_default(services: Services) -> None:
    async def doing(person: Person) -> None:
        field = person.one("set-steps")
        text = services.shelf.read("folder", "mine.yaml")
        person.type(re.sub("^options: .*", "options: {steps: 42}", text, flags=re.MULTILINE))
        await person.until(lambda: person.one("set-steps").value == 42)
        assert " -N" not in person.label("command").text
        person.set("steps", 43)
        assert person.label("command").text.endswith("-N 43")
        assert person.one("set-steps") is field  # what is typed into it meanwhile is not lost

    at_the_page(services, doing)


def test_runs_are_seen_laid_over_and_removed(
    services: Services, monkeypatch: pytest.MonkeyPatch
) -> None:
    taken: list[Path] = []
    monkeypatch.setattr(UserDownload, "file", lambda _, path, *named: taken.append(path))

    async def doing(person: Person) -> None:
        person.set("steps", 20)
        await person.solve()
        assert "Solved" in person.html("verdict")
        assert "1: alychan, steps 20" in person.html("verdict")
        assert "re-simulated" in person.html("summary")
        assert "holds" in person.html("certificate")
        first = len(person.one("chart").options["series"])
        person.set("steps", 24)
        await person.solve()
        with person.user:
            person.one("overlay-1").value = True
        await person.until(lambda: "1: alychan" in person.html("legend"))
        assert len(person.one("chart").options["series"]) == first + 4  # u, x1, x2, x3
        with person.user:
            person.one("known").value = False
        await person.until(lambda: "reference" not in person.html("legend"))
        person.user.find(marker="remove-1").click()
        await person.until(lambda: "1: alychan" not in person.html("legend"))
        person.user.find(marker="take-csv").click()
        await person.until(lambda: taken)
        heads, *rows = list(csv.reader(taken[0].read_text("utf-8").splitlines()))
        assert {"t", "u", "x1", "x2", "x3"} <= set(heads)
        assert len(rows) == 25  # the nodes of the second run

    at_the_page(services, doing)


def test_compared_with_the_reference(services: Services, monkeypatch: pytest.MonkeyPatch) -> None:
    taken: list[Path] = []
    monkeypatch.setattr(UserDownload, "file", lambda _, path, *named: taken.append(path))

    async def doing(person: Person) -> None:
        person.set("steps", 20)
        await person.solve()
        person.user.find(marker="compare-lgr").click()
        await person.until(lambda: person.label("status").text == "Compared.")
        with person.user:
            text = "".join(e.content for e in person.user.find(ui.html).elements)
        assert "Error of the control" in text
        assert "lgr" in text
        names = {each["name"] for each in person.one("compared-chart").options["series"]}
        assert {"lgr", "quasi-interpolant:gaussian", "u, reference", "x1, reference"} <= names
        labels = [axis["name"] for axis in person.one("compared-chart").options["yAxis"]]
        assert labels[:2] == ["u", "error of u"]
        assert labels[-1] == "x3"
        person.user.find(marker="compared-csv").click()
        await person.until(lambda: taken)
        heads, *rows = list(csv.reader(taken[0].read_text("utf-8").splitlines()))
        assert [row[heads.index("method")] for row in rows][1:] == ["lgr"]

    at_the_page(services, doing)


def test_a_reload_finds_text_settings_and_results(services: Services) -> None:
    async def doing(person: Person) -> None:
        person.set("steps", 20)
        await person.solve()
        person.type("# the last words\n" + person.text)
        await person.open()  # the browser kept nothing: the server did
        assert person.text.startswith("# the last words")
        assert person.label("command").text == "quito solve alychan.yaml -N 20"
        await person.until(lambda: "Solved" in person.html("verdict"))
        person.draft = {"name": "a.yaml", "place": "own", "text": "title: t\n", "chosen": {"n": 1}}
        await person.open()  # what the browser kept is newer
        assert person.text == "title: t\n"

    at_the_page(services, doing)


def test_a_reload_in_the_middle_follows_the_solve(services: Services) -> None:
    async def doing(person: Person) -> None:
        person.type(LONG)
        await person.until(lambda: person.one("set-steps").value == 901)
        person.user.find(marker="run").click()
        await person.until(lambda: person.label("iteration").text != "–")
        await person.open()
        await person.until(lambda: not person.one("run").enabled)
        person.user.find(marker="cancel").click()
        await person.until(lambda: "best iterate so far" in person.label("status").text)
        assert "Not solved" in person.html("verdict")

    at_the_page(services, doing)


def test_two_tabs_have_their_own(services: Services) -> None:
    async def doing(person: Person) -> None:
        other = Person(User(person.user.http_client))
        await other.open()
        other.type("title: other\n")
        other.set("steps", 7)
        await other.until(lambda: "error" in other.label("count").text)
        assert "Aly-Chan" in person.text
        assert person.label("command").text == "quito solve alychan"

    at_the_page(services, doing)


def test_uploads_are_read_as_text_alone(services: Services) -> None:
    async def upload(person: Person, name: str, content: bytes) -> None:
        file = ui.upload.SmallFileUpload(name, "text/yaml", content)
        with person.user:
            await person.one("uploader").handle_uploads([file])

    async def doing(person: Person) -> None:
        await upload(person, "../../x/My problem.yaml", b"title: up\r\ntime: 1\r\n")
        await person.until(lambda: person.text == "title: up\ntime: 1\n")
        assert person.label("name").text == "My_problem.yaml"
        await upload(person, "a.yaml", b"\xff\xfe\x00")
        await person.until(lambda: "UTF-8" in person.label("status").text)
        await upload(person, "a.yaml", b"#" * (LIMITS.characters + 1))
        await person.until(lambda: "too large" in person.label("status").text)
        assert person.text.startswith("title: up")

    at_the_page(services, doing)


def test_saving_asks_before_it_replaces(services: Services) -> None:
    async def doing(person: Person) -> None:
        for name, word in (("kept.yaml", "saved"), ("mine.yaml", "Keep it")):
            person.user.find(marker="save").click()
            await person.user.should_see("Save in the folder as", retries=PATIENCE)
            with person.user:
                person.one("name-to-save").value = name
            person.user.find(marker="ok").click()
            if word == "saved":
                await person.until(lambda: "saved as kept.yaml" in person.label("status").text)
            else:
                await person.user.should_see("Keep it", retries=PATIENCE)
                person.user.find("Keep it").click()
        assert services.shelf.read("folder", "kept.yaml") == person.text
        assert "bang" in services.shelf.read("folder", "mine.yaml")

    at_the_page(services, doing)


# Its parts alone.


def test_text_in_formulas_stays_text() -> None:
    made = mathml(r"\text{\ttfamily <script>x</script> &lt;b&gt; a & b} + \mathbf{A}_1")
    root = ElementTree.fromstring(made)
    names = {node.tag.rpartition("}")[2] for node in root.iter()}
    assert not names & {"script", "b"}
    assert "<script" not in made
    assert "𝐀" in made


def test_tables_and_notes_are_escaped() -> None:
    made = table("<i>", ("<b>", "x"), (("<u>", "<s>"),), ("'\"><q>",)) + notes(["<p>&"], "warn")
    for name in "ibusqp":
        assert f"<{name}>" not in made
        assert f"&lt;{name}&gt;" in made


def test_decorations_count_characters_not_units() -> None:
    text = "a: '𝒳'  # 🚀\nb: 𝒳 + w"
    remarks = [Remark(2, 9, 1, "unknown name 'w'", "error"), Remark(99, None, 1, "end", "warning")]
    found = decorations(text, remarks)
    (mark,) = (spec for spec in found if spec["kind"] == "mark")
    assert text[mark["from"] : mark["to"]] == "w"
    assert {spec["line"] for spec in found if spec["kind"] == "line"} == {2}
    assert {spec["position"] for spec in found if spec["kind"] == "widget"} == {len(text)}
    assert tooltips(text, remarks) == {2: "unknown name 'w'\nend"}


def answer(charts: tuple[Chart, ...]) -> Answer:
    return Answer(
        kind="solve",
        name="p",
        title="",
        success=True,
        status="solved",
        said="",
        given={},
        diagnosis=(),
        rows=(),
        warnings=(),
        verdict=None,
        caveat="",
        certificate=(),
        charts=charts,
        tables=(),
        notes=(),
        figures={},
    )


def test_a_picture_has_bounds_marks_arcs_and_the_reference() -> None:
    lines = (
        Line("u", "answer", 0, (0.0, 1.0), (0.0, 1.0)),
        Line("reference", "reference", -1, (0.0, 1.0), (0.0, None)),
    )
    chart = Chart(
        "controls",
        "u",
        "u [N]",
        "t",
        lines,
        bounds=(-1.0, 1.0),
        marks=(Mark(0.5, 0.1, "0.5 ± 0.1  u jumps", True),),
        spans=(Span(0.0, 0.5, "lower", "at lower bound"), Span(0.5, 1.0, "interior", "interior")),
    )
    drawn = picture(answer((chart,)), ["controls"], (), True)
    assert drawn
    assert [entry.name for entry in drawn.legend] == [
        "reference",
        "bound",
        "switching time 0.5",
        "at a bound",
    ]
    series = drawn.options["series"]
    assert [each["name"] for each in series] == ["~bound -1", "~bound 1", "u", "u, reference"]
    assert series[-1]["markLine"]["data"][0]["xAxis"] == 0.5
    assert len(series[-1]["markArea"]["data"]) == 1
    assert "switching at 0.5 ± 0.1  u jumps" in drawn.said
    many = replace(chart, marks=tuple(Mark(i / 9, 0.0, f"{i}", False) for i in range(9)))
    crowded = picture(answer((many,)), ["controls"], (), True)
    assert crowded
    assert "9 switching times" in {entry.name for entry in crowded.legend}
    without = picture(answer((chart,)), ["controls"], [("2: p", answer((chart,)))], False)
    assert without
    assert [each["name"] for each in without.options["series"]][2:] == ["u, 2: p", "u"]
    assert picture(answer((chart,)), ["states"], (), True) is None


def test_what_a_browser_kept_is_not_trusted() -> None:
    good = {"name": "a.yaml", "place": "own", "text": "t", "chosen": {"steps": 3, "x": [1]}}
    assert draft_of(good, 10) == Draft("a.yaml", "own", "t", {"steps": 3})
    for wrong in (
        None,
        "text",
        good | {"name": 3},
        good | {"name": ""},
        good | {"place": "elsewhere"},
        good | {"text": "t" * 11},
        good | {"chosen": None},
    ):
        assert draft_of(wrong, 10) is None


def test_tabs_that_are_gone_are_dropped(monkeypatch: pytest.MonkeyPatch) -> None:
    left: list[str] = []

    class Wings:
        def leave(self, session: str) -> None:
            left.append(session)

    clock = [0.0]
    monkeypatch.setattr("quito_cli.gui.page_state.time.monotonic", lambda: clock[0])
    tabs = Tabs(Wings())  # type: ignore[arg-type]
    one = tabs.come("one", "client 1")
    assert tabs.come("one", "client 2") is one  # loaded anew
    tabs.go("one", "client 1")
    clock[0] = 2 * LINGER
    tabs.sweep()
    assert left == []  # it is still looked at
    tabs.go("one", "client 2")
    clock[0] += LINGER / 2
    assert tabs.come("one", "client 3") is one
    tabs.go("one", "client 3")
    clock[0] += 2 * LINGER
    tabs.sweep()
    assert left == ["one"]
    assert tabs.come("one", "client 4") is not one


def test_a_port_that_is_taken() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(UsageError, match=f"port {port}.*leave --port out"):
            free_port("127.0.0.1", port)
    assert free_port("127.0.0.1", None) > 0
    with pytest.raises(UsageError, match=r"cannot listen on 203\.0\.113\.1"):
        free_port("203.0.113.1", None)


def test_without_the_extra_it_says_how_to_get_it(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "nicegui", None)
    assert run_command(["gui", "--no-browser"], monkeypatch) == 2
    assert 'pip install "quito[gui]"' in capsys.readouterr().err


def test_a_folder_that_is_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_command(["gui", str(tmp_path / "none"), "--no-browser"], monkeypatch) == 2
    assert "none" in capsys.readouterr().err
