"""``tumbleline simulate``: a trajectory through a calibrated unit, as raw output with its errors, to test software with."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from pipelines.archive import Archive
from pipelines.cli import options
from pipelines.cli.options import argument, option
from pipelines.cli.printing import error_console, give, say, short
from schemas.errors import WrongUse
from schemas.foreign import shown

if TYPE_CHECKING:
    from inertial.dynamics.output_filter import OutputFilter
    from pipelines.export.documents import SimulateDocument

PART = "Results"
ORDER = 346
SUMMARY = "Pass a trajectory through a calibrated unit: its raw output with its errors."
EXAMPLES = (
    "tumbleline simulate trajectory.csv latest:SN1 --output raw.csv",
    "tumbleline simulate trajectory.csv latest:SN1 --seed none --output raw.mat",
)


NO_NOISE = "none"


def command(
    file: Annotated[
        Path, argument("FILE", "True specific force over time: time_s, force_x, force_y, force_z, unit_C.")
    ],
    output: Annotated[Path, option("--output -o FILE", "Raw samples, as .csv, .parquet, .mat or .npy.")],
    calibration: options.CalibrationArgument = "latest",
    unit_of: Annotated[str, option("--unit-of force=g|m/s^2", "Unit of measure of the force.")] = "",
    columns: options.MapOption = None,
    rate: options.RateOption = None,
    bandwidth: Annotated[
        float | None, option("--bandwidth HZ", "Of the sensor, two poles; by default none is applied.", min=1e-9)
    ] = None,
    seed: Annotated[
        str, option("--seed N|none", "Of the noise: the same gives the same samples; none: no noise.")
    ] = "0",
    include: options.IncludeOption = None,
    effect_file: options.EffectFileOption = None,
    archive: options.ArchiveOption = None,
    *,
    as_json: options.JsonOption = False,
) -> None:
    """Pass a trajectory through a calibrated unit: bias, scale, misalignment, temperature, all effects of the model, and noise.

    The columns of the quantities that the model needs stand beside the force; without unit_C it is 25 °C. 'tumbleline correct'
    of the output gives the force back.
    """
    from inertial.quantities import FORCE_COLUMNS
    from pipelines.export.corrected import fit_of_unit, rate_and_gaps
    from pipelines.export.recording import read_recording
    from pipelines.export.trajectory import simulated, simulation_document, write_output
    from pipelines.importers.mapping import pairs
    from pipelines.jobs.model_files import use_fitted_model

    time, unknown = options.mapped_outputs(columns)
    if unknown:
        raise WrongUse(
            f"simulate: --map {unknown[0]}: the force is force_x, force_y, force_z; only time=COLUMN can be mapped"
        )
    units = pairs(unit_of, "--unit-of").get("force", "g")
    if seed != NO_NOISE and not seed.isdecimal():
        raise WrongUse(f"simulate: --seed {shown(seed)}: a whole number or none is needed; correct it")
    begin = None if seed == NO_NOISE else int(seed)
    name, _, unit = calibration.partition(":")
    run = Archive(archive).run(name)
    use_fitted_model(run, effect_file)
    fit = fit_of_unit(run, unit, **options.included(include))
    with error_console().status(f"reading {file.name}"):
        recording = read_recording(file, FORCE_COLUMNS, time=time, rate_hz=rate)
    low_pass = None if bandwidth is None else _low_pass(bandwidth, rate_and_gaps(recording.time)[0])
    made = simulated(recording, units, fit, low_pass, begin)
    write_output(made, output)
    give(simulation_document(made, fit, low_pass, begin, output), _print, as_json=as_json)


def _low_pass(bandwidth_hz: float, rate_hz: float) -> "OutputFilter":
    from inertial.dynamics.output_filter import designed

    try:
        return designed("butterworth", bandwidth_hz, rate_hz)
    except ValueError as problem:
        raise WrongUse(f"--bandwidth: {problem}; give another, or a trajectory of a higher rate") from None


def _print(document: "SimulateDocument") -> None:
    of_unit = f"unit {document['unit']} of run {document['run']}, in {document['out_unit']}"
    say(f"{document['file']}: {document['samples']} samples of {of_unit}")
    for text in document["told"]:
        say(text)
    for name, values in document["noise"].items():
        say(f"noise {name}: {', '.join(short(value) for value in values)} ({', '.join(document['error_at_25_C_ug'])})")
    if not document["noise"]:
        say("without noise")
    if document["clipped"]:
        say(f"{document['clipped']} samples are at the end of the range", style="yellow")
    errors = ", ".join(f"{axis} {short(value)}" for axis, value in document["error_at_25_C_ug"].items())
    say(f"error that bias and response at 25 °C leave, µg rms: {errors}")
    say(f"written: {document['output']}")
