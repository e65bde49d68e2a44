"""Figures of a report: SVG that is there without a script and in print, drawn by Plotly on a screen; still one file, offline.

The bundle stands compressed in the page, once. The page's policy admits this bundle and the page's own script by their
hashes, and no other script; nothing is loaded from anywhere.
"""

import json
import re
from base64 import b64encode
from functools import cache
from hashlib import sha256
from importlib.resources import files

from pipelines.drawing.chart import Chart
from pipelines.drawing.plotly_figure import plotly_figure
from pipelines.drawing.vector import svg_text

MOST_BYTES = 5_000_000
"""Size of a report up to which figures can be zoomed; those behind it stay pictures."""
BUNDLE = "plotly-cartesian-4.1.1.min.js"
BUNDLE_SHA256 = "79542150855a52c567260e3137095dbe2b744e6d702a5cabe67da246942fba7a"
HEAD = '<meta charset="utf-8">'
_DATA = re.compile(r'<div class="live"></div><script type="application/json">.*?</script>', re.DOTALL)


def figure_of(chart: Chart) -> str:
    """A chart as HTML: its picture, and its numbers for the script of the page."""
    data = json.dumps(plotly_figure(chart, webgl=False), separators=(",", ":"), ensure_ascii=False)
    safe = data.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")
    live = f'<div class="live"></div><script type="application/json">{safe}</script>'
    return f'<div class="figure">{svg_text(chart)}{live}</div>'


def interactive(page: str) -> str:
    """A whole page with the scripts that its figures need, if it does not become too large by them."""
    script = _script()
    head, tail = f"{HEAD}\n{_policy(script)}", f"{_bundle()}\n<script>{script}</script>\n</body>"
    left = MOST_BYTES - len(_DATA.sub("", page).encode()) - len(head) - len(tail.encode())
    used = 0

    def kept(match: re.Match[str]) -> str:
        nonlocal used
        size = len(match[0].encode())
        if used + size > left:
            return ""
        used += size
        return match[0]

    page = _DATA.sub(kept, page)
    if not used:
        return page
    return page.replace(HEAD, head, 1).replace("</body>", tail, 1)


def scripts_hash() -> str:
    """SHA-256 of the scripts of a report."""
    return sha256((_script() + _bundle()).encode()).hexdigest()


@cache
def _script() -> str:
    folder = files("pipelines.drawing")
    parts = ((folder / name).read_text(encoding="utf-8") for name in ("paint.js", "report.js"))
    return "(() => {\n" + "".join(parts).replace("export ", "") + "})();"


@cache
def _packed() -> bytes:
    return (files("pipelines.drawing") / "vendor" / f"{BUNDLE}.gz").read_bytes()


@cache
def _bundle() -> str:
    return f'<script type="text/plain" id="plotly">{b64encode(_packed()).decode()}</script>'


def _policy(script: str) -> str:
    """The Content-Security-Policy of the page: these two scripts may run, and nothing may be loaded."""
    hashes = [sha256(script.encode()).digest(), bytes.fromhex(BUNDLE_SHA256)]
    allowed = " ".join(f"'sha256-{b64encode(digest).decode()}'" for digest in hashes)
    rules = f"default-src 'none'; script-src {allowed}; "
    rules += "style-src 'unsafe-inline'; img-src data: blob:; base-uri 'none'; form-action 'none'"
    return f'<meta http-equiv="Content-Security-Policy" content="{rules}">'
