"""Long stories in a real browser: the demonstration's hidden effect, and an operator's lot with a fault, from two stations."""

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from browser import ROOT, chromium, served, tab, until
from capture_double import recipe_file, small_run

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with chromium() as found:
        yield found


@pytest.fixture
def pictures(tmp_path: Path) -> Path:
    """Where the pictures of docs/how-to/workbench.md are made: TUMBLELINE_PICTURES, else the test's own folder."""
    folder = Path(os.environ.get("TUMBLELINE_PICTURES") or tmp_path / "pictures")
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def test_the_demonstration_from_its_measurement_to_the_error_falling(
    tmp_path: Path, browser: Any, pictures: Path
) -> None:
    folder = tmp_path / "bench"
    command = [sys.executable, "-m", "pipelines.cli", "demo", "--effect", "cubic_transfer", "--seed", "1", "--by-hand"]
    subprocess.run([*command, "--folder", str(folder)], cwd=ROOT, check=True, capture_output=True, timeout=280)
    with served(tmp_path / "archive", folder) as server, tab(browser, server.address) as one:
        one.open("/missing")
        one.page.select_option("select[name=source]", str(folder / "dwells.parquet"))
        one.sees(".verdict")
        assert "Missing: third_order" in one.page.inner_text(".verdict")
        one.press("text=as the fresh measurement")
        one.sees("[data-version='1']")
        one.shot(pictures, "workbench-before", tall=1180)
        one.press("[data-add='third_order']")
        one.sees("[data-version='2']")
        one.ready()
        assert "Adequate" in one.page.inner_text(".verdict")
        one.shot(pictures, "workbench-after", tall=1440)
        fresh = [float(one.page.get_attribute(f"[data-version='{k}']", "data-fresh") or "nan") for k in (1, 2)]
        assert fresh[1] < 0.6 * fresh[0]
        assert "confirmed" in one.page.inner_text("#errors")
        assert one.outside == [] == one.errors


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("size", [(1280, 720), (820, 1180)], ids=["screen", "tablet"])
def test_every_page_can_be_read_in_both_themes_and_on_a_tablet(
    tmp_path: Path, browser: Any, theme: str, size: tuple[int, int]
) -> None:
    small_run(tmp_path)
    pages = ("/units", "/run", "/unit", "/missing?source=latest", "/upload", "/operator", "/plan", "/station", "/audit")
    with (
        served(tmp_path / "archive", tmp_path / "bench") as server,
        tab(browser, server.address, dark=theme == "dark", size=size) as one,
    ):
        for number, path in enumerate(pages):
            one.open(path)
            assert one.findings() == [], path
            wide = one.page.evaluate("() => document.documentElement.scrollWidth - innerWidth")
            assert wide <= 0, f"{path} is {wide} px wider than the screen"
            one.shot(tmp_path, f"page-{number}", width=size[0], height=size[1])
        assert one.outside == [] == one.errors


def test_a_lot_with_an_open_door_is_measured_from_two_browsers(tmp_path: Path, browser: Any) -> None:
    folder = tmp_path / "bench"
    folder.mkdir()
    recipe = recipe_file(folder)
    with (
        served(tmp_path / "archive", folder) as server,
        tab(browser, server.address) as one,
        tab(browser, server.address) as two,
    ):
        one.open("/operator")
        one.page.select_option("select[name=recipe]", recipe)
        one.page.fill("input[name=fault]", "door:at_s=300")
        for slot, serial in enumerate(("A1", "A2", "A" * 64)):
            one.page.fill(f"#slot-{slot}", serial)
            one.page.press(f"#slot-{slot}", "Enter")
        one.press("text=Start the lot")
        one.sees("[data-answer='go']")
        assert "seat the units" in one.page.inner_text(".question")
        two.open("/operator")
        two.sees("[data-answer='go']")
        stale = two.page.evaluate(
            """async () => { const b = document.querySelector("[data-answer=go]");
            const send = () => fetch(b.dataset.act, { method: "POST", headers: { "content-type": "application/json" },
                body: JSON.stringify({ number: b.dataset.number, answer: "go" }) });
            return [(await send()).status, (await send()).status]; }"""
        )
        assert stale == [200, 409]
        until(lambda: "door" in one.page.inner_text("main"), "the open door is told in words")
        assert one.findings() == []
        until(
            lambda: one.page.locator("[data-phase=asks], [data-phase=stopped], [data-phase=failed]").count(),
            "it needs a hand",
        )
        one.shot(tmp_path, "fault")
        server.end()  # the lot's process does not need the server
        server.begin()
        two.open("/operator")
        assert "door" in two.page.inner_text("main")
        assert two.page.locator(".tile").count() >= 3


def test_a_lot_without_a_fault_ends_with_its_results_before_unloading(tmp_path: Path, browser: Any) -> None:
    folder = tmp_path / "bench"
    folder.mkdir()
    recipe_file(folder)
    with served(tmp_path / "archive", folder) as server, tab(browser, server.address) as one:
        one.open("/operator")
        one.page.select_option("select[name=recipe]", str(folder / "small.toml"))
        one.page.fill("#slot-0", "A1")
        one.page.fill("#slot-1", "A2")
        one.press("text=Start the lot")
        one.sees(".question")
        one.press("[data-answer='go']")
        until(lambda: "remove the units" in one.page.inner_text("main"), "the results are there before unloading")
        assert one.page.locator(".tile.pass, .tile.fail, .tile.refused").count() == 2
        one.shot(tmp_path, "unload")
        one.press("[data-answer='go']")
        one.sees("[data-phase='done']")
        one.press("text=Run")
        until(lambda: one.page.locator("h1").inner_text().startswith("small-"), "the run is shown")
        assert one.outside == [] == one.errors
