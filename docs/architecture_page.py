"""``python -m docs.architecture_page``: rooms by layer contract, a run through the code, words; ``--check`` only compares."""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path
from xml.sax.saxutils import escape

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "explanation" / "architecture.md"
PICTURE = ROOT / "docs" / "pictures" / "rooms.svg"
MODULE = "docs.architecture_page"

STOPS = (
    ("pipelines/cli/run.py", "command", "reads the options, asks for the job, prints what comes back"),
    ("pipelines/jobs/job.py", "Request.job", "recipe, station and limits become one job; what cannot be is refused here"),
    ("pipelines/chain/runner.py", "Runner.stage", "runs one stage, unless the archive has its result under the same key"),
    ("pipelines/capture/capture.py", "capture", "takes the lot through poses and temperatures; complete records are kept"),
    ("pipelines/stages/validate.py", "validate", "data faults: which units are refused, and why"),
    ("pipelines/stages/reduce.py", "reduce", "samples become one mean for each dwell, with its standard error and its force"),
    ("pipelines/stages/fit.py", "fit", "tables become arrays of the lot, and the coefficients tables again"),
    ("inertial/fits/wander.py", "fit_lot_with_wander", "coefficients, covariance, and the noise between dwells"),
    ("pipelines/stages/verify.py", "verify", "errors in poses that the fit has not seen, beside those of a correct model"),
    ("pipelines/stages/uncertainty/budget.py", "budget", "what references and device add to the uncertainty of every result"),
    ("pipelines/stages/grade.py", "grade", "figures against limits by the agreed rule; grade and risk"),
    ("pipelines/chain/certify.py", "certify", "checks the run once more and writes a calibration into the ledger"),
)  # fmt: skip
"""A run from samples to certificate: file, function, what happens there."""

ENGINE = (
    ("inertial/state.py", "State", "the dwells of a lot: force, time, temperatures, what was recorded"),
    ("inertial/design.py", "local_columns", "effects become columns of a linear model"),
    ("inertial/estimation/lot.py", "Lot", "what is estimated from: outputs with their errors, known or unknown poses"),
    ("inertial/estimation/model.py", "Model", "a model on a lot: its coefficients and what they leave"),
    (
        "inertial/estimation/covariance.py",
        "",
        "the noise of dwells: white, flicker, walk, shares of units, axes and soaks",
    ),
    ("inertial/estimation/likelihood.py", "", "the restricted likelihood by which noise and candidates are compared"),
    ("inertial/criticism/search.py", "", "the candidates for what a model leaves, and their choice"),
    ("inertial/criticism/adequacy.py", "", "whether a model is adequate, with its probability"),
    ("inertial/next_measurement/aims.py", "", "what the next measurement has to separate"),
)
GLOSSARY = (
    ("run", "one measurement of a lot by a recipe, with everything that was computed from it"),
    ("recipe", "what is measured and how: units, poses, temperatures, model, limits"),
    ("plan", "the poses and temperatures of a recipe, and what they can determine"),
    ("unit", "one accelerometer, known by its serial number"),
    ("lot", "the units of one run, measured at the same times"),
    ("slot", "a seat of the fixture"),
    ("soak", "the time at one temperature, after the device has come to it"),
    ("dwell", "the time in one pose whose samples become one mean"),
    ("pose", "an orientation of the fixture, by the angles of the table"),
    ("record", "what one dwell, or one static measurement, stored: samples and readings of the surroundings"),
    ("effect", "a physical cause with its columns in the model, such as `third_order`"),
    ("adequate", "of a model: it leaves no more than the noise of the measurement (p at least 0.05)"),
    ("fresh run", "another run of the same units, which no fit has used"),
    ("driver", "a recorded quantity, or an attribute such as the wafer, that a residual follows"),
    ("block", "the dwells of one unit and axis"),
    ("share", "variance of a kind of noise over that of the white part"),
    ("floor", "the residual that the noise of the measurement alone leaves"),
    ("wander", "noise between dwells: flicker and random walk"),
    ("class", "effects that the plan cannot tell apart; they are named together"),
    ("rival", "an effect of another class that explains nearly as much"),
    ("alias", "a coefficient that another one imitates under the plan"),
    ("seal", "the hashes of a finished run, entered in the chain of the archive"),
    ("pack", "several small files of an archive in one"),
)
HEAD = f"""\
Written by `python -m {MODULE}` from the layer contracts of `pyproject.toml`, which `make test` holds against the imports.

![Rooms of the product, a row for each layer; imports point down](../pictures/rooms.svg)

Five packages: `tumbleline` (the same from Python) above `pipelines` (jobs, stages, archive, commands, pages) above
`stations` (devices, links, the simulated plant) above
`inertial` (the science: arrays in, arrays out) and `schemas` (what crosses a boundary). Why the layers are as they are:
[layers](../decisions/layers.md).""".splitlines()
DIAGNOSIS = """\
`tumbleline diagnose` begins at the dwells of stop 6:
[`pipelines/diagnosis/diagnose.py`](../../pipelines/diagnosis/diagnose.py) `diagnose` hands them to the judge in
`inertial/criticism`.""".splitlines()
ROW, LEFT, WIDE, HIGH, GAP = 44, 150, 1180, 30, 6
STYLE = 'font-family="sans-serif" font-size="13" role="img" aria-label="Rooms of the product, a row for each layer"'
ROOM, SMALL = "#e9eef5", "#5b6573"


def contracts() -> dict[str, list[list[str]]]:
    """The layers of every container, from the top: rooms of each."""
    tool = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]
    layers: dict[str, list[list[str]]] = {}
    for one in tool["contracts"]:
        if one["type"] == "layers" and "containers" in one:
            layers[one["containers"][0]] = [[name.strip() for name in row.split("|")] for row in one["layers"]]
    return layers


def lines_of(package: str, room: str) -> int:
    """Lines of Python of a room, a folder or a module."""
    place = ROOT / package / room
    files = sorted(place.rglob("*.py")) if place.is_dir() else [place.with_suffix(".py")]
    return sum(len(path.read_text(encoding="utf-8").splitlines()) for path in files if path.is_file())


def rows() -> list[tuple[str, list[tuple[str, str]]]]:
    """Rows of the picture, from the top: package, and its rooms with their path."""
    known = contracts()
    out = [("pipelines", [(room, f"pipelines/{room}") for room in row]) for row in known["pipelines"]]
    stations = sorted(place.name for place in (ROOT / "stations").iterdir() if (place / "__init__.py").is_file())
    out.append(("stations", [(room, f"stations/{room}") for room in stations]))
    for row in known["inertial"]:
        out += [("inertial", [(room, f"inertial/{room}") for room in row[k : k + 6]]) for k in range(0, len(row), 6)]
    return [*out, ("schemas", [("schemas", "schemas")])]


def picture() -> str:
    """The rooms as SVG: a row for each layer, numbers where a run passes."""
    all_rows = rows()
    height = ROW * len(all_rows) + 40
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDE} {height}" width="{WIDE}" height="{height}" {STYLE}>',
        f'<rect width="{WIDE}" height="{height}" fill="#ffffff"/>',
        f'<text x="{LEFT}" y="22" fill="{SMALL}">imports point down; numbers: the stops of a run</text>',
    ]
    passed: dict[str, list[int]] = {}
    for number, (path, _, _) in enumerate(STOPS, 1):
        room = path if path.count("/") == 1 else path.rpartition("/")[0]
        passed.setdefault("/".join(room.split("/")[:2]).removesuffix(".py"), []).append(number)
    before = ""
    for k, (package, rooms) in enumerate(all_rows):
        y = 36 + ROW * k
        if package != before:
            parts.append(f'<text x="12" y="{y + 20}" font-weight="bold">{package}</text>')
            parts.append(f'<line x1="8" x2="{WIDE - 8}" y1="{y - 6}" y2="{y - 6}" stroke="#b8c0cc"/>')
            before = package
        width = (WIDE - LEFT - 16 - GAP * (len(rooms) - 1)) / len(rooms)
        for place, (room, path) in enumerate(rooms):
            x = LEFT + place * (width + GAP)
            stops = passed.get(path, [])
            fill = "#ffe8c2" if stops else ROOM
            label = escape(room) + (f"  ({', '.join(map(str, stops))})" if stops else "")
            parts.append(
                f'<rect x="{x:.0f}" y="{y}" width="{width:.0f}" height="{HIGH}" rx="4" fill="{fill}" stroke="#b8c0cc"/>'
            )
            parts.append(f'<text x="{x + 0.5 * width:.0f}" y="{y + 20}" text-anchor="middle">{label}</text>')
    return "\n".join([*parts, "</svg>", ""])


def missing() -> list[str]:
    """Stops whose file or function is not there."""
    out: list[str] = []
    for path, name, _ in (*STOPS, *ENGINE):
        place = ROOT / path
        text = place.read_text(encoding="utf-8") if place.is_file() else ""
        wanted = [rf"^\s*(?:class|def) {part}\b" for part in name.split(".") if part]
        if not text or not all(re.search(pattern, text, re.MULTILINE) for pattern in wanted):
            out.append(f"{path}:{name}")
    return out


def page() -> str:
    """The text of the page."""
    stops = [f"{k}. [`{path}`](../../{path}) `{name}`: {what}." for k, (path, name, what) in enumerate(STOPS, 1)]
    engine = [
        f"{k}. [`{path}`](../../{path}){f' `{name}`' if name else ''}: {what}."
        for k, (path, name, what) in enumerate(ENGINE, 1)
    ]
    rooms = [(package, room) for package, row in contracts().items() for layer in row for room in layer]
    sizes = [(f"{package}/{room}", lines_of(package, room)) for package, room in rooms]
    largest = sorted((one for one in sizes if (ROOT / one[0]).is_dir()), key=lambda one: -one[1])[:12]
    table = [f"| `{room}` | {round(lines, -2)} |" for room, lines in largest]
    words = [f"| {word} | {meaning} |" for word, meaning in GLOSSARY]
    return "\n".join(
        [
            "# Architecture",
            "",
            *HEAD,
            "",
            "## A run through the code",
            "",
            "Twelve stops from samples to a certificate. Each can be read alone; a stage is a function of tables.",
            "",
            *stops,
            "",
            *DIAGNOSIS,
            "",
            "## The engine, in the order to read it",
            "",
            *engine,
            "",
            "## The largest rooms",
            "",
            "| room | lines of Python |",
            "|---|---|",
            *table,
            "",
            "## Words",
            "",
            "| word | meaning |",
            "|---|---|",
            *words,
            "",
        ]
    )


def main() -> int:
    """Write both files, or compare them."""
    wanted = {PAGE: page(), PICTURE: picture()}
    if absent := missing():
        sys.stdout.write(f"{PAGE.name}: not there: {', '.join(absent)}; correct the stops of {MODULE}\n")
        return 1
    if "--check" not in sys.argv[1:]:
        for path, text in wanted.items():
            path.write_text(text, encoding="utf-8")
        return 0
    old = [
        path.name
        for path, text in wanted.items()
        if not path.is_file() or _compared(path.read_text("utf-8")) != _compared(text)
    ]
    if old:
        sys.stdout.write(f"{', '.join(old)}: out of date; write it again with 'python -m {MODULE}'\n")
    return 1 if old else 0


def _compared(text: str) -> str:
    """A page without its numbers of lines, which every change moves."""
    return re.sub(r"^(\| `[^`]+`) \| \d+ \|$", "", text, flags=re.MULTILINE)


if __name__ == "__main__":
    sys.exit(main())
