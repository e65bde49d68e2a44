"""The report: complete, offline, and readable; its figures can be zoomed, and stay pictures where it would become too large."""

import base64
import gzip
import hashlib
import json
import re
from importlib.resources import files

import numpy as np
import pandas as pd
import pytest
from each import each

from pipelines.archive import Run
from pipelines.drawing import Chart, ColourScale, Plot, PlotAxis, Trace, svg_text
from pipelines.drawing.mollweide import sphere
from pipelines.drawing.ticks import date_ticks, linear_ticks, log_ticks
from pipelines.report import interactive as module
from pipelines.report import make_report, render
from pipelines.report.interactive import BUNDLE, BUNDLE_SHA256, figure_of, interactive
from pipelines.report.run_pictures import lot_chart


@pytest.fixture(scope="module")
def page(run: Run) -> str:
    return render(run)


def test_shows_every_unit_rule_and_origin_opens_without_a_network_and_is_the_same_every_time(
    page: str, run: Run
) -> None:
    assert not re.findall(r'(?:src|href)="(?!#)', page.replace('xlink:href="#', ""))
    assert not re.findall(r"url\((?!#)", page)
    assert all(f'id="{unit}"' in page for unit in ("A1", "A2", "A3"))
    assert page.count("<svg") == 2 + 3 * 3
    known = (
        "Allan deviation",
        "scale_temperature",
        "not stated",
        "ILAC-G8:09/2019 guarded acceptance",
        "9.8123 m/s²",
        run.id,
    )
    assert [words for words in (*known, str(run.about["capture"])) if words not in page] == []
    for words in ("mean of the record", "mean of the day after the record", "mean of a day after the next switch-on"):
        assert page.count(words) >= 3, words
    assert render(run) == page
    assert len(page.encode()) < module.MOST_BYTES


@pytest.mark.parametrize(("mean", "red"), [(300.0, False), (1300.0, True)])
def test_the_limit_is_for_the_mean_of_a_pose_not_for_a_dwell_that_wandered(mean: float, *, red: bool) -> None:
    dwells = pd.DataFrame(
        {"unit": "A1", "pose": ["v01", "v01", "v02"], "error_ug": [1400.0, 2.0 * mean - 1400.0, 10.0]}
    )
    poses = pd.DataFrame({"unit": "A1", "pose": ["v01", "v02"], "error_ug": [mean, 10.0]})
    chart = lot_chart(dwells, poses, ["A1"], 1000.0)
    shown = {trace.name: trace.y.tolist() for trace in chart.plots[0].traces if trace.style == "points"}
    assert shown.get("mean of a pose, beyond the limit", []) == ([mean] if red else [])
    assert shown["single dwell"] == [1400.0, 2.0 * mean - 1400.0, 10.0]
    assert ("beyond the limit" in svg_text(chart)) is red


def test_numbers_are_no_longer_than_their_uncertainty_supports_k_is_printed_and_a_report_is_made_once(
    page: str, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = re.sub(r"<(svg|style)\b.*?</\1>", "", page, flags=re.DOTALL)
    cells = re.findall(r'<td class="n"[^>]*>(.*?)</td>', text, flags=re.DOTALL)
    plain = [re.sub(r"<[^>]*>", " ", cell).split("±")[0] for cell in cells if "…" not in cell]
    assert max(len(re.findall(r"\d", cell)) for cell in plain) <= 10
    make_report(run)
    assert make_report(run)  # it is there
    about = {**run.about, "limits": {**run.about["limits"], "coverage_factor": 2.5}}
    monkeypatch.setattr(type(run), "about", property(lambda _: about))
    other = render(run)
    assert ("k = 2.5" in other, "k = 2)" in other) == (True, False)


DATA = re.compile(r'<script type="application/json">(.*?)</script>', re.DOTALL)
PAGE = '<html><head>\n<meta charset="utf-8">\n</head><body>{}\n</body></html>'


def chart(name: str = "measured", count: int = 3) -> Chart:
    x = np.arange(count, dtype=float)
    points = Trace(name, x, 2.0 * x, texts=tuple(name for _ in x))
    return Chart(name, (Plot(name, PlotAxis("time / s"), PlotAxis("residual / µg"), (points,)),))


def test_the_bundle_is_the_one_of_its_makers_and_the_policy_admits_the_two_scripts_and_no_other(page: str) -> None:
    folder = files("pipelines.drawing") / "vendor"
    text = gzip.decompress((folder / f"{BUNDLE}.gz").read_bytes())
    assert hashlib.sha256(text).hexdigest() == BUNDLE_SHA256
    assert "Permission is hereby granted" in (folder / "plotly-LICENSE.txt").read_text()
    policy = re.search(r'http-equiv="Content-Security-Policy" content="([^"]*)"', page)
    assert page.index("Content-Security-Policy") < page.index("<style>")
    (own,) = re.findall(r"<script>(.*?)</script>", page, flags=re.DOTALL)
    (packed,) = re.findall(r'<script type="text/plain" id="plotly">(.*?)</script>', page, flags=re.DOTALL)
    known = [own.encode(), gzip.decompress(base64.b64decode(packed))]
    hashes = [f"'sha256-{base64.b64encode(hashlib.sha256(one).digest()).decode()}'" for one in known]
    assert f"default-src 'none'; script-src {' '.join(hashes)};" in policy[1]
    assert "unsafe-eval" not in policy[1]
    assert "http" not in policy[1]


def test_every_figure_has_its_picture_and_the_same_numbers_for_the_script(page: str, run: Run) -> None:
    figures = re.findall(r'<div class="figure">(<svg.*?</svg>).*?</script></div>', page, flags=re.DOTALL)
    data = [json.loads(text) for text in DATA.findall(page)]
    assert len(figures) == len(data) == 1 + 3 * 3
    residuals = run.table("residuals")
    wanted = residuals[(residuals["unit"] == "A1") & (residuals["axis"] == "x")]["residual_ug"].to_numpy()
    model = next(one for one in data if one["layout"]["meta"]["title"] == "Model and measurement")
    packed = [base64.b64decode(trace["y"]["bdata"]) for trace in model["data"] if trace["name"] == "residual"]
    drawn = [np.frombuffer(one, "<f4") for one in packed]
    assert any(one.size == wanted.size and np.allclose(np.sort(one), np.sort(wanted), rtol=1e-5) for one in drawn)
    axes = [axis for name, axis in model["layout"].items() if "axis" in name]
    labels = {axis.get("title", {}).get("text") for axis in axes} - {None, ""}
    picture = next(one for one in figures if 'aria-label="Model and measurement"' in one)
    assert labels
    assert all(label in picture for label in labels - {"temperature of the soak / °C"})


def test_figures_that_would_make_it_too_large_stay_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    small, large = figure_of(chart("small")), figure_of(chart("large", 20_000))
    content = PAGE.format(small + large)
    bundle = len(interactive(content).encode()) - len(content.encode())
    monkeypatch.setattr(module, "MOST_BYTES", bundle + len(content.encode()) - 1)
    partly = interactive(content)
    assert len(partly.encode()) <= module.MOST_BYTES
    assert len(DATA.findall(partly)) == 1
    assert partly.count("<svg") == 2
    monkeypatch.setattr(module, "MOST_BYTES", bundle)
    never = interactive(content)
    assert "<script" not in never
    assert never.count("<svg") == 2
    assert interactive(PAGE.format("<p>none</p>")) == PAGE.format("<p>none</p>")


def test_points_lie_at_their_places_in_the_picture() -> None:
    axis = PlotAxis("x", low=0.0, high=10.0)
    points = Trace("p", np.array([0.0, 5.0, 10.0, 11.0]), np.array([0.0, 5.0, 10.0, 5.0]))
    text = svg_text(Chart("c", (Plot("", axis, PlotAxis("y", low=0.0, high=10.0), (points,)),), height=300))
    (path,) = re.findall(r'<path d="([^"]*)" stroke="#0072b2" stroke-width="6"', text)[-1:]
    places = [tuple(map(float, one)) for one in re.findall(r"M([\d.]+) ([\d.]+)h", path)]
    assert len(places) == 3  # what lies outside of the axes is not drawn
    (left, low), (middle, half), (right, high) = places
    assert middle == pytest.approx(0.5 * (left + right), abs=0.1)
    assert half == pytest.approx(0.5 * (low + high), abs=0.1)
    assert low > high
    (frame,) = re.findall(r'<path d="M([\d.]+) ([\d.]+)v([\d.]+)h([\d.]+)" stroke="#8a8f98"', text)
    assert (left, low) == pytest.approx((float(frame[0]), float(frame[1]) + float(frame[2])), abs=0.1)


def test_all_marks_are_drawn_and_missing_values_are_left_out() -> None:
    x, bad = np.arange(4.0), np.array([1.0, np.nan, 3.0, 2.0])
    symbols = ("circle", "triangle-up", "triangle-down", "square", "diamond")
    traces = (
        *(Trace(symbol, x, bad, symbol=symbol, error=0.1 + x) for symbol in symbols),
        Trace("line", x, bad, "line", dashed=True),
        Trace("band", x, bad - 1.0, "band", high=bad + 1.0),
        Trace("bars", x, bad * 0.0 + 1.0, "bars"),
        Trace("cells", x, x[:2], "density", counts=np.arange(8.0).reshape(2, 4)),
        Trace("names", x[:1], x[:1], "labels", texts=("<+x>",)),
    )
    colours = Trace("coloured", 0.2 * x, 0.2 * x, colour=bad)
    scale = ColourScale("mean / µg", 1.0, 3.0)
    text = svg_text(Chart("c", (Plot("a", PlotAxis("x"), PlotAxis("y"), traces), sphere("b", (colours,))), 2, scale))
    assert "nan" not in text
    assert "&lt;+x&gt;" in text
    wanted = {f'stroke="{colour}"' for colour in ("#2f7bc4", "#d0382f", "#999999")}  # both ends, and a missing value
    assert [one for one in (*wanted, "mean / µg") if one not in text] == []


@each([(-12.3, 41.0), (0.0, 1.0), (249_000.0, 251_000.0), (-3e-7, 2e-7), (5.0, 5.5)])
def test_ticks_are_round_and_inside(ends: tuple[float, float]) -> None:
    low, high = ends
    ticks = linear_ticks(low, high, 6)
    values = np.array([value for value, _ in ticks])
    assert 2 <= values.size <= 8
    assert values.min() >= low - 1e-9 * (high - low)
    assert values.max() <= high + 1e-9 * (high - low)
    assert len({label for _, label in ticks}) == values.size  # no two ticks look the same
    assert np.allclose(np.diff(values), values[1] - values[0])
    # of decades and dates
    assert [label for _, label in log_ticks(0.02, 15.0)] == ["0.02", "0.05", "0.1", "0.2", "0.5", "1", "2", "5", "10"]
    assert [label for _, label in log_ticks(1e-6, 1e6)][:2] == ["10⁻⁶", "10⁻⁵"]
    assert {label[:4] for _, label in date_ticks(20_000.0, 20_400.0, 8)} <= {"2024", "2025"}
