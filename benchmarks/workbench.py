"""The workbench on a large lot: time of a page, of a click, of a search, and memory.

    python benchmarks/workbench.py [--units 200] [--dwells 300] [--calibrations 10000] [--archive DIR] [--lots 10000]

One run with that many units and dwells is written to an archive in a temporary folder, opened in headless chromium beside its
own server. The search is timed over runs of eight units each, or over an archive of ``generated_archive.py``, which ``--lots``
makes. Ten browsers open the unit at once. Times are medians, with the worst in brackets; the load of the machine is printed
with them.
"""

from __future__ import annotations

import argparse
import os
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pandas as pd

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]


from browser import Served, chromium, served, tab, until  # noqa: E402

from benchmarks.archive import prepared  # noqa: E402
from inertial import poses  # noqa: E402
from inertial.frames import force_from_angles  # noqa: E402
from pipelines.archive import Archive  # noqa: E402

EFFECTS = ["bias", "scale", "misalignment", "bias_temperature", "scale_temperature"]
CLICKS = 8
BROWSERS = 10
WATCH = """() => {
  window.began = 0;
  window.took = 0;
  document.addEventListener("pointerdown", () => { window.began = performance.now(); }, { once: true, capture: true });
  const look = () => {
    const shown = document.querySelector("[data-name=samples][data-drawn]");
    if (window.began && shown) window.took = performance.now() - window.began; else requestAnimationFrame(look);
  };
  look();
}"""


def tables(units: list[str], dwells: int, seed: int) -> dict[str, pd.DataFrame]:
    """Dwells, residuals, coefficients and grades of a lot: numbers that look like those of a run."""
    rng = np.random.default_rng(seed)
    angles = poses.plan("fibonacci24")[np.arange(dwells) % 24]
    force = force_from_angles(*np.radians(angles).T)
    count = len(units) * dwells
    unit, dwell = np.repeat(units, dwells), np.tile(np.arange(dwells), len(units))
    heat = np.tile(np.repeat([-10.0, 25.0, 60.0], -(-dwells // 3))[:dwells], len(units)) + 0.05 * rng.normal(size=count)
    pose = np.array([f"p{k % 24:02d}" for k in range(dwells)])[dwell]
    own = {"unit": unit, "dwell": dwell, "record": dwell, "pose": pose, "kind": "dwell", "out_unit": "g"}
    main = pd.DataFrame({**own, "slot": 0, "soak": 0, "time_s": 30.0 * dwell, "unit_C": heat, "n": 100})
    noise = 1e-4 * rng.normal(size=(count, 3))
    for k, axis in enumerate("xyz"):
        main[f"out_{axis}"], main[f"sd_{axis}"], main[f"force_{axis}"] = (
            force[dwell, k] + noise[:, k],
            1e-3,
            force[dwell, k],
        )
    parts = [
        pd.DataFrame({
            "unit": unit, "dwell": dwell, "axis": axis, "pose": pose, "force_g": force[dwell, k], "unit_C": heat,
            "residual_ug": 1e6 * noise[:, k], "standard_error_ug": 100.0, "expected_ug": 10.0,
        })
        for k, axis in enumerate("xyz")
    ]  # fmt: skip
    names = [(effect, axis) for effect in EFFECTS for axis in "xyz"]
    values = pd.DataFrame([[u, axis, effect, "K", rng.normal(), 1e-4, "g"] for u in units for effect, axis in names],
        columns=["unit", "axis", "effect", "name", "value", "standard_error", "unit_text"])  # fmt: skip
    outcome = np.where(rng.random(len(units)) < 0.95, "pass", "fail")
    grades = pd.DataFrame(
        {"unit": units, "slot": range(len(units)), "outcome": outcome, "grade": "consumer", "reasons": "", "rule": ""}
    )
    time = np.arange(1000) / 100.0
    samples = [
        pd.DataFrame({"unit": units[0], "slot": 0, "record": k, "kind": "dwell", "time_s": 30.0 * k + time})
        for k in range(dwells)
    ]
    raw = pd.concat(samples, ignore_index=True).assign(**{axis: rng.normal(size=1000 * len(samples)) for axis in "xyz"})
    return {
        "samples": raw,
        "dwells": main,
        "residuals": pd.concat(parts, ignore_index=True),
        "coefficients": values,
        "grades": grades,
    }


def write(archive: Archive, number: int, units: list[str], made: dict[str, pd.DataFrame]) -> str:
    """A run of the archive with these tables."""
    lot = {"device": "ADXL355", "units": [{"serial": unit, "slot": k} for k, unit in enumerate(units)], "seed": number}
    about = {"recipe": {"name": "bench", "effects": EFFECTS}, "lot": lot, "station": {"name": f"line-{number % 3}"}}
    run = archive.open_run("bench", about, {"number": number})
    for stage, names in (
        ("reduce", ("dwells",)),
        ("fit", ("residuals", "coefficients", "samples")),
        ("grade", ("grades",)),
    ):
        run.save(stage, f"key-{number}-{stage}", {name: made[name] for name in names if name in made}, {"inputs": {}})
    run.seal()
    return run.id


def timed(work: Any, times: int) -> tuple[float, float]:
    """Median and worst of some seconds."""
    seconds = []
    for number in range(times):
        start = time.perf_counter()
        work(number)
        seconds.append(time.perf_counter() - start)
    return statistics.median(seconds), max(seconds)


def memory_mb(server: Served) -> float:
    """Resident memory of the server without its working processes, MB."""
    status = Path(f"/proc/{server.process.pid}/status").read_text(encoding="utf-8")
    return int(next(line for line in status.splitlines() if line.startswith("VmRSS")).split()[1]) / 1024.0


def processor_s(server: Served) -> float:
    """Processor time of the server so far, s."""
    words = Path(f"/proc/{server.process.pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")


def at_once(browser: Any, server: Served, path: str, count: int) -> float:
    """Seconds until so many browsers, told at once, have drawn a page."""
    with ExitStack() as open_ones:
        tabs = [open_ones.enter_context(tab(browser, server.address)) for _ in range(count)]
        start = time.perf_counter()
        for one in tabs:
            one.page.goto(server.address + path, wait_until="commit")
        for one in tabs:
            one.ready()
        return time.perf_counter() - start


def measure(server: Served, units: list[str], run: str, known: Callable[[int], str]) -> None:
    """Open, click and search; print what it took."""
    with chromium() as browser, tab(browser, server.address) as one:
        one.open(f"/unit?run={run}&unit={units[0]}")

        def opened(number: int) -> None:
            one.open(f"/unit?run={run}&unit={units[number + 1]}")

        page = timed(opened, 6)
        one.open(f"/unit?run={run}&unit={units[0]}")
        clicks = []
        for number in range(CLICKS):
            one.page.evaluate(WATCH)
            one.click_point("residuals", 0, 20 + 7 * number)
            until(lambda: one.page.evaluate("() => window.took"), "the samples are drawn")
            clicks.append(one.page.evaluate("() => window.took"))
            one.page.goto(one.page.url.split("&dwell")[0])
            one.ready()
        before = processor_s(server)
        search = timed(lambda number: one.open(f"/units?search={known(number)}"), 6)
        searching = (processor_s(server) - before) / 6
        answer = timed(lambda number: httpx.get(f"{server.address}/units?search={known(number)}", timeout=60.0), 6)
        rows = one.page.locator("[aria-label=Calibrations] tbody tr").count()
        together = at_once(browser, server, f"/unit?run={run}&unit={units[0]}", BROWSERS)
        print(f"page of a unit, drawn       {page[0]:.2f} s ({page[1]:.2f})")
        print(f"click to its dwell          {statistics.median(clicks):.0f} ms ({max(clicks):.0f})")
        print(f"search, page drawn          {search[0]:.2f} s ({search[1]:.2f}); {rows} rows")
        print(f"search, answer of the server {answer[0]:.2f} s ({answer[1]:.2f}); {searching:.2f} s of its processor")
        print(f"{BROWSERS} browsers at once, all drawn {together:.1f} s")
        print(f"memory of the server        {memory_mb(server):.0f} MB")
        if one.outside or one.errors:
            print(f"asked for outside: {one.outside}; errors: {one.errors}")


def main() -> None:
    """Write, serve, measure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--units", type=int, default=200)
    parser.add_argument("--dwells", type=int, default=300)
    parser.add_argument("--calibrations", type=int, default=2000, help="in further runs of eight, for the search")
    parser.add_argument(
        "--archive", type=Path, default=None, help="an archive to search in; the big run is added to it"
    )
    parser.add_argument(
        "--lots", type=int, default=0, help="search in an archive of so many lots of ten units, made in --archive"
    )
    given = parser.parse_args()
    if given.lots and not given.archive:
        parser.error("--lots needs --archive, the folder in which the archive is made or was made before")
    if given.lots:
        prepared(given.lots, given.archive, 2)
    with tempfile.TemporaryDirectory() as folder:
        place = given.archive or Path(folder) / "archive"
        archive = Archive(str(place))
        units = [f"BIG{k:04d}" for k in range(given.units)]
        for number in range(0 if given.archive else given.calibrations // 8):
            few = [f"SN{8 * number + k:06d}" for k in range(8)]
            made = tables(few, 24, number)
            write(archive, number, few, {name: made[name] for name in ("coefficients", "grades")})
        run = write(archive, 10**7, units, tables(units, given.dwells, 0))
        with served(place, Path(folder) / "bench") as server:
            start = time.perf_counter()
            until(server.answers, "the server answers")
            httpx.get(f"{server.address}/units", timeout=3000.0)  # the index is made once
            first = time.perf_counter() - start
            page = httpx.get(f"{server.address}/units?order=unit", timeout=600.0).text
            count = page.partition('<div class="card"><b>')[2].partition("<")[0]
            print(
                f"{given.units} units × {given.dwells} dwells among {count} calibrations; load {os.getloadavg()[0]:.1f}"
            )
            print(f"first search, with index    {first:.1f} s")
            measure(server, units, run, lambda number: f"P0001{number}" if given.archive else f"SN00001{number}")
            print(f"load at the end             {os.getloadavg()[0]:.1f}")


if __name__ == "__main__":
    main()
