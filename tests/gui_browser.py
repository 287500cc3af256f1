"""What tests of the page in a real browser share: the server, the browser, and looking at it."""

from __future__ import annotations

import json
import os
import random
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import pytest

selenium = pytest.importorskip("selenium", reason="the page's tests need selenium")

from selenium import webdriver  # noqa: E402
from selenium.common.exceptions import WebDriverException  # noqa: E402
from selenium.webdriver.chrome.service import Service  # noqa: E402
from selenium.webdriver.common.by import By  # noqa: E402
from selenium.webdriver.common.keys import Keys  # noqa: E402
from selenium.webdriver.remote.webelement import WebElement  # noqa: E402

__all__ = ["By", "Keys", "Page", "Server", "browsing", "needs_browser", "serving"]
T = TypeVar("T")
CHROMIUM, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")
_SWITCHES = (
    *("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
    *("--disable-dev-shm-usage", "--force-device-scale-factor=1", "--hide-scrollbars"),
)
PATIENCE = 60.0
"""Seconds that anything may take on a machine that has other things to do."""
_PORTS = range(20_000, 32_000)
"""Below those that systems give to connections: a browser has many, and one could be the port that
was free a moment ago."""

needs_browser = pytest.mark.skipif(
    CHROMIUM is None or DRIVER is None,
    reason="no chromium with chromedriver here: apt-get install chromium chromium-driver",
)


@dataclass
class Server:
    """A running `quito gui`."""

    process: subprocess.Popen[str]
    address: str
    folder: Path

    def stop(self) -> int:
        """Press Ctrl-C; return the exit code."""
        self.process.send_signal(signal.SIGINT)
        return self.process.wait(PATIENCE)


@contextmanager
def serving(folder: Path, *arguments: str) -> Iterator[Server]:
    """Run `quito gui FOLDER`."""
    alone = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST")}
    command = [sys.executable, "-m", "quito_cli", "gui", str(folder), "--no-browser"]
    process = subprocess.Popen(
        [*command, "--port", str(_free_port()), *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env=alone | {"OMP_NUM_THREADS": "1", "PYTHONUNBUFFERED": "1"},
        start_new_session=True,
    )
    try:
        assert process.stdout is not None
        said = process.stdout.readline()
        assert "http://" in said, said + process.stdout.read()
        yield Server(process, said.split()[4], folder)
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
            try:
                process.wait(PATIENCE)
            except subprocess.TimeoutExpired:
                process.kill()
        assert process.stdout is not None
        process.stdout.close()


def _free_port() -> int:
    for port in random.sample(_PORTS, 100):
        with socket.socket() as probe, suppress(OSError):
            probe.bind(("127.0.0.1", port))
            return port
    raise AssertionError("no port is free")


@contextmanager
def browsing(home: Path, width: int = 1280, height: int = 900) -> Iterator[Page]:
    """Run a browser; downloads land in `home`."""
    options = webdriver.ChromeOptions()
    options.binary_location = str(CHROMIUM)
    for switch in (
        *_SWITCHES,
        f"--user-data-dir={home}/profile",
        f"--window-size={width},{height}",
    ):
        options.add_argument(switch)
    options.set_capability("goog:loggingPrefs", {"performance": "ALL", "browser": "ALL"})
    downloads = {"download.default_directory": str(home), "download.prompt_for_download": False}
    options.add_experimental_option("prefs", downloads)
    driver = webdriver.Chrome(options=options, service=Service(str(DRIVER)))
    try:
        yield Page(driver, home)
    finally:
        driver.quit()


class Page:
    """The browser, and what a person does with it."""

    def __init__(self, driver: webdriver.Chrome, home: Path) -> None:
        self.driver, self.home = driver, home
        self.requested: list[str] = []
        self.complaints: list[str] = []
        """What the browser's console was told as errors."""

    def open(self, address: str) -> str:
        """Open the page in a new tab; return the tab."""
        self.driver.switch_to.new_window("tab")
        self.driver.get(address)
        self.ready()
        return self.driver.current_window_handle

    def ready(self) -> None:
        """Wait until the page can be used: there is a text that has been looked at, and a button
        to press."""
        self.until(lambda: len(self.text()) > 0)
        self.until(lambda: self.by(".edit [role=status]").text != "")
        self.until(lambda: any(self.by(name).is_enabled() for name in ("#run", "#cancel")))

    def until(self, holds: Callable[[], T]) -> T:
        """Wait for something to be true, and return it; what is not there yet is not true yet."""
        end = time.monotonic() + PATIENCE
        while True:
            try:
                if found := holds():
                    return found
            except WebDriverException:
                pass
            assert time.monotonic() < end, f"waited in vain: {self.status()}"
            time.sleep(0.03)

    def run(self, script: str, *arguments: Any) -> Any:
        return self.driver.execute_script(script, *arguments)

    def by(self, selector: str) -> WebElement:
        return self.driver.find_element(By.CSS_SELECTOR, selector)

    def all(self, selector: str) -> list[WebElement]:
        return self.driver.find_elements(By.CSS_SELECTOR, selector)

    def push(self, words: str, kind: str = "button") -> None:
        """Click the button, tab or entry of a list whose words begin so, once it can be clicked."""
        find = (
            "const [kind, words] = arguments;"
            "return [...document.querySelectorAll(kind)].find("
            "e => e.innerText.trim().startsWith(words) && e.checkVisibility() && !e.disabled)"
        )

        def pushed() -> bool:  # the page may put another one in its place meanwhile
            element = self.run(find, kind, words)
            if element is not None:
                element.click()
            return element is not None

        self.until(pushed)

    def text(self) -> str:
        """Return what is in the editor."""
        return str(self.run("return quito.text() || ''"))

    def type(self, text: str) -> None:
        """Replace the text of the editor, as if it were pasted."""
        self.run(
            "const at = document.querySelector('.edit .nicegui-codemirror').id.slice(1);"
            "const e = getElement(at).editor, to = e.state.doc.length;"
            "e.dispatch({changes: {from: 0, to, insert: arguments[0]}})",
            text,
        )

    def status(self) -> str:
        found = self.all(".run .status")
        return found[0].text if found else ""

    def verdict(self) -> str:
        return self.by(".verdict .said").text

    def field(self, label: str) -> str:
        """Return what stands in a field of the form."""
        return str(self.by(f"input[aria-label='{label}']").get_attribute("value"))

    def set_field(self, label: str, text: str) -> None:
        """Write into a field of the form."""
        field = self.by(f"input[aria-label='{label}']")
        field.send_keys(Keys.CONTROL, "a", Keys.NULL, text)
        wanted = f"-N {text}" if label == "steps" else f"--{label} {text}"
        self.until(lambda: wanted in self.by(".command code").text)

    def figure(self, name: str) -> str:
        """Return a figure of the progress."""
        return str(
            self.run(
                "const heads = [...document.querySelectorAll('.progress dt')];"
                "const head = heads.find(e => e.innerText.trim() === arguments[0]);"
                "return head?.nextElementSibling?.innerText.trim() || ''",
                name,
            )
        )

    def darken(self, dark: bool) -> None:
        """Let the system prefer dark pages, or light ones."""
        scheme = [{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}]
        self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": scheme})
        self.until(lambda: self.run("return Quasar.Dark.isActive") is dark)

    def faint(self) -> list[str]:
        """Return words whose contrast with what is behind them is less than 4.5 (WCAG AA)."""
        found: list[str] = self.run(
            """
            const rgb = c => c.match(/[\\d.]+/g).map(Number);
            const light = ([r, g, b]) => [r, g, b].map(v => v / 255)
              .map(v => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4)
              .reduce((sum, v, i) => sum + v * [0.2126, 0.7152, 0.0722][i], 0);
            const behind = e => {
              for (; e; e = e.parentElement) {
                const c = rgb(getComputedStyle(e).backgroundColor);
                if (c.length < 4 || c[3] > 0.9) return c;
              }
              return [255, 255, 255];
            };
            const words = e => [...e.childNodes].some(n => n.nodeType === 3 && n.data.trim());
            const idle = '[disabled], .disabled, .q-field--disabled, .cm-editor, svg, .q-tooltip';
            return [...document.querySelectorAll('body *')]
              .filter(e => words(e) && e.checkVisibility() && !e.closest(idle))
              .map(e => {
                const a = light(rgb(getComputedStyle(e).color)), b = light(behind(e));
                return [(Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05), e];
              })
              .filter(([ratio]) => ratio < 4.5)
              .map(([ratio, e]) => ratio.toFixed(1) + ' ' + e.outerHTML.slice(0, 120));
            """
        )
        return found

    def press(self, *keys: str) -> None:
        webdriver.ActionChains(self.driver).send_keys(*keys).perform()

    def hovered(self, selector: str, down: int, right: float | None = None) -> str:
        """Rest with the pointer on an element, so many pixels from its top and left.

        Args:
            selector: of the element.
            down: from its top.
            right: from its left; None for the middle.

        Returns:
            What the element says then; wait for it, for a plot is drawn in its own time.
        """
        element = self.by(selector)
        self.run("arguments[0].scrollIntoView()", element)
        box = self.run("return arguments[0].getBoundingClientRect().toJSON()", element)
        across = box["width"] / 2 if right is None else right
        for aside in (3, 0):  # a pointer that does not move is not heard of again
            place = {"x": box["x"] + across + aside, "y": box["y"] + down}
            self.driver.execute_cdp_cmd("Input.dispatchMouseEvent", {"type": "mouseMoved", **place})
        return element.text

    def drag(self, selector: str, down: int, start: float, end: float) -> None:
        """Draw with the pressed pointer over an element, from left to right."""
        box = self.run(
            "return document.querySelector(arguments[0]).getBoundingClientRect().toJSON()", selector
        )
        place = {"y": box["y"] + down, "button": "left", "clickCount": 1}
        for kind, right in (
            ("mousePressed", start),
            ("mouseMoved", (start + end) / 2),
            ("mouseMoved", end),
            ("mouseReleased", end),
        ):
            said = {"type": kind, "x": box["x"] + right, "buttons": 1, **place}
            self.driver.execute_cdp_cmd("Input.dispatchMouseEvent", said)

    def run_keys(self) -> None:
        """Press Ctrl+Enter."""
        chain = webdriver.ActionChains(self.driver)
        chain.key_down(Keys.CONTROL).send_keys(Keys.ENTER).key_up(Keys.CONTROL).perform()

    def click(self, selector: str) -> None:
        """Click an element once it can be clicked."""

        def clicked() -> bool:
            element = self.by(selector)
            if enabled := element.is_enabled():
                element.click()
            return enabled

        self.until(clicked)

    def tab(self, name: str) -> None:
        """Go to a tab of the results, and wait until it is seen."""
        self.push(name, ".q-tab")
        self.until(lambda: self.by(".q-tab--active").text.strip() == name)
        self.until(lambda: any(panel.is_displayed() for panel in self.all(".q-tab-panel")))

    def solved(self) -> None:
        """Run, and wait for the plot of a new answer."""
        before = self.run("return document.querySelector('#plot')?.dataset.chart")
        self.click("#run")
        self.until(
            lambda: self.run(
                "const p = document.querySelector('#plot'), drawn = p?.querySelectorAll('path');"
                "return p && p.dataset.chart !== arguments[0] && drawn.length > 9",
                before,
            )
        )

    def choose(self, problem: str) -> None:
        """Choose a problem of the list by its name."""
        field = self.by(".choose .q-select input")
        field.click()
        field.send_keys(problem)
        self.push(problem, ".q-menu .q-item")

    def downloaded(self, name: str) -> Path:
        """Wait for a download to be whole."""
        path = self.home / name
        self.until(lambda: path.is_file() and path.stat().st_size > 0)
        self.until(lambda: not any(self.home.glob("*.crdownload")))
        return path

    def log(self) -> None:
        """Take note of what was asked for over the network, and of what the console says."""
        for entry in self._log("performance"):
            message = json.loads(entry["message"])["message"]
            if message["method"] == "Network.requestWillBeSent":
                self.requested.append(message["params"]["request"]["url"])
            if message["method"] == "Network.webSocketCreated":
                self.requested.append(message["params"]["url"])
        self.complaints += [
            entry["message"] for entry in self._log("browser") if entry["level"] == "SEVERE"
        ]

    def _log(self, kind: str) -> list[dict[str, Any]]:
        found: list[dict[str, Any]] = self.driver.get_log(kind)  # type: ignore[no-untyped-call]
        return found
