"""``tumbleline correct``: apply a calibration to a recording, and track the bias where the force is known."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from pipelines.archive import Archive, files
from pipelines.cli import options
from pipelines.cli.options import Setting, argument, option
from pipelines.cli.printing import (
    STANDARD_OUTPUT,
    conclude,
    error_console,
    is_standard_output,
    print_text,
    remark,
    say,
    short,
)
from schemas.errors import WrongUse

if TYPE_CHECKING:
    from pipelines.export.corrected import Corrected
    from pipelines.export.documents import CorrectDocument, TrackedBiasDocument
    from pipelines.export.recording import CorrectableRecording

PART = "Results"
ORDER = 345
SUMMARY = "Correct a recording with a calibration, and track the bias."
EXAMPLES = (
    "tumbleline correct flight.csv latest:SN1 --output corrected.csv",
    "tumbleline correct bench.csv latest:SN1 --track at-rest --set turn_on=300 --output corrected.parquet",
)


AT_REST, NOT = "at-rest", "none"
SETTINGS = {
    "gravity": Setting("M/S2", "local gravity at rest, m/s², that of the run by default", float),
    "turn_on": Setting("UG", "change of the bias from switch-on to switch-on, µg (standard deviation)", float, 0.0),
    "step": Setting("S", "time between updates of the bias, 1 s by default", float, 1e-3),
}


def command(
    file: Annotated[Path, argument("FILE", "Raw output over time; the temperature as unit_C.")],
    calibration: options.CalibrationArgument = "latest",
    output: Annotated[
        Path | None, option("--output -o FILE", "Corrected samples, as .csv or .parquet; -: as CSV on standard output.")
    ] = None,
    columns: options.MapOption = None,
    rate: options.RateOption = None,
    track: Annotated[
        list[str] | None,
        option(
            "--track at-rest|X,Y,Z|none",
            "Track the bias: where the unit is at rest, by the magnitude of gravity; or by the true specific force, g, of all "
            "samples, before columns of the file; none: not at all. May be repeated.",
        ),
    ] = None,
    low_pass: options.FilterOption = "",
    state: Annotated[
        Path | None, option("--state FILE", "Go on with filter and bias as kept in this file, and keep them in it.")
    ] = None,
    setting: Annotated[list[str] | None, options.set_option(SETTINGS)] = None,
    include: options.IncludeOption = None,
    effect_file: options.EffectFileOption = None,
    archive: options.ArchiveOption = None,
    *,
    as_json: options.JsonOption = False,
) -> None:
    """Correct a recording: a = K⁻¹(ã − b) with all effects of the model, and the covariance of each sample.

    The bias is tracked where the specific force is known (--track X,Y,Z, or columns force_x, force_y, force_z of the file, unless
    --track none) or the unit is at rest (--track at-rest); between updates its standard deviation grows according to the unit's
    noise. --filter smooths the corrected force and delays it, as stated. Exit status 1: the updates contradict the stated noise.
    """
    from pipelines.export import filtering
    from pipelines.export.corrected import corrected, fit_of_unit
    from pipelines.export.correction import correction_document, tracking_of
    from pipelines.export.recording import at_calibrated_supply, read_recording, without_force
    from pipelines.jobs.model_files import use_fitted_model
    from pipelines.stages.uncertainty.budget_terms import archived_terms

    printed = is_standard_output(output, "correct", as_json=as_json)
    name, _, unit = calibration.partition(":")
    time, named = options.mapped_outputs(columns)
    given = options.settings(setting, SETTINGS, "correct")
    forces = [value for value in track or () if value != AT_REST]
    if len(forces) > 1 or (NOT in forces and len(track or ()) > 1):
        raise WrongUse(f"correct: --track {' and '.join(track or ())}, one of them is needed; leave the others out")
    store = Archive(archive)
    run = store.run(name)
    use_fitted_model(run, effect_file)
    fit = fit_of_unit(run, unit, **options.included(include))
    with error_console().status(f"reading {file.name}"):
        exported = fit.exported
        recording = read_recording(file, named, time=time, rate_hz=rate, axes=exported.axes, unit=exported.out_unit)
    recording = at_calibrated_supply(recording, run)
    terms = archived_terms(run.about)
    turn_on = given.get("turn_on")
    if turn_on is None and terms is not None and terms.stability is not None:
        turn_on = terms.stability.switch_on_ug
    if NOT in forces:
        recording, forces = without_force(recording), []
    tracking = tracking_of(
        run, recording, "".join(forces), given.get("gravity"), turn_on, given.get("step", 1.0),
        at_rest=AT_REST in (track or ()),
    )  # fmt: skip
    serial = fit.exported.unit
    begin = None if state is None else filtering.read_state(state, serial)
    if tracking is not None and begin is not None:
        tracking = replace(tracking, begin=begin.track)
    done = corrected(recording, fit, tracking)
    chosen, end, source = None, None, ""
    if low_pass:
        chosen, source = filtering.chosen_filter(
            *options.filter_of(low_pass), filtering.filter_rate(recording, begin), store, serial
        )
        done, end = filtering.filtered(recording, done, chosen, begin)
    if output is not None:
        _write(recording, done, output)
    document = correction_document(recording, fit, done, tracking, None if printed else output)
    document["filter"] = None if chosen is None else filtering.filter_document(chosen, source)
    if state is not None:
        passed = None if chosen is None or end is None else (chosen, end)
        filtering.write_state(state, filtering.Kept(serial, float(recording.time[-1]), passed, done.kept))
        document["state"] = str(state)
    consistent = document["bias"] is None or document["bias"]["stated_uncertainty"] != "too small"
    conclude(document, partial(_print, remark if printed else say), as_json=as_json, passed=consistent)


def _write(recording: "CorrectableRecording", done: "Corrected", output: Path) -> None:
    from pipelines.export.corrected import table_of

    table = table_of(recording, done)
    if output.suffix == ".parquet":
        data = table.to_parquet(index=False)
    elif output.suffix == ".csv" or output == STANDARD_OUTPUT:
        data = table.to_csv(index=False, lineterminator="\n", float_format="%.10g").encode()
    else:
        raise WrongUse(f"--output: found '{output.name}', a name that ends in .csv or .parquet is needed; correct it")
    if output == STANDARD_OUTPUT:
        print_text(data.decode())
    else:
        files.publish(output, data, "correct", files.ELSEWHERE)


VERDICTS = {
    "consistent": "the stated uncertainty agrees with the innovations",
    "too large": "the stated uncertainty is larger than needed",
    "too small": "the stated uncertainty is TOO SMALL: the noise of the unit or the stated force is wrong",
}


def _print(show: Callable[..., None], document: "CorrectDocument") -> None:
    certificate = document["certificate"]
    show(
        f"{document['file']}: {document['samples']} samples corrected with unit {document['unit']} of run {document['run']}"
    )
    show(f"certificate {certificate['certificate']}" if certificate else "not certified")
    show(f"standard uncertainty of a sample, µg: {_axes(document['u_ug'])} ({', '.join(document['u_contains'])})")
    if document["outside_temperature"]:
        low, high = document["temperatures_C"]
        show(f"{document['outside_temperature']} samples are outside the measured {low:.1f} to {high:.1f} °C", "yellow")
    if (used := document["filter"]) is not None:
        show(
            f"filter: {used['kind']}, {len(used['numerator'])} coefficients, -3 dB at {used['cutoff_hz']:.4g} Hz "
            f"({used['cutoff_from']}), delay {1e3 * used['delay_s']:.3g} ms, noise bandwidth {used['noise_bandwidth_hz']:.4g} Hz"
        )
    if document["bias"] is not None:
        _print_bias(document["bias"], show)
    if document["output"]:
        show(f"written: {document['output']}")
    if document["state"]:
        show(f"kept for the next recording: {document['state']}")


def _print_bias(bias: "TrackedBiasDocument", show: Callable[..., None]) -> None:
    """Print the tracked bias, and whether the innovations agree with the stated noise."""
    show(f"force by which the bias is tracked: {'; '.join(bias['force_from'])}")
    show(f"bias at the end, µg: {_axes(bias['last_ug'])}; standard uncertainty: {_axes(bias['u_last_ug'])}")
    limits = bias["u_last_at_limits_ug"]
    if limits is not None and any(limits[axis] > 1.2 * bias["u_last_ug"][axis] for axis in limits):
        show(f"with the upper limits of noise terms that the static record does not identify: {_axes(limits)}")
    show(f"updates: {bias['updates']} of {bias['steps']} steps, {bias['rejected']} beyond 5 σ rejected")
    stated, (low, high) = bias["stated_uncertainty"], bias["nis_bounds"]
    if stated is None:
        show("too few updates to judge the noise of the unit", "yellow")
        return
    nis = f"NIS {short(bias['nis'])} ({short(low)} to {short(high)})"
    figures = f"{nis}, lag 1 {short(bias['lag_1'])} (± {short(bias['lag_1_bound'])})"
    show(f"{figures}: {VERDICTS[stated]}", "yellow" if stated == "too small" else "")


def _axes(values: dict[str, float]) -> str:
    return ", ".join(f"{axis} {short(value)}" for axis, value in values.items())
