"""A workbench in a process of its own, and Debian's chromium opposite; playwright drives it and downloads nothing."""

import gzip
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[1]
AXE = ROOT / "tests" / "data" / "axe" / "axe-core-4.14.1.min.js.gz"
TOKEN = "token.of-the-tests_4Qx7"
NOBODY = "127.0.0.1:9"
"""A proxy that is not there, for all addresses but those of this machine."""
PATIENCE_S = float(os.environ.get("TUMBLELINE_PATIENCE_S", "120"))
READY = """() => Boolean(document.body.dataset.ready) && !document.querySelector('.work progress')
    && [...document.querySelectorAll('[data-figure]')].every((e) => {
        const r = e.getBoundingClientRect();
        return !e.checkVisibility() || r.top > innerHeight + 150 || r.bottom < -150
            || e.dataset.drawn === e.dataset.figure || e.querySelector('p.note'); })"""

WAITING = """async () => JSON.stringify({state: document.readyState, ready: document.body.dataset.ready ?? null,
    progress: document.querySelector('.work progress')?.closest('.work').innerText ?? null,
    jobs: await Promise.all([...document.querySelectorAll('[data-job]')].map(
        async (e) => `${e.dataset.job}: ${await (await fetch('/jobs/' + e.dataset.job)).text()}`)),
    places: [...document.querySelectorAll('[data-job-kind]')].map((e) => ({...e.dataset})),
    undrawn: [...document.querySelectorAll('[data-figure]')].filter((e) => e.dataset.drawn !== e.dataset.figure)
        .map((e) => e.dataset.figure)})"""
"""What a page that is not ready waits for."""


@dataclass
class Served:
    """A workbench that listens; ``kill`` and ``begin`` end it and start it on the same port."""

    archive: Path
    folder: Path
    stations: tuple[Path, ...] = ()
    port: int = 0
    process: subprocess.Popen[str] | None = None

    def begin(self) -> None:
        command = [sys.executable, "-m", "pipelines.cli", "workbench", str(self.archive), "--folder", str(self.folder)]
        command += ["--port", str(self.port), *(word for one in self.stations for word in ("--station", str(one)))]
        own = {
            "OMP_NUM_THREADS": "1",
            "OPENBLAS_NUM_THREADS": "1",
            "TUMBLELINE_WORKBENCH_TOKEN": TOKEN,
            "PYTHONPATH": str(ROOT),
        }
        with (self.folder.parent / "workbench.log").open("ab") as log:
            self.process = subprocess.Popen(
                command, stdout=subprocess.PIPE, stderr=log, text=True, cwd=ROOT, env=os.environ | own
            )
        line = self.process.stdout.readline()
        assert line.startswith("http://127.0.0.1:"), (self.folder.parent / "workbench.log").read_text()
        self.port = int(line.split(":")[2].split("/")[0])
        until(self.answers, "the workbench answers")

    def answers(self) -> bool:
        import httpx

        try:
            return httpx.get(f"{self.address}/upload").status_code == 200
        except httpx.TransportError:
            return False

    def end(self, number: int = signal.SIGTERM) -> None:
        if self.process is not None:
            self.process.send_signal(number)
            self.process.wait(60)
            self.process.stdout.close()
            self.process = None

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self.port}"


def until(true: Any, what: str, patience_s: float = PATIENCE_S) -> None:
    end = time.monotonic() + patience_s
    while not true():
        assert time.monotonic() < end, f"not within {patience_s:g} s: {what}"
        time.sleep(0.1)


@contextmanager
def served(archive: Path, folder: Path, *stations: Path) -> Iterator[Served]:
    folder.mkdir(parents=True, exist_ok=True)
    one = Served(archive, folder, stations)
    one.begin()
    try:
        yield one
    finally:
        one.end()
        for state in folder.glob("lots/*/state.json"):  # the process of a lot that asks for a hand outlives the server
            number = json.loads(state.read_text(encoding="utf-8")).get("pid", 0)
            with suppress(OSError):
                if number and str(folder) in Path(f"/proc/{number}/cmdline").read_text(encoding="utf-8"):
                    os.kill(number, signal.SIGKILL)


@dataclass
class Tab:
    """A page of the browser, what it asked for outside, and what went wrong in it."""

    page: Any
    address: str
    outside: list[str] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)

    def open(self, path: str) -> None:
        self.page.goto(self.address + path)
        self.ready()

    def ready(self) -> None:
        try:
            until(lambda: self.page.evaluate(READY), f"{self.page.url} is drawn")
        except AssertionError as late:
            late.add_note(f"{self.page.evaluate(WAITING)}; errors: {self.errors}")
            raise

    @property
    def href(self) -> str:
        """The address as the page has it; ``page.url`` is told of later."""
        return str(self.page.evaluate("() => location.href"))

    def press(self, selector: str) -> None:
        self.page.locator(selector).first.click()

    def sees(self, selector: str) -> None:
        until(lambda: self.page.locator(selector).count() > 0, f"{selector} on {self.page.url}")

    def click_point(self, figure: str, trace: int, point: int) -> None:
        """Click a point of a figure, as a hand does: move beside it first."""
        place = self.page.evaluate(
            """([name, trace, point]) => { const e = document.querySelector(`[data-name="${name}"]`);
            e.scrollIntoView({ block: "center" });
            const d = e._fullData[trace], of = (a) => e._fullLayout[a[0] + "axis" + a.slice(1)], x = of(d.xaxis), y = of(d.yaxis);
            const r = e.getBoundingClientRect();
            return [r.left + x._offset + x.l2p(d.x[point]), r.top + y._offset + y.l2p(d.y[point])]; }""",
            [figure, trace, point],
        )
        pointed = self.page.locator(f'[data-name="{figure}"] .hoverlayer .hovertext')

        def found() -> bool:
            self.page.mouse.move(place[0] - 3, place[1])
            self.page.mouse.move(*place)
            time.sleep(0.25)
            return pointed.count() > 0

        until(found, f"point {point} of {figure} is pointed at")
        self.page.mouse.down()
        self.page.mouse.up()

    def findings(self) -> list[str]:
        """What axe-core finds serious or critical."""
        self.page.evaluate(gzip.decompress(AXE.read_bytes()).decode())
        violations = self.page.evaluate(
            "async () => (await axe.run(document, { resultTypes: ['violations'] })).violations"
        )
        return [
            f"{one['id']}: {one['help']}: {one['nodes'][0]['html'][:160]}"
            for one in violations
            if one["impact"] in {"serious", "critical"}
        ]


@contextmanager
def chromium() -> Iterator[Any]:
    """The browser; the test is skipped where there is none."""
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    program = shutil.which("chromium")
    if program is None:
        pytest.skip("no chromium; install Debian's package of that name")
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=program,
            headless=True,
            args=["--no-sandbox", "--disable-dev-shm-usage", "--disable-gpu", f"--proxy-server={NOBODY}"],
        )
        try:
            yield browser
        finally:
            browser.close()


@contextmanager
def tab(
    browser: Any, address: str, *, token: bool = True, dark: bool = False, size: tuple[int, int] = (1280, 720)
) -> Iterator[Tab]:
    """A tab that may reach nothing but the workbench."""
    context = browser.new_context(
        viewport={"width": size[0], "height": size[1]}, color_scheme="dark" if dark else "light"
    )
    page = context.new_page()
    one = Tab(page, address)
    own = (address, "data:", "blob:")
    # told and not intercepted: a browser whose requests are intercepted has no cache, and compiles the charts for every page
    context.on("request", lambda asked: None if asked.url.startswith(own) else one.outside.append(asked.url))
    page.on("pageerror", lambda problem: one.errors.append(str(problem)))
    page.on("console", lambda said: one.errors.append(said.text) if said.type == "error" else None)
    if token:
        page.goto(f"{address}/?token={TOKEN}")
    try:
        yield one
    finally:
        context.close()
