"""Long stories in a real browser: the demonstration's hidden effect, and an operator's lot with a fault, from two stations."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from browser import ROOT, Tab, served, tab, until
from served_station import FAST, modbus_station, short_recipe_file, station_file
from served_station import served as served_station
from small_station import lot_of

from stations.safety.folder import read_log

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]


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
    command = [sys.executable, "-m", "pipelines.cli", "demo", "cubic_transfer", "--seed", "1", "--by-hand"]
    subprocess.run([*command, "--folder", str(folder)], cwd=ROOT, check=True, capture_output=True, timeout=280)
    with served(tmp_path / "archive", folder) as server, tab(browser, server.address) as one:
        one.open("/missing")
        one.page.select_option("select[name=source]", str(folder / "dwells.parquet"))
        one.sees(".verdict")
        assert "; missing: third_order" in one.page.inner_text(".verdict")
        order = one.page.evaluate(
            """() => [".verdict", "[data-name=effect-0]", "[data-add]", ".command"].map(
                (s) => document.querySelector(s).getBoundingClientRect().top)"""
        )
        assert order == sorted(order)
        one.press("text=as the fresh measurement")
        one.sees("[data-version='1']")
        assert one.page.locator("a[data-add=third_order]").first.inner_text() == "Add third_order"
        one.shot(pictures, "workbench-before", tall=1340)
        one.press("[data-add='third_order']")
        one.sees("[data-version='2']")
        one.ready()
        assert one.page.inner_text(".verdict").startswith("ADEQUATE")
        one.shot(pictures, "workbench-after", tall=1440)
        fresh = [float(one.page.get_attribute(f"[data-version='{k}']", "data-fresh") or "nan") for k in (1, 2)]
        assert fresh[1] < 0.6 * fresh[0]
        assert "confirmed" in one.page.inner_text("#errors")
        assert one.findings() == []
        one.page.fill("input[name=name]", "line-1")
        one.page.fill("input[name=why]", "the fresh run confirms it")
        one.press("text=Save >> nth=-1")
        one.sees(".done:not([hidden])")
        saved = (folder / "models" / "line-1.toml").read_text()
        assert "third_order" in saved
        assert "the fresh run confirms it" in saved
        one.press("[data-undo]")
        until(lambda: "; missing: third_order" in one.page.inner_text(".verdict"), "the effect is out of the model")
        one.page.go_back()
        until(lambda: one.page.inner_text(".verdict").startswith("ADEQUATE"), "the way back leads to the model with it")
        assert one.outside == [] == one.errors


def begun(one: Tab, recipe: str | Path, *serials: str) -> None:
    """A lot that is started on the page of the operator, and asks for its units."""
    one.page.select_option("select[name=recipe]", str(recipe))
    for slot, serial in enumerate(serials):
        one.page.fill(f"#slot-{slot}", serial)
        one.page.press(f"#slot-{slot}", "Enter")
    one.press("text=Start the lot")
    one.sees(".question")


def test_a_station_like_hardware_is_paused_safely_and_goes_on_beside_a_second_station(
    tmp_path: Path, browser: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TUMBLELINE_STATE", str(tmp_path / "state"))
    folder = tmp_path / "bench"
    folder.mkdir()
    recipe = short_recipe_file(folder)
    with served_station(lot_of(2)) as port:
        config = modbus_station(port, limits=FAST)
        hardware = station_file(tmp_path, config)
        with served(tmp_path / "archive", folder, hardware, ROOT / "stations" / "simulated.toml") as server:
            with tab(browser, server.address) as one:
                one.open("/operator")
                assert one.page.locator(".tabs a").count() == 2
                # faults for practice are for simulated stations
                assert one.page.locator("input[name=fault]").count() == 0
                begun(one, recipe, "U000", "U001")
                one.press("[data-answer='go']")
                until(lambda: len(list(tmp_path.glob("archive/captures/*/[0-9]*/record.json"))) >= 2, "two records")
                one.press("text=Pause")
                one.sees("[data-phase=paused]")
                assert read_log(tmp_path / "state")[-1]["event"] == "left_safe"
                one.press(".tabs a >> nth=1")
                until(lambda: "station=simulated" in one.href, "the second station")
                begun(one, recipe, "B1")
                one.shot(tmp_path, "two-stations")
            kept = {path: path.read_bytes() for path in tmp_path.glob("archive/captures/*/[0-9]*/record.json")}
            server.end()  # a paused lot does not need the server
            server.begin()
            with tab(browser, server.address) as again:  # the browser was closed, and is opened again
                again.open("/operator")
                again.sees("[data-phase=paused]")
                again.press("text=Continue this lot")  # the units are seated: it goes on without a question
                until(
                    lambda: "remove the units" in again.page.inner_text("main"),
                    "the results are there before unloading",
                )
                assert {path: path.read_bytes() for path in kept} == kept
                assert again.page.locator(".tabs a").nth(1).inner_text().endswith("Your turn")
                assert again.errors == [] == again.outside
                again.press("[data-answer='go']")
                again.sees("[data-phase=done]")
                again.open("/operator?station=simulated")
                again.press("[data-answer='stop']")
                again.sees("[data-phase=stopped]")
