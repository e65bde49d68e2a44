"""Pictures of the guides: the report of the main job and the diagnosis of the README, as chromium shows them.

    python docs/pictures/reports.py REPORT.html DIAGNOSIS.html

Reports come from `tumbleline run` and from the story of the README. Needs chromium and playwright.
"""

from __future__ import annotations

import sys
from io import BytesIO
from pathlib import Path

from PIL import Image

FOLDER = Path(__file__).resolve().parent
sys.path.insert(0, str(FOLDER.parents[1] / "tests"))

from browser import chromium, until  # noqa: E402

WIDTH, COLOURS = 1240, 256
HEIGHT = {"report": 1775, "diagnosis": 1900}
DRAWN = """() => [...document.querySelectorAll('.figure')].filter((one) => one.getBoundingClientRect().top < innerHeight)
    .every((one) => one.classList.contains('drawn'))"""


def main(report: str, diagnosis: str) -> None:
    """Write the upper part of both pages."""
    with chromium() as browser:
        for place, name in ((report, "report"), (diagnosis, "diagnosis")):
            page = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT[name]}, color_scheme="light")
            page.goto(Path(place).resolve().as_uri())
            until(lambda page=page: page.evaluate(DRAWN), "the figures are drawn")
            picture = Image.open(BytesIO(page.screenshot()))
            picture.quantize(COLOURS).save(FOLDER / f"{name}.png", optimize=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
