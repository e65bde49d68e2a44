"""``tumbleline correct``: apply a calibration to a recording, and track the bias where the force is known."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pipelines.cli.options import (
    ArchiveOption,
    JsonOption,
    RateOption,
    TimeColumnOption,
    console,
    error_console,
    give,
    short,
)

if TYPE_CHECKING:
    from rich.console import Console

    from pipelines.export.corrected import Corrected
    from pipelines.export.documents import CorrectDocument
    from pipelines.export.recording import CorrectableRecording

PART = "Results"
ORDER = 345
SUMMARY = "Correct a recording with a calibration, and track the bias."
EXAMPLES = (
    "tumbleline correct flight.csv --calibration latest:SN1 --output corrected.csv",
    "tumbleline correct bench.csv --calibration latest:SN1 --at-rest --turn-on 300 --output corrected.parquet",
)


def command(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Raw output over time, with a column of temperature.")],
    calibration: Annotated[
        str, typer.Option("--calibration", metavar="RUN:UNIT", help="The calibration: a run and one of its units.")
    ] = "latest",
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="Corrected samples, as .csv or .parquet; -: as CSV on standard output.",
        ),
    ] = None,
    columns: Annotated[
        str, typer.Option("--columns", metavar="x,y,z", help="Columns of the output; x,y,z or out_x,… by default.")
    ] = "",
    time: TimeColumnOption = "",
    rate: RateOption = None,
    force: Annotated[
        str, typer.Option("--force", metavar="X,Y,Z", help="True specific force, g, the same for all samples.")
    ] = "",
    gravity: Annotated[
        float | None,
        typer.Option(
            "--gravity", metavar="M_S2", help="Local gravity with --at-rest, m/s²; that of the run by default."
        ),
    ] = None,
    turn_on: Annotated[
        float | None,
        typer.Option(
            "--turn-on",
            metavar="UG",
            min=0.0,
            help="Change of the bias from switch-on to switch-on, µg (standard deviation).",
        ),
    ] = None,
    step: Annotated[
        float, typer.Option("--step", metavar="S", min=1e-3, help="Time between updates of the bias.")
    ] = 1.0,
    archive: ArchiveOption = None,
    *,
    at_rest: Annotated[
        bool, typer.Option("--at-rest", help="Find where the unit is at rest and use the magnitude of gravity there.")
    ] = False,
    failed: Annotated[bool, typer.Option("--failed", help="Also use a unit that failed its limits.")] = False,
    revoked: Annotated[bool, typer.Option("--revoked", help="Also use a revoked calibration.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Correct a recording: a = K⁻¹(ã − b) with all effects of the model, and the covariance of each sample.

    The bias is tracked where the specific force is known (--force, or columns force_x, force_y, force_z) or the unit is at rest
    (--at-rest); between updates its standard deviation grows according to the unit's noise. Exit status 1: the updates
    contradict the stated noise.
    """
    from pipelines.archive import Archive
    from pipelines.cli.standard_output import is_standard_output
    from pipelines.export.corrected import corrected, fit_of_unit
    from pipelines.export.correction import correction_document, tracking_of
    from pipelines.export.recording import at_nominal_supply, read_recording
    from pipelines.jobs.model_files import use_formulas_of
    from pipelines.jobs.terms import archived_terms
    from schemas.errors import DONE, PART_FAILED

    printed = is_standard_output(output, "correct", as_json=as_json)
    name, _, unit = calibration.partition(":")
    run = Archive(archive).run(name)
    use_formulas_of(run)
    fit = fit_of_unit(run, unit, failed=failed, revoked=revoked)
    with error_console().status(f"reading {file.name}"):
        recording = read_recording(file, [c.strip() for c in columns.split(",") if c.strip()], time=time, rate_hz=rate)
    terms = archived_terms(run.about)
    if terms is not None and terms.follows is not None:
        recording = at_nominal_supply(recording, terms.follows)
    if turn_on is None and terms is not None and terms.stability is not None:
        turn_on = terms.stability.switch_on_ug
    tracking = tracking_of(run, recording, force, gravity, turn_on, step, at_rest=at_rest)
    done = corrected(recording, fit, tracking)
    if output is not None:
        _write(recording, done, output)
    document = correction_document(recording, fit, done, None if printed else output)
    give(document, lambda _: _print(document, error_console() if printed else console()), as_json=as_json)
    consistent = document["bias"] is None or document["bias"]["stated_uncertainty"] != "too small"
    raise typer.Exit(DONE if consistent else PART_FAILED)


def _write(recording: CorrectableRecording, done: Corrected, output: Path) -> None:
    import io

    from pipelines.archive import files
    from pipelines.cli.standard_output import NAME, print_text
    from pipelines.export.corrected import table_of
    from schemas.errors import WrongUse

    table = table_of(recording, done)
    if output.suffix == ".parquet":
        sink = io.BytesIO()
        table.to_parquet(sink, index=False)
        data = sink.getvalue()
    elif output.suffix == ".csv" or output == NAME:
        data = table.to_csv(index=False, lineterminator="\n", float_format="%.10g").encode()
    else:
        raise WrongUse(f"--output: found '{output.name}', a name that ends in .csv or .parquet is needed; correct it")
    if output == NAME:
        print_text(data.decode())
    else:
        files.publish(output, data, "correct", files.ELSEWHERE)


def _print(document: CorrectDocument, out: Console) -> None:
    def line(text: str, style: str = "") -> None:
        out.print(text, style=style or None)

    def axes(values: dict[str, float]) -> str:
        return ", ".join(f"{axis} {short(value)}" for axis, value in values.items())

    certificate = document["certificate"]
    line(
        f"{document['file']}: {document['samples']} samples corrected with unit {document['unit']} of run {document['run']}"
    )
    line(f"certificate {certificate['certificate']}" if certificate else "not certified")
    line(f"standard uncertainty of a sample, µg: {axes(document['u_ug'])} ({', '.join(document['u_contains'])})")
    if document["outside_temperature"]:
        low, high = document["temperatures_C"]
        line(f"{document['outside_temperature']} samples are outside the measured {low:.1f} to {high:.1f} °C", "yellow")
    bias = document["bias"]
    if bias is not None:
        line(f"bias at the end, µg: {axes(bias['last_ug'])}; standard uncertainty: {axes(bias['u_last_ug'])}")
        limits = bias["u_last_at_limits_ug"]
        if limits is not None and any(limits[axis] > 1.2 * bias["u_last_ug"][axis] for axis in limits):
            line(f"with the upper limits of noise terms that the static record does not identify: {axes(limits)}")
        low, high = bias["nis_bounds"]
        line(f"updates: {bias['updates']} of {bias['steps']} steps, {bias['rejected']} beyond 5 σ rejected")
        verdict = {
            "consistent": "the stated uncertainty agrees with the innovations",
            "too large": "the stated uncertainty is larger than needed",
            "too small": "the stated uncertainty is TOO SMALL: the noise of the unit or the stated force is wrong",
        }
        nis = f"NIS {short(bias['nis'])} ({short(low)} to {short(high)})"
        figures = f"{nis}, lag 1 {short(bias['lag_1'])} (± {short(bias['lag_1_bound'])})"
        if bias["stated_uncertainty"] is None:
            line("too few updates to judge the noise of the unit", "yellow")
        else:
            stated = bias["stated_uncertainty"]
            line(f"{figures}: {verdict[stated]}", "yellow" if stated == "too small" else "")
    if document["output"]:
        line(f"written: {document['output']}")
