"""Pictures of the guides: the report of the main job, the diagnosis of the README, and every page of the workbench.

    PYTHONPATH=. .venv/bin/python docs/pictures/pages.py

measures a lot and a demonstration in a folder that is removed, and replaces the pictures. Needs chromium and playwright.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from io import BytesIO
from pathlib import Path
from typing import Any

from PIL import Image

FOLDER = Path(__file__).resolve().parent
sys.path.insert(0, str(FOLDER.parents[1] / "tests"))

from browser import Tab, chromium, served, tab, until  # noqa: E402

WIDTH, COLOURS = 1240, 128
REPORTS = {"report": 1775, "diagnosis": 1500}
PHONE = (390, 844)
DRAWN = """() => [...document.querySelectorAll('.figure')].filter((one) => one.getBoundingClientRect().top < innerHeight)
    .every((one) => one.classList.contains('drawn'))"""
DWELLS = "source={folder}/dwells.parquet&fresh={folder}/fresh.parquet"
PAGES = {
    "units": ("/units", 700), "run": ("/run", 900), "unit": ("/unit", 1000), "before": (f"/missing?{DWELLS}", 1180),
    "after": (f"/missing?{DWELLS}&added=third_order", 1500), "plan": ("/plan?only=unseen", 1200), "operator": ("/operator", 640),
    "station": ("/station", 900),
}  # fmt: skip
"""Address and height of the pages, by the name of the picture behind ``workbench-``."""


def main() -> None:
    """Write all pictures."""
    with tempfile.TemporaryDirectory() as place, chromium() as browser:
        top = Path(place)
        demo = ("demo", "cubic_transfer", "--seed", "1", "--by-hand", "--folder", "bench")
        dwells = ("diagnose", "bench/dwells.parquet", "--effects", "bias,scale,misalignment")
        for words in (("run",), demo, (*dwells, "--output", "diagnosis.html")):
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
            with tab(browser, server.address, size=PHONE) as one:
                one.open(PAGES["before"][0].format(folder=top / "bench"))
                of_page(one, "workbench-phone", PHONE[1] + 300)


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
