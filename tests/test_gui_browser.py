"""The page in a real browser: Debian's chromium, headless. Skipped where there is none."""

from __future__ import annotations

import re
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest
from gui_browser import PATIENCE, Keys, Page, Server, browsing, needs_browser, serving
from long_solve import LONG

import quito_cli as quito
from quito_cli.gui.serve import workers

pytestmark = needs_browser
ROOT = Path(__file__).parent.parent
CART = re.search(
    r"```yaml\n(title: Move a cart.*?)```", (ROOT / "README.md").read_text(), re.DOTALL
)


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    folder = tmp_path_factory.mktemp("own")
    (folder / "mine.yaml").write_bytes((ROOT / "problems" / "van_der_pol.yaml").read_bytes())
    secret = tmp_path_factory.mktemp("elsewhere") / "secret.yaml"
    secret.write_text("title: not for the page\n")
    (folder / "link.yaml").symlink_to(secret)
    with serving(folder) as running:
        yield running


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    with browsing(tmp_path_factory.mktemp("browser")) as page:
        yield page


@pytest.fixture
def page(browser: Page, server: Server) -> Iterator[Page]:
    """The page in a tab of its own."""
    first = browser.driver.current_window_handle
    browser.open(server.address)
    yield browser
    browser.log()
    for handle in browser.driver.window_handles:
        if handle != first:
            browser.driver.switch_to.window(handle)
            browser.driver.close()
    browser.driver.switch_to.window(first)


def test_choose_and_run_aly_chan(page: Page) -> None:
    page.choose("van_der_pol")
    page.until(lambda: "Van der Pol" in page.text())
    page.choose("alychan")
    page.until(lambda: "Aly-Chan" in page.text())
    page.until(lambda: page.all(".formulas math msub"))
    page.solved()
    found = re.search(r"Solved.* cost (\S+)", page.verdict())
    assert found
    assert abs(float(found[1])) < 1e-6  # of the reference: 0
    assert "reference" in page.by(".legend").text
    page.tab("Summary")
    page.until(lambda: "re-simulated" in page.by(".q-tab-panels").text)
    page.tab("Certificate")
    page.until(lambda: "holds" in page.by(".q-tab-panels").text)


def test_a_mistake_is_seen_at_its_line(page: Page) -> None:
    text = page.text()
    line = next(i for i, each in enumerate(text.split("\n"), 1) if "x2: u" in each)
    page.type(text.replace("x2: u", "x2: u + velocity"))
    page.until(lambda: "velocity" in page.by(".remarks").text)
    assert f"Line {line}:" in page.by(".remarks").text
    page.until(lambda: "velocity" in page.by(".cm-line.line-error").text)
    page.until(lambda: page.by(".cm-line.line-error .said-error").text)  # what is wrong, beside it
    page.until(lambda: "1 error" in page.by(".edit [role=status]").text)
    page.click("#run")  # it is refused, and the text stays
    page.until(lambda: "velocity" in page.status())
    assert "x2: u + velocity" in page.text()
    page.type(text)
    page.until(lambda: page.by(".edit [role=status]").text == "no complaints")


def test_typing_is_looked_at_and_kept_by_a_reload(page: Page) -> None:
    page.by(".cm-content").click()
    page.press(Keys.HOME)
    page.press("# my own words ")
    page.until(lambda: "# my own words" in page.text())
    page.set_field("steps", "37")
    page.until(lambda: page.by(".command code").text == "quito solve alychan.yaml -N 37")
    page.driver.refresh()
    page.ready()
    assert "# my own words" in page.text()
    page.until(lambda: page.by(".command code").text == "quito solve alychan.yaml -N 37")


def test_cancel_keeps_the_iterate(page: Page) -> None:
    page.type(LONG)
    page.until(lambda: page.field("steps") == "901")
    page.run_keys()
    page.until(lambda: page.figure("iteration").isdigit() and int(page.figure("iteration")) > 2)
    assert not page.by("#run").is_enabled()
    height = page.by(".run").size["height"]
    page.press(Keys.ESCAPE)
    page.until(lambda: "best iterate so far" in page.status())
    page.until(lambda: "Not solved" in page.verdict())
    page.until(lambda: page.all("#plot path"))
    assert page.by(".run").size["height"] == height  # nothing has jumped
    page.until(lambda: page.by("#run").is_enabled())


def test_an_upload_is_solved(page: Page, tmp_path: Path) -> None:
    assert CART
    file = tmp_path / "My cart.yaml"
    file.write_text(CART[1], "utf-8")
    page.by(".upload input[type=file]").send_keys(str(file))
    page.until(lambda: "Move a cart" in page.text())
    page.until(lambda: "My_cart.yaml" in page.by(".edit .bar").text)
    page.solved()
    assert "Solved" in page.verdict()


def test_the_result_is_downloaded_and_loaded(page: Page) -> None:
    page.set_field("steps", "40")
    page.solved()
    page.push("HDF5")
    solution = quito.Solution.load(page.downloaded("alychan.h5"))
    assert solution.success
    assert solution.options["steps"] == 40
    page.push("CSV")
    head = page.downloaded("alychan.csv").read_text().splitlines()[0]
    assert {"t", "x1", "u"} <= set(re.split(r"[,;]", head))
    page.push("Report")
    assert "Aly-Chan" in page.downloaded("alychan.html").read_text("utf-8")


def test_two_tabs_do_not_disturb_each_other(page: Page, server: Server) -> None:
    one = page.driver.current_window_handle
    page.type(LONG)
    page.until(lambda: page.field("steps") == "901")
    page.click("#run")
    page.until(lambda: "unning" in page.status())
    two = page.open(server.address)
    assert "Aly-Chan" in page.text()
    assert "No result yet" in page.verdict()
    page.click("#run")
    if workers() == 1:  # else there is one for it
        page.until(lambda: "number 1 in the queue" in page.status())
    page.driver.switch_to.window(one)
    assert page.text().count("\n") == LONG.count("\n")
    page.click("#cancel")
    page.until(lambda: "best iterate so far" in page.status())
    page.driver.switch_to.window(two)
    page.until(lambda: page.verdict().startswith("Solved"))
    assert "alychan" in page.verdict()


def test_a_reload_in_the_middle_of_a_solve(page: Page) -> None:
    page.type(LONG)
    page.until(lambda: page.field("steps") == "901")
    page.click("#run")
    page.until(lambda: page.figure("iteration").isdigit())
    page.driver.refresh()
    page.ready()
    page.until(lambda: page.figure("iteration").isdigit())
    page.until(lambda: not page.by("#run").is_enabled())
    page.click("#cancel")
    page.until(lambda: "Not solved" in page.verdict())
    page.driver.refresh()  # and what was found is there after another one
    page.ready()
    page.until(lambda: "Not solved" in page.verdict())
    page.until(lambda: page.all("#plot path"))


HOSTILE = """title: "<script>window.bitten = 1</script><img src=x onerror='window.bitten = 2'>"
description: !!python/object/apply:os.system ["touch bitten"]
time: {initial: 0, final: 1}
states:
  x: {initial: 0, final: 1}
controls:
  u: {lower: -9, upper: 9}
dynamics:
  x: u
cost:
  lagrange: __import__("os").system("touch bitten")
options: {solver_options: {hsllib: /tmp/evil.so}}
"""


def test_a_hostile_file(page: Page, server: Server, tmp_path: Path) -> None:
    file = tmp_path / "..%2f..%2fevil<b>.yaml"
    file.write_text(HOSTILE)
    page.by(".upload input[type=file]").send_keys(str(file))
    page.until(lambda: "bitten" in page.text())
    page.until(lambda: "error" in page.by(".edit [role=status]").text)
    page.click("#run")
    page.until(lambda: "bad" in (page.by(".run .status").get_attribute("class") or ""))
    calm = HOSTILE.split("description", maxsplit=1)[0] + HOSTILE.split('bitten"]\n')[1]
    calm = re.sub(r"lagrange: .*", "lagrange: u^2", calm).split("options")[0]
    page.type(calm)
    page.until(lambda: "no complaints" in page.by(".edit [role=status]").text)
    page.solved()
    for name in ("Summary", "Certificate", "Runs", "Plots"):
        page.tab(name)
    assert page.run("return window.bitten === undefined")
    assert "Traceback" not in page.by("body").text
    page.until(lambda: "no complaints" in page.by(".edit [role=status]").text)
    page.type("a: &a [x]\n" + "".join(f"b{i}: &b{i} [*a, *a]\n" for i in range(20_000)))
    page.until(lambda: "error" in page.by(".edit [role=status]").text)
    assert page.by("#run").is_enabled()  # the page lives on
    assert not any(server.folder.glob("bitten"))


def test_nothing_outside_of_the_folder(page: Page) -> None:
    field = page.by(".choose .q-select input")
    field.click()

    def listed() -> list[str]:
        return [element.text for element in page.all(".q-menu .q-item")]

    page.until(lambda: any(text.startswith("mine.yaml") for text in listed()))
    assert not any("link" in text or "not for the page" in text for text in listed())
    page.press(Keys.ESCAPE)


def test_save_into_the_folder(page: Page, server: Server) -> None:
    page.type("# saved\n" + page.text())
    _save(page, "../escaped")
    page.until(lambda: "no name" in page.status())
    _save(page, "alychan.yaml")
    page.until((server.folder / "alychan.yaml").is_file)
    assert (server.folder / "alychan.yaml").read_text("utf-8").startswith("# saved")
    assert not (server.folder.parent / "escaped.yaml").exists()


def _save(page: Page, name: str) -> None:
    page.until(lambda: not page.all(".q-dialog"))
    page.push("Save")
    field = page.until(lambda: page.by(".q-dialog input"))
    page.until(field.is_displayed)
    field.send_keys(Keys.CONTROL, "a")
    field.send_keys(name)
    page.until(lambda: field.get_attribute("value") == name)
    field.send_keys(Keys.ENTER)


def test_runs_are_laid_over_one_another_and_compared(page: Page) -> None:
    page.solved()
    page.set_field("variance", "1")
    page.solved()
    page.tab("Runs")
    page.click("[aria-label='Lay run 1 over it']")
    page.tab("Plots")
    page.until(lambda: "1: alychan" in page.by(".legend").text)
    said = page.until(lambda: page.hovered("#plot", 90).partition("t = ")[2])
    for line in ("u", "u, 1: alychan", "u, reference", "x3, 1: alychan"):
        assert re.search(rf"^{line}\s+-?[\d.]+", said, re.MULTILINE), said
    page.run("quito.zoom('plot', 0.5)")
    page.until(lambda: page.run("return quito.chart().getOption().dataZoom[0].end") == 75)
    page.tab("Compare")
    page.push("With LGR collocation")
    page.until(lambda: "lgr" in page.by(".q-tab-panels").text.lower() and page.all("table caption"))
    page.until(lambda: "Compared" in page.status())
    page.until(lambda: len(page.all("#compared-plot path")) > 9)
    page.push("CSV", "[aria-label='Take away the comparison'] button")
    assert page.downloaded("alychan-compare.csv").read_text().startswith("method,")


def test_a_switching_time_is_told_in_every_plot(page: Page) -> None:
    page.choose("bang_bang")
    page.until(lambda: "Bang-bang" in page.text())
    page.solved()
    marked = page.run(
        "const chart = quito.chart(), lines = chart.getOption().series.filter(s => s.markLine);"
        "const marks = lines.map(line => line.markLine.data.map(mark => mark.name).join('|'));"
        "const at = chart.convertToPixel({xAxisIndex: 0}, lines[0].markLine.data[0].xAxis);"
        "return [marks, at, chart.getOption().grid.length]"
    )
    marks, at, plots = marked
    assert len(marks) == plots > 1
    assert set(marks) == {marks[0]}
    first = marks[0].split("|")[0]
    assert "jumps" in first
    below = " ".join(first.split())
    page.until(lambda: below in " ".join(page.hovered("#plot", 90, at).split()))
    page.until(lambda: "jumps" not in page.hovered("#plot", 90, at + 60))
    assert "switching time" in page.by(".legend").text
    page.drag("#plot", 90, at, at + 90)  # a band is what is seen from then on
    zoom = "const zoom = quito.chart().getOption().dataZoom[0]; return [zoom.start, zoom.end]"
    start, end = page.until(lambda: (seen := page.run(zoom)) != [0, 100] and seen)
    assert 0 < start < end < 100


def test_nothing_jumps_while_it_loads_and_solves(page: Page) -> None:
    page.run(
        "window.jumps = 0; new PerformanceObserver(list => list.getEntries().forEach("
        "e => { if (!e.hadRecentInput) window.jumps += e.value; }"
        ")).observe({type: 'layout-shift', buffered: true})"
    )
    page.solved()
    page.tab("Compare")
    page.push("With the reference")
    page.until(lambda: "Compared" in page.status())
    assert page.run("return window.jumps") < 0.05  # half of what is still called good


def test_everything_has_a_name(page: Page) -> None:
    page.solved()
    assert page.run("return document.documentElement.lang") == "en-GB"
    assert page.driver.title == "quito"
    assert len(page.all("main")) == len(page.all("h1")) == 1
    nameless = page.run(
        """
        const shown = e => e.checkVisibility() && !e.closest('[aria-hidden=true]');
        const named = e => e.getAttribute('aria-label') || e.title || e.innerText?.trim()
          || e.labels?.length || e.closest('label') || e.getAttribute('aria-labelledby');
        return [...document.querySelectorAll('input, textarea, select, button, [role=img],'
          + ' [role=checkbox], [role=combobox], [role=textbox]')]
          .filter(e => shown(e) && !named(e)).map(e => e.outerHTML.slice(0, 200))
        """
    )
    assert nameless == []
    twice = page.run(
        "const ids = [...document.querySelectorAll('[id]')].map(e => e.id);"
        "return ids.filter((id, i) => ids.indexOf(id) !== i)"
    )
    assert twice == []
    assert {e.get_attribute("aria-live") for e in page.all(".run .status")} == {"polite"}


def test_the_keyboard_reaches_everything(page: Page) -> None:
    page.run("document.activeElement.blur()")
    page.press(Keys.TAB)
    assert "Skip" in str(page.run("return document.activeElement.innerText"))
    page.press(Keys.ENTER)
    reached = []
    for _ in range(60):
        page.press(Keys.TAB)
        reached.append(
            page.run(
                "const e = document.activeElement;"
                "if (e === document.body) return ['', '', '', true];"
                "return [e.id, e.getAttribute('aria-label') || e.innerText || '',"
                " getComputedStyle(e).outlineStyle, !!e.closest('.q-field, .cm-editor')]"
            )
        )
        if "Report" in reached[-1][1]:
            break
    names = {each[1] for each in reached} | {each[0] for each in reached}
    assert {"run", "steps", "variance", "discretization"} <= names
    unseen = [each for each in reached if each[2] == "none" and not each[3] and each[1]]
    assert unseen == []


@pytest.mark.parametrize("width", [390, 1280])
def test_it_fits(page: Page, width: int) -> None:
    metrics = {"width": width, "height": 844, "deviceScaleFactor": 1, "mobile": False}
    page.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    try:
        page.solved()
        for name in ("Summary", "Certificate", "Compare", "Runs", "Plots"):
            page.tab(name)
            page.until(lambda: page.run("return document.documentElement.scrollWidth") <= width)
        for dark in (False, True):
            page.darken(dark)
            page.until(lambda: page.faint() == [])  # colours fade into one another
    finally:
        page.driver.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
        page.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})


def test_nothing_came_from_elsewhere(page: Page, server: Server) -> None:
    page.log()
    inner = ("data:", "blob:", "about:", "chrome:", "chrome-untrusted:")
    own = (server.address, server.address.replace("http", "ws"), *inner)
    assert len(page.requested) > 20
    assert [url for url in page.requested if not url.startswith(own)] == []
    assert page.complaints == []


def test_on_other_addresses_a_token_is_needed(browser: Page, tmp_path: Path) -> None:
    with serving(tmp_path, "--host", "0.0.0.0") as open_to_all:
        address = re.sub(r"//[^:/]+:", "//127.0.0.1:", open_to_all.address)
        plain, _, token = address.partition("?token=")
        assert len(token) > 20
        with pytest.raises(urllib.error.HTTPError, match="401"):
            urllib.request.urlopen(plain, timeout=PATIENCE)
        browser.open(address)  # its socket is let in by the cookie
        assert "Aly-Chan" in browser.text()
        assert "token" not in browser.driver.current_url
        browser.driver.get("about:blank")


def test_ctrl_c_ends_it_with_its_workers(tmp_path: Path) -> None:
    with serving(tmp_path) as running:
        begun = time.monotonic()
        while not (children := _descendants(running.process.pid)):  # workers get warm
            assert time.monotonic() - begun < PATIENCE
        assert running.stop() == 0
        stopped = time.monotonic()
        while any(map(_alive, children)):
            assert time.monotonic() - stopped < PATIENCE
            time.sleep(0.05)
        assert running.process.stdout is not None
        assert "Traceback" not in running.process.stdout.read()


def _alive(pid: int) -> bool:
    """Whether a process is there that is not only waiting to be buried."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


def _descendants(pid: int) -> set[int]:
    found: set[int] = set()
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            words = stat.read_text().rsplit(")", 1)[1].split()
        except OSError:
            continue
        if int(words[1]) == pid:
            child = int(stat.parent.name)
            found |= {child} | _descendants(child)
    return found
