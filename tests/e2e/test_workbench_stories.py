"""Long stories in a real browser: a hidden effect, a lot on a station like hardware, and both by keyboard alone."""

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import ROOT, Served, Tab, served, tab, until
from capture_double import recipe_file
from lots import lot
from served_station import FAST, modbus_station, short_recipe_file, station_file
from served_station import served as served_station
from small_station import lot_of

from benchmarks.generated_archive import write_archive
from stations.safety.folder import read_log

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]


def test_the_demonstration_from_its_measurement_to_the_error_falling(tmp_path: Path, browser: Any) -> None:
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
        one.press("[data-add='third_order']")
        one.sees("[data-version='2']")
        one.ready()
        assert one.page.inner_text(".verdict").startswith("ADEQUATE")
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


SIZES = {"screen": (1440, 900), "phone": (390, 844)}
MOST_KEYS = 250
FOCUS = """() => {
    const e = document.activeElement, r = e.getBoundingClientRect(), s = getComputedStyle(e);
    const x = Math.min(Math.max(r.left + Math.min(r.width / 2, 40), 1), innerWidth - 1);
    const y = Math.min(Math.max((Math.max(r.top, 0) + Math.min(r.bottom, innerHeight)) / 2, 1), innerHeight - 1);
    const top = document.elementFromPoint(x, y);
    const drawn = s.outlineStyle !== "none" && parseFloat(s.outlineWidth) >= 2;
    const inside = r.bottom > 0 && r.top < innerHeight && r.right > 0 && r.left < innerWidth && r.width > 0 && r.height > 0;
    return { html: e.outerHTML.slice(0, 120), body: e === document.body, outline: drawn, inside, order: e.tabIndex,
             covered: inside && !(e.contains(top) || top?.contains(e) || e.labels?.[0]?.contains(top)) };
}"""


@pytest.fixture(
    params=[(size, dark) for size in SIZES for dark in (False, True)],
    ids=lambda p: f"{p[0]}-{'dark' if p[1] else 'light'}",
)
def look(request: pytest.FixtureRequest) -> dict[str, Any]:
    size, dark = request.param
    return {"size": SIZES[size], "dark": dark}


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """A workbench with the calibrations of two years, a recipe, and nothing uploaded."""
    top = tmp_path_factory.mktemp("keyboard")
    write_archive(top / "archive", 16, years=2.0, seed=7, workers=1)
    (top / "bench").mkdir()
    recipe_file(top / "bench")
    with served(top / "archive", top / "bench") as one:
        yield one


def is_seen(now: dict[str, Any]) -> bool:
    """Whether the place with the focus has an outline, lies in the window, under nothing else, in the order of the page."""
    return now["body"] or (now["outline"] and now["inside"] and not now["covered"] and now["order"] <= 0)


def to(one: Tab, selector: str, key: str = "Tab") -> None:
    """Press Tab until a place has the focus; on the way everything that has it is seen and in the order of the page."""
    for _ in range(MOST_KEYS):
        one.page.keyboard.press(key)
        until(lambda: is_seen(one.page.evaluate(FOCUS)), f"what has the focus is seen: {one.page.evaluate(FOCUS)}", 3.0)
        if one.page.evaluate("(s) => document.activeElement.matches(s)", selector):
            return
    raise AssertionError(f"{MOST_KEYS} keys do not lead to {selector} on {one.href}")


def enter(one: Tab, selector: str) -> None:
    to(one, selector)
    one.page.keyboard.press("Enter")


def seen(one: Tab, selector: str) -> None:
    one.sees(selector)
    one.ready()


def test_a_file_is_uploaded_diagnosed_and_its_effect_added(
    bench: Served, browser: Any, look: dict[str, Any], tmp_path: Path
) -> None:
    dwells = lot(np.random.default_rng(5), units=2, temperatures=(25.0,), hidden=lambda force, *_: 2e-4 * force**3)
    dwells.to_parquet(tmp_path / "cubic.parquet")
    with tab(browser, bench.address, **look) as one:
        choosers: list[Any] = []

        def kept(chooser: Any) -> None:
            choosers.append(chooser)

        one.page.on("filechooser", kept)  # before the key: a dialog that nobody listens for is closed at once
        one.open("/upload")
        to(one, "[data-drop]")
        one.page.keyboard.press("Space")
        until(lambda: one.page.evaluate("() => 1") and choosers, "the files can be chosen")
        choosers[0].set_files(str(tmp_path / "cubic.parquet"))
        seen(one, "a.button.main[href^='/missing']")
        enter(one, "a.button.main[href^='/missing']")
        seen(one, ".verdict")
        assert "third_order" in one.page.inner_text(".verdict")
        enter(one, "[data-add=third_order]")
        until(lambda: one.page.inner_text(".verdict").startswith("ADEQUATE"), "the model with the effect is judged")
        one.ready()
        to(one, "[data-name='effect-0']")
        one.page.keyboard.press("ArrowRight")
        until(lambda: one.page.locator("[data-name='effect-0'] .hovertext").count() > 0, "the point says what it is")
        one.page.keyboard.press("Escape")
        until(lambda: one.page.locator("[data-name='effect-0'] .hovertext").count() == 0, "Escape lets it go")
        to(one, "select[name=against]")
        before = one.page.evaluate("() => document.activeElement.selectedIndex")
        one.page.keyboard.press("ArrowDown")
        until(lambda: "against=" in one.href, "the quantity is in the address")
        one.ready()
        assert one.page.evaluate("() => document.activeElement.name") == "against"  # the next key goes on from here
        assert one.page.evaluate("() => document.activeElement.selectedIndex") == before + 1
        enter(one, "[data-undo] + a, [data-undo] ~ a")
        seen(one, "[data-changes]")
        to(one, "[aria-label='Coefficients that differ']")
        to(one, "[aria-label='Verdicts']", "Shift+Tab")  # and back: nothing traps the keys
        assert one.findings() == []
        assert one.errors == [] == one.outside


def test_tab_leads_to_what_an_operator_and_an_auditor_press(bench: Served, browser: Any, look: dict[str, Any]) -> None:
    with tab(browser, bench.address, **look) as one:
        one.open("/operator")
        assert one.page.evaluate("() => document.activeElement.id") == "slot-0"
        to(one, "select[name=recipe]", "Shift+Tab")
        to(one, "form[data-scan] button.main")
        one.open("/audit")
        enter(one, "[data-finding]:has(a[href^='/run']) > summary")
        enter(one, "[data-finding][open] a[href^='/run']")
        until(lambda: "/run?" in one.href, "the run of the finding is shown")
        assert one.errors == [] == one.outside
