"""``tumbleline noise``: Allan deviation of a record with the noise terms that it needs, and its power spectral density."""

from collections.abc import Mapping, Sequence
from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from pipelines.archive import Archive
from pipelines.cli import options
from pipelines.cli.groups import group
from pipelines.cli.options import option
from pipelines.cli.printing import error_console, give, print_table, publish, say, short
from schemas.errors import WrongUse, did_you_mean

if TYPE_CHECKING:
    from pipelines.importers.series import EvenSeries

PART = "Results"
ORDER = 370
SUMMARY = "Compute the noise of a record: Allan deviation and its terms, or power spectral density."
EXAMPLES = (
    "tumbleline noise allan rest.csv --rate 100 --output allan.png",
    "tumbleline noise psd rest.csv --rate 100 --output psd.png",
)
EXAMPLES_OF = {
    "allan": (
        "tumbleline noise allan rest.csv --rate 100 --output allan.png",
        "tumbleline noise allan latest --statistic hadamard",
    ),
    "psd": (
        "tumbleline noise psd rest.csv --rate 100",
        "tumbleline noise psd rest.csv --rate 100 --output psd.png --output psd.html",
    ),
}
"""Of the subcommands."""

SPACINGS = ("octave", "decade")
STATISTICS = ("allan", "modified", "hadamard", "total", "time", "tie", "mtie")
"""The names of ``pipelines.stages.deviations``, which is not loaded for the first: allantools takes half a second."""
NAVIGATION = ("velocity_random_walk_m_s_rth", "q_n_m2_s4_Hz", "q_b_m2_s4")
SHOWN_S = (60.0, 3600.0)


KINDS = {"picture": options.PICTURES, "page": options.PAGES}
NoiseOutputOption = Annotated[
    list[Path] | None,
    option("--output -o FILE", "Picture (.png, .svg, .pdf) or page with tables (.html); may be repeated."),
]


def allan(
    source: options.SeriesArgument,
    columns: options.MapOption = None,
    unit_of: options.UnitOfOption = None,
    rate: options.RateOption = None,
    spacing: Annotated[
        str, option("--spacing octave|decade", "Averaging times: 1, 2, 4 … or 1, 2, 5, 10 … samples.")
    ] = "octave",
    statistic: Annotated[
        str,
        option(
            f"--statistic {'|'.join(STATISTICS)}",
            "Overlapping Allan, modified Allan, overlapping Hadamard, total or time deviation; RMS or maximum time "
            "interval error.",
        ),
    ] = STATISTICS[0],
    stretch: options.StretchOption = None,
    output: NoiseOutputOption = None,
    archive: options.ArchiveOption = None,
    *,
    as_json: options.JsonOption = False,
) -> None:
    """Compute the overlapping Allan deviation of a record at rest, and the terms Q, N, B, K and R that explain it.

    A term that the curve does not need has an upper limit (95 %) instead of a value. N is the coefficient of IEEE Std 952; the
    one-sided noise density of data sheets is N·√2. Of a captured run the static record's own figures are printed, in µg.

    Other statistics have an interval where its degrees of freedom are known. 'time', 'tie' and 'mtie' are of the integral
    of the output without its mean: the error of a velocity, in m/s for an output in g.
    """
    from pipelines.chain.noise_documents import allan_document, allan_of_run, statistic_of_run

    files = options.outputs(output, KINDS, "noise allan")
    if spacing not in SPACINGS:
        raise WrongUse(f"--spacing: found '{spacing[:40]}', octave or decade is needed; correct it")
    if statistic not in STATISTICS:
        raise WrongUse(
            f"--statistic: found '{statistic[:40]}', one of {', '.join(STATISTICS)} is needed; "
            f"{did_you_mean(statistic[:40], STATISTICS)}"
        )
    series = even_series(source, columns or (), ",".join(unit_of or ()), rate, archive, stretch)
    with error_console().status("averaging"):
        if series is not None:
            document = allan_document(series, spacing, statistic)
        elif statistic == STATISTICS[0]:
            document = allan_of_run(Archive(archive).run(source))
        else:
            document = statistic_of_run(Archive(archive).run(source), spacing, statistic)
    _draw(document, files)
    give(document, _print, as_json=as_json)


def _print(document: dict[str, Any]) -> None:
    span = document["samples"] / document["rate_hz"]
    say(f"{document['source']}: {document['samples']} samples at {short(document['rate_hz'], 5)} Hz, {short(span)} s")
    _print_terms(document) if document["statistic"] == STATISTICS[0] else _print_curves(document)
    for note in document["notes"]:
        say(note, style="yellow")


def _print_terms(document: dict[str, Any]) -> None:
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
    _print_navigation(document["navigation"])


def _print_navigation(rows: list[dict[str, Any]]) -> None:
    """Print the errors of velocity and position without aiding that follow from the identified terms."""
    if not rows:
        return
    shown = [rows[0]["time_s"].index(time) for time in SHOWN_S]
    head = ["channel", "velocity random\nwalk, m/s/√h", "Q_n = N²\n(m/s²)²/Hz", "Q_b = B²\n(m/s²)²"]
    head += [f"σ_{what}({time:g} s)\n{unit}" for time in SHOWN_S for what, unit in (("v", "m/s"), ("p", "m"))]
    lines = [
        [
            row["channel"],
            *("" if row[name] is None else short(row[name]) for name in NAVIGATION),
            *(short(row[what][k]) for k in shown for what in ("velocity_m_s", "position_m")),
        ]
        for row in rows
    ]
    print_table(head, lines, title="Error of navigation without aiding")
    lacking = sorted({name for row in rows for name in row["not_identified"]})
    beside = f"; {', '.join(lacking)} where not identified count as zero" if lacking else ""
    say(f"σ by N, B (as a constant bias) and K of one axis from a known start{beside}", style="dim")


def _print_curves(document: dict[str, Any]) -> None:
    lines = [
        [row["channel"], short(tau), short(value, 4), "no interval" if isnan(low) else f"{short(low)} … {short(high)}"]
        for row in document["curves"]
        for tau, value, low, high in zip(row["tau_s"], row["deviation"], row["low"], row["high"], strict=True)
    ]
    name, unit = document["statistic_name"], document["deviation_unit"] or "unit"
    level = round(100.0 * document["confidence"])
    print_table(["channel", "τ\ns", f"{name}\n{unit}", f"interval, {level} %\n{unit}"], lines)


def psd(
    source: options.SeriesArgument,
    columns: options.MapOption = None,
    unit_of: options.UnitOfOption = None,
    rate: options.RateOption = None,
    segment: Annotated[
        int | None, option("--segment N", "Samples of a segment; an eighth of the record by default.")
    ] = None,
    stretch: options.StretchOption = None,
    output: NoiseOutputOption = None,
    archive: options.ArchiveOption = None,
    *,
    as_json: options.JsonOption = False,
) -> None:
    """Compute the one-sided power spectral density by Welch's method, and σ(τ) from it beside that of the samples.

    σ²(τ) = 2·∫ S(f)·sin⁴(πfτ)/(πfτ)² df (IEEE Std 952). Where the two differ, the record holds lines, jumps or a drift.
    """
    from pipelines.chain.noise_documents import psd_document

    files = options.outputs(output, KINDS, "noise psd")
    series = even_series(source, columns or (), ",".join(unit_of or ()), rate, archive, stretch)
    if series is None:
        raise WrongUse(
            f"psd: run {source} was captured, a file or an import is needed; export its samples, or see 'tumbleline noise allan'"
        )
    with error_console().status("averaging"):
        document = psd_document(series, segment)
    _draw(document, files)
    give(document, _print_psd, as_json=as_json)


def _print_psd(document: dict[str, Any]) -> None:
    say(
        f"{document['source']}: {document['samples']} samples at {short(document['rate_hz'], 5)} Hz, segments of "
        f"{document['segment']} samples, resolution {short(document['rate_hz'] / document['segment'])} Hz"
    )
    unit = document["unit"] or "unit"
    lines = [[row["channel"], short(row["median_amplitude"], 4)] for row in document["spectra"]]
    print_table(["channel", f"median noise density\n{unit}/√Hz, one-sided"], lines)
    lines = [
        [row["channel"], short(tau), short(derived, 4), short(direct, 4)]
        for row in document["spectra"]
        for tau, derived, direct in zip(row["tau_s"], row["deviation_from_density"], row["deviation"], strict=True)
    ]
    print_table(["channel", "τ\ns", f"σ from the density\n{unit}", f"σ of the samples\n{unit}"], lines)
    for note in document["notes"]:
        say(note, style="yellow")


def even_series(
    source: str, columns: Sequence[str], unit_of: str, rate: float | None, archive: str | None, stretch: int | None
) -> "EvenSeries | None":
    """The samples of a file or an import; None for a captured run, which has figures of its own.

    columns, unit_of : as they were given; rate in Hz

    Raises WrongUse: an option of files was given for a run.
    """
    from pipelines.importers.files import is_file
    from pipelines.importers.mapping import pairs
    from pipelines.importers.series import series_of_file, series_of_run

    if is_file(source):
        time, named = options.mapped_outputs(columns)
        units = pairs(unit_of, "--unit-of")
        if more := sorted(units.keys() - {"output", "time"}):
            raise WrongUse(f"--unit-of: found '{more[0]}', output or time is needed; correct it")
        with error_console().status(f"reading {Path(source).name}"):
            return series_of_file(
                Path(source), named, time=time, time_unit=units.get("time", ""), rate_hz=rate, unit=units.get("output", "")
            )  # fmt: skip
    if columns or rate is not None or unit_of:
        raise WrongUse(f"{source}: --map, --rate and --unit-of are for files, and there is no such file; correct one")
    run = Archive(archive).run(source)
    return None if run.about.get("capture") else series_of_run(run, stretch)


def _draw(document: dict[str, Any], files: Mapping[str, Path]) -> None:
    """Draw a document as a picture, and as a page with its tables, where they are asked for."""
    if not files:
        return
    from pipelines.drawing.picture import picture
    from pipelines.report.noise_page import noise_chart, noise_page

    if "picture" in files:
        publish(files["picture"], picture(noise_chart(document), files["picture"].suffix.lower()), "plot")
    if "page" in files:
        publish(files["page"], noise_page(document), "page")


app = group(SUMMARY, {"allan": allan, "psd": psd})
