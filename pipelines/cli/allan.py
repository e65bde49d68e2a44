"""``tumbleline allan``: Allan deviation of a file or a run, and the noise terms that it needs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from pipelines.cli.options import (
    ArchiveOption,
    JsonOption,
    PageOption,
    PlotOption,
    RateOption,
    SeriesArgument,
    SeriesColumnsOption,
    SeriesUnitOption,
    StretchOption,
    TimeColumnOption,
    TimeUnitOption,
    console,
    error_console,
    print_json,
    print_table,
    short,
)
from schemas.errors import WrongUse

if TYPE_CHECKING:
    from pipelines.archive import Run
    from pipelines.importers.series import EvenSeries

PART = "Results"
ORDER = 370
SUMMARY = "Compute the Allan deviation of a record and its noise terms, with intervals."
EXAMPLES = (
    "tumbleline allan rest.csv --rate 100",
    "tumbleline allan latest --plot allan.png",
)

SPACINGS = ("octave", "decade")


def command(
    source: SeriesArgument,
    columns: SeriesColumnsOption = "",
    time: TimeColumnOption = "",
    time_unit: TimeUnitOption = "s",
    rate: RateOption = None,
    unit: SeriesUnitOption = "",
    spacing: Annotated[
        str,
        typer.Option("--spacing", metavar="octave|decade", help="Averaging times: 1, 2, 4 … or 1, 2, 5, 10 … samples."),
    ] = "octave",
    stretch: StretchOption = None,
    plot: PlotOption = None,
    page: PageOption = None,
    archive: ArchiveOption = None,
    *,
    as_json: JsonOption = False,
) -> None:
    """Compute the overlapping Allan deviation of a record at rest, and the terms Q, N, B, K and R that explain it.

    A term that the curve does not need has an upper limit (95 %) instead of a value. N is the coefficient of IEEE Std 952; the
    one-sided noise density of data sheets is N·√2. Of a captured run the static record's own figures are printed, in µg.
    """
    from pipelines.archive import Archive
    from pipelines.cli.series_options import even_series
    from pipelines.cli.series_pictures import write_pictures

    if spacing not in SPACINGS:
        raise WrongUse(f"--spacing: found '{spacing[:40]}', octave or decade is needed; correct it")
    series = even_series(source, columns, (time, time_unit, rate), unit, archive, stretch)
    with error_console().status("averaging"):
        document = allan_of_run(Archive(archive).run(source)) if series is None else allan_document(series, spacing)
    write_pictures(document, plot, page)
    if as_json:
        print_json(document)
    else:
        _print(document)


def allan_document(series: EvenSeries, spacing: str = "octave") -> dict[str, Any]:
    """Curves and terms of every channel of a series.

    Raises
    ------
    DataRejected
        The record is too short, or no channel changes.
    """
    from inertial.noise.allan import overlapping
    from inertial.noise.terms import fit_terms, model_deviation
    from pipelines.stages.noise import FEWEST, limits_where_unexplained
    from schemas.errors import DataRejected

    n = series.values.shape[1]
    if n < FEWEST:
        raise DataRejected(f"{series.where}: {n} samples, {FEWEST} are needed for five terms; record longer")
    import numpy as np

    alive = [k for k in range(len(series.names)) if np.ptp(series.values[k]) > 0.0]
    if not alive:
        raise DataRejected(
            f"{series.where}: no channel ever changes, noise is needed; check the channels and the digits"
        )
    curve = overlapping(series.values[alive], series.rate_hz, "decade" if spacing == "decade" else "octave")
    terms = limits_where_unexplained(curve, fit_terms(curve))
    fitted = model_deviation(terms, curve.tau)
    curves, rows = [], []
    for place, k in enumerate(alive):
        explained = bool(terms.p_value[place] >= 1e-6)
        curves.append({
            "channel": series.names[k],
            "tau_s": curve.tau.tolist(),
            "deviation": curve.deviation[place].tolist(),
            "low": curve.low[place].tolist(),
            "high": curve.high[place].tolist(),
            "fitted": fitted[place].tolist() if explained else None,
        })  # fmt: skip
        for symbol, term in terms.one(place).items():
            rows.append({
                "channel": series.names[k], "term": symbol, "name": term.name, "value": term.value, "low": term.low,
                "high": term.high, "identified": term.identified, "unit": term.unit.format(series.unit or "unit"),
            })  # fmt: skip
    notes = [f"{series.names[k]}: the output never changes" for k in range(len(series.names)) if k not in alive]
    notes += [
        f"{series.names[k]}: no mixture of the five terms explains the curve; the limits are what the whole curve allows"
        for place, k in enumerate(alive)
        if not terms.p_value[place] >= 1e-6
    ]
    return {
        "source": series.where,
        "unit": series.unit,
        "rate_hz": series.rate_hz,
        "samples": n,
        "confidence": curve.confidence,
        "term_confidence": terms.confidence,
        "curves": curves,
        "terms": rows,
        "notes": notes,
    }


def allan_of_run(run: Run) -> dict[str, Any]:
    """Curves and terms that a captured run has of its static record, in µg, the channels named unit and axis.

    Raises
    ------
    WrongUse
        The run has none.
    """
    from inertial.noise.terms import NAMES
    from pipelines.tables.frames import rows_of

    if not {"allan", "noise"} <= set(run.tables()) or run.table("allan").empty:
        raise WrongUse(
            f"run {run.id}: it has no static record, one is needed; run a recipe with static_record_s above 0"
        )
    curves, noise = run.table("allan"), run.table("noise")
    readings = run.table("readings")
    static = readings[readings["kind"] == "allan"]
    channels = []
    for (unit, axis), own in curves.groupby(["unit", "axis"], sort=False):
        columns = ("tau_s", "deviation_ug", "low_ug", "high_ug")
        tau, deviation, low, high = (own[name].tolist() for name in columns)
        fitted = own["fitted_ug"].tolist() if own["fitted_ug"].notna().all() else None
        channels.append(
            {
                "channel": f"{unit} {axis}",
                "tau_s": tau,
                "deviation": deviation,
                "low": low,
                "high": high,
                "fitted": fitted,
            }
        )
    rows = [
        {
            "channel": f"{row['unit']} {row['axis']}", "term": row["term"], "name": NAMES[row["term"]],
            "value": row["value"] if row["identified"] else None, "low": row["low"], "high": row["high"],
            "identified": bool(row["identified"]), "unit": row["unit_text"],
        }
        for row in rows_of(noise) if row["term"] in NAMES
    ]  # fmt: skip
    notes = list(dict.fromkeys(f"{r['unit']} {r['axis']}: {r['note']}" for r in rows_of(noise) if r.get("note")))
    return {
        "source": f"run {run.id}",
        "unit": "µg",
        "rate_hz": float(static["rate_hz"].iloc[0]),
        "samples": int(static["n"].max()),
        "confidence": 0.6827,
        "term_confidence": 0.95,
        "curves": channels,
        "terms": rows,
        "notes": notes,
    }


def _print(document: dict[str, Any]) -> None:
    out = console()
    span = document["samples"] / document["rate_hz"]
    out.print(
        f"{document['source']}: {document['samples']} samples at {short(document['rate_hz'], 5)} Hz, {short(span)} s",
        markup=False,
        soft_wrap=True,
    )
    lines = []
    for row in document["terms"]:
        value = short(row["value"], 4) if row["identified"] else "not identified"
        interval = (
            f"{short(row['low'], 4)} … {short(row['high'], 4)}" if row["identified"] else f"≤ {short(row['high'])}"
        )
        lines.append([row["channel"], row["term"], row["name"], value, interval, row["unit"]])
    level = round(100.0 * document["term_confidence"])
    print_table(
        ["channel", "term", "name", "value", f"interval or upper limit, {level} %", "unit"], lines, title="Noise terms"
    )
    for note in document["notes"]:
        out.print(note, style="yellow", markup=False, soft_wrap=True)
