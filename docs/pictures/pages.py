"""Pictures of the guides: the report of the main job, the diagnosis of the README, and every page of the workbench.

    PYTHONPATH=. .venv/bin/python docs/pictures/pages.py

measures a lot, a demonstration and the lots of a line in a folder that is removed, and replaces the pictures. Needs chromium and
playwright.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

FOLDER = Path(__file__).resolve().parent
sys.path.insert(0, str(FOLDER.parents[1] / "tests"))

from browser import Tab, chromium, served, tab, until  # noqa: E402

from benchmarks.generated_archive import write_archive  # noqa: E402

WIDTH, COLOURS = 1240, 128
REPORTS = {"report": 1775, "diagnosis": 1500}
PHONE = (390, 844)
DRAWN = """() => [...document.querySelectorAll('.figure')].filter((one) => one.getBoundingClientRect().top < innerHeight)
    .every((one) => one.classList.contains('drawn'))"""
FILE = "source={folder}/dwells.parquet"
DWELLS = FILE + "&fresh={folder}/fresh.parquet"
MODEL = (
    "bias,scale,misalignment,bias_temperature,bias_temperature_quadratic,scale_temperature,scale_temperature_quadratic"
)
PAGES = {
    "units": ("/units", 700), "run": ("/run", 900), "unit": ("/unit", 1000), "before": (f"/missing?{DWELLS}", 1180),
    "after": (f"/missing?{DWELLS}&added=third_order", 1500), "plan": ("/plan?only=unseen", 1200), "operator": ("/operator", 640),
    "station": ("/station", 900), "two-models": (f"/two-models?{FILE}&added=third_order", 1000),
    "models": ("/models?model=line-1&evaluate=yes", 900),
}  # fmt: skip
"""Address and height of the pages, by the name of the picture behind ``workbench-``."""


def main() -> None:
    """Write all pictures."""
    os.environ["LOGNAME"] = "operator"  # the author of runs and models
    with tempfile.TemporaryDirectory() as place, chromium() as browser:
        top = Path(place)
        demo = ("demo", "cubic_transfer", "--seed", "1", "--by-hand", "--folder", "bench")
        dwells = ("diagnose", "bench/dwells.parquet", "--effects", "bias,scale,misalignment")
        line = ("demo", "--lots", "110", "--seed", "4", "--folder", "line")
        model = (
            "extend",
            "bench/models/line-1.toml",
            "third_order",
            "--effects",
            MODEL,
            "--reason",
            "a lot of July needs it",
        )
        for words in (("run",), demo, (*dwells, "--output", "diagnosis.html"), line, model):
            # 1: a unit failed, or the model is not adequate, which is a result
            done = subprocess.run([sys.executable, "-m", "pipelines.cli", *words], cwd=top, check=False)  # noqa: S603 - our own interpreter and module
            assert done.returncode in {0, 1}, words
        (report,) = top.glob("archive/runs/*/report.html")
        for name, path in {"report": report, "diagnosis": top / "diagnosis.html"}.items():
            of_file(browser, path, name)
        with served(top / "archive", top / "bench") as server:
            with tab(browser, server.address) as one:
                for name, (address, tall) in PAGES.items():
                    one.open(address.format(folder=top / "bench"))
                    of_page(one, f"workbench-{name}", tall)
                one.open("/upload")
                one.page.set_input_files("[data-file]", recording(top / "bench-7.csv"))
                one.sees("[data-mapping]")
                one.page.fill("input[name=serial]", "BENCH-7")
                one.page.fill("input[name=gravity]", "9.81")
                one.press("text=Apply")
                one.sees("[data-dwells]")
                of_page(one, "workbench-upload", 1150)
            with tab(browser, server.address, size=PHONE) as one:
                one.open(PAGES["before"][0].format(folder=top / "bench"))
                of_page(one, "workbench-phone", PHONE[1] + 300)
        of_an_archive(browser, top / "line" / "archive", "discover")
        write_archive(top / "factory", 16, years=2.0, seed=7, workers=1)
        of_an_archive(browser, top / "factory", "audit")


def of_an_archive(browser: Any, archive: Path, name: str) -> None:
    """A page that looks at many lots, of an archive of its own."""
    with served(archive, archive.parent / f"bench-{name}") as server, tab(browser, server.address) as one:
        one.open(f"/{name}")
        of_page(one, f"workbench-{name}", 1150)


def recording(path: Path) -> str:
    """A recording by hand: a device that is laid on its faces and on edges, and moved between, in m/s²."""
    rng = np.random.default_rng(3)
    edges = np.array(
        [[0.6, 0.8, 0.0], [0.0, 0.6, -0.8], [0.8, 0.0, 0.6], [-0.6, 0.0, 0.8], [0.0, -0.8, -0.6], [-0.8, -0.6, 0.0]]
    )
    held = np.concatenate([np.eye(3), -np.eye(3), edges])
    rows = np.concatenate(
        [np.concatenate([np.tile(one, (200, 1)), one + 0.2 * rng.normal(size=(40, 3))]) for one in held]
    )
    output = 9.80665 * (rows + 1e-4 * rng.normal(size=rows.shape))
    table = np.column_stack([np.arange(len(output)) / 50.0, output])
    np.savetxt(path, table, "%.5f", ",", header="time [s],ax [m/s^2],ay [m/s^2],az [m/s^2]", comments="")
    return str(path)


def of_file(browser: Any, path: Path, name: str) -> None:
    """The upper part of a report."""
    page = browser.new_page(viewport={"width": WIDTH, "height": REPORTS[name]}, color_scheme="light")
    page.goto(path.resolve().as_uri())
    until(lambda: page.evaluate(DRAWN), "the figures are drawn")
    kept(page.screenshot(), name)


def of_page(one: Tab, name: str, tall: int) -> None:
    """The upper part of a page of the workbench, without the paths of this machine."""
    wide = one.page.viewport_size["width"]
    one.page.set_viewport_size({"width": wide, "height": tall})
    one.ready()
    one.page.add_style_tag(content=".command, .place, .hint, #errors code { display: none }")
    time.sleep(0.5)
    kept(one.page.screenshot(), name)


def kept(content: bytes, name: str) -> None:
    """Keep a picture with few colours, which is small."""
    Image.open(BytesIO(content)).quantize(COLOURS).save(FOLDER / f"{name}.png", optimize=True)


if __name__ == "__main__":
    main()
