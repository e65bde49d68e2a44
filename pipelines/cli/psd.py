"""``tumbleline psd``: power spectral density of a file or a run, and the Allan deviation that follows from it."""

from typing import Annotated, Any

from pipelines.cli import options
from pipelines.cli.options import option
from pipelines.cli.printing import error_console, give, print_table, say, short
from schemas.errors import WrongUse

PART = "Results"
ORDER = 375
SUMMARY = "Compute the power spectral density of a record, and the Allan deviation from it."
EXAMPLES = ("tumbleline psd rest.csv --rate 100", "tumbleline psd rest.csv --rate 100 --plot psd.png")


def command(
    source: options.SeriesArgument,
    columns: options.SeriesColumnsOption = "",
    time: options.TimeColumnOption = "",
    time_unit: options.TimeUnitOption = "s",
    rate: options.RateOption = None,
    unit: options.SeriesUnitOption = "",
    segment: Annotated[
        int | None, option("--segment N", "Samples of a segment; an eighth of the record by default.")
    ] = None,
    stretch: options.StretchOption = None,
    plot: options.PlotOption = None,
    page: options.PageOption = None,
    archive: options.ArchiveOption = None,
    *,
    as_json: options.JsonOption = False,
) -> None:
    """Compute the one-sided power spectral density by Welch's method, and σ(τ) from it beside that of the samples.

    σ²(τ) = 2·∫ S(f)·sin⁴(πfτ)/(πfτ)² df (IEEE Std 952). Where the two differ, the record holds lines, jumps or a drift.
    """
    from pipelines.chain.noise_documents import psd_document
    from pipelines.cli.allan import even_series, write_pictures

    series = even_series(source, columns, (time, time_unit, rate), unit, archive, stretch)
    if series is None:
        raise WrongUse(
            f"psd: run {source} was captured, a file or an import is needed; export its samples, or see 'tumbleline allan'"
        )
    with error_console().status("averaging"):
        document = psd_document(series, segment)
    write_pictures(document, plot, page)
    give(document, _print, as_json=as_json)


def _print(document: dict[str, Any]) -> None:
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
