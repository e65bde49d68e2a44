"""``tumbleline export``: coefficients for firmware, autopilots and spreadsheets."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from pkgutil import iter_modules
from typing import TYPE_CHECKING, Annotated, Any

from pipelines.archive import Archive, Run, files
from pipelines.cli.next_commands import archive_words, command_line
from pipelines.cli.options import (
    ArchiveOption,
    EffectFileOption,
    FilterOption,
    IncludeOption,
    JsonOption,
    RunArgument,
    Setting,
    filter_of,
    included,
    option,
    set_option,
    settings,
    yes,
)
from pipelines.cli.printing import STANDARD_OUTPUT, is_standard_output, print_text, remark, say
from schemas.errors import WrongUse, did_you_mean

if TYPE_CHECKING:
    from pipelines.export.waveforms import Channel


PART = "Results"
ORDER = 340
SUMMARY = "Write coefficients for firmware and autopilots, or waveforms for other programs."
EXAMPLES = (
    "tumbleline export latest --format c --output calibration.h",
    "tumbleline export latest --format px4 --units SN1 --set nominal=256000 --set device_id=1310988 --output SN1.params",
)

BINARY = ".mat"

_FOLDER = Path(__file__).parent.parent / "export" / "formats"
_FORMATS = {module.name: "" for module in iter_modules([str(_FOLDER)])}  # their names, without importing them
for _name in _FORMATS:  # the first line of a module says what it writes
    _line = (_FOLDER / f"{_name}.py").read_text(encoding="utf-8").partition("\n")[0]
    _FORMATS[_name] = _line.strip('"').partition(": ")[2].replace("``", "")
EPILOG = ("Formats of coefficients:", *(f"{name}: {text}" for name, text in _FORMATS.items()))


if TYPE_CHECKING:
    from pipelines.export import UnitCalibration
    from pipelines.export.settings import Firmware


WAVEFORMS = "csv, hdf5, lvm, mat, tdms, uff58, wav"  # names of the writers, which help does not import
SETTINGS = {
    "nominal": Setting(
        "N", "ardupilot, betaflight, px4: output per g by which the driver divides, the preset's by default", float
    ),
    "device_id": Setting(
        "ID|SN=ID,…", "px4 (CAL_ACC0_ID), ardupilot (INS_ACC_ID): number of the sensor in the autopilot"
    ),
    "sensor": Setting("0…3", "ardupilot, px4: place of the accelerometer in the autopilot", int, 0.0),
    "arithmetic": Setting("double|float|q24", "c: arithmetic of the code"),
    "counts_per_g": Setting("N", "betaflight: counts of 1 g (acc_1G), 2048 by default", int, 1.0),
    "teds": Setting(
        "KEY=VALUE,…",
        "teds: manufacturer, model, version (A1), mass_g, initials, and period_days where no certificate states it",
    ),
    "track": Setting("yes", "c: with the filter of the bias, as in correct", yes),
    "turn_on": Setting("UG", "c, with track: as in correct", float, 0.0),
    "step": Setting("S", "c, with track: as in correct", float, 1e-3),
}


def command(
    run: RunArgument = "latest",
    form: Annotated[
        str, option("--format NAME", f"{', '.join(_FORMATS)}; see below. json, with --waveforms csv, by default.")
    ] = "",
    units: Annotated[str, option("--units SN,…", "Only these units; default: all that passed.")] = "",
    output: Annotated[
        Path | None,
        option(
            "--output -o FILE|DIR",
            "Output file, or a folder where each unit has a file of its own; default, or -: standard output.",
        ),
    ] = None,
    rate: Annotated[
        float | None, option("--rate HZ", "kalibr, ros: rate of the receiver; that of the static record.", min=1e-9)
    ] = None,
    low_pass: FilterOption = "",
    setting: Annotated[list[str] | None, set_option(SETTINGS)] = None,
    include: IncludeOption = None,
    waveforms: Annotated[
        int | None,
        option("--waveforms N", f"Instead, the waveforms of this record of a test, from 0, of one unit: {WAVEFORMS}."),
    ] = None,
    effect_file: EffectFileOption = None,
    archive: ArchiveOption = None,
    *,
    as_json: JsonOption = False,
) -> None:
    """Write coefficients: bias b and response K as polynomials in temperature, to apply as a = K⁻¹(ã − b).

    Files for autopilots hold one unit each, and state in µg what the format cannot hold. Only units that passed are exported;
    revoked calibrations are left out. A setting that begins with names of formats is for these formats.

    With --waveforms the channels of a unit and of the reference sensor are written, with unit and sample interval; a format that
    holds only one clock gets one file for each clock: ``…_units`` and ``…_reference``.
    """
    from pipelines.certificates.coefficient_remarks import signature_remarks
    from pipelines.certificates.measured import measured_on
    from pipelines.export import FORMATS, ExportSettings, device_ids, export_files, unit_calibrations
    from pipelines.export.swept_teds import is_sweep, swept_files
    from pipelines.export.teds import data_sheet
    from pipelines.jobs.model_files import use_fitted_model

    if as_json and (waveforms is not None or form not in {"", "json"}):
        other = "--waveforms writes files" if waveforms is not None else f"--format {form} is another form"
        raise WrongUse(f"export: --json prints coefficients, {other}, one is possible; leave one out")
    if waveforms is not None:
        write_record(Archive(archive).run(run), waveforms, units, form or "csv", output)
        return
    form = form or "json"
    given = settings(setting, SETTINGS, "export")
    if form not in FORMATS:
        raise WrongUse(f"export: no format is called '{form}'; {did_you_mean(form, FORMATS)}")
    source = Archive(archive).run(run)
    use_fitted_model(source, effect_file)
    serials = tuple(serial.strip() for serial in units.split(",")) if units else ()
    if form == "teds" and is_sweep(source):
        sheet = data_sheet(given.get("teds", ""), measured_on(source))
        _write(swept_files(source, serials, sheet, **included(include)), output)
        return
    chosen = unit_calibrations(source, serials, **included(include))
    ids = device_ids(given.get("device_id", ""), [c.unit for c in chosen])
    stated = {key: given[key] for key in ("nominal", "sensor", "arithmetic", "counts_per_g") if key in given}
    receiver = ExportSettings(device_ids=ids, rate_hz=rate, **stated)
    if form == "teds":
        receiver = replace(receiver, data_sheet=data_sheet(given.get("teds", ""), measured_on(source)))
    if low_pass or given.get("track"):
        receiver = replace(receiver, firmware=_firmware(source, chosen, form, (low_pass, rate), given))
    contents = export_files(form, chosen, source.id, receiver)
    _print_certificates(source, chosen, signature_remarks(source, [c.unit for c in chosen]), archive)
    _write(contents, output)


def _firmware(
    run: Run,
    chosen: "Sequence[UnitCalibration]",
    form: str,
    low_pass: tuple[str, float | None],
    given: dict[str, Any],
) -> "Firmware":
    """The low-pass and the models of the bias that C code gets.

    low_pass : as it was given, and rate, Hz · given : settings
    """
    from pipelines.export.filtering import chosen_filter
    from pipelines.export.settings import Firmware, bias_models

    text, rate = low_pass
    kind, cutoff = filter_of(text) if text else ("", None)
    if form != "c":
        raise WrongUse(f"export: --filter and track are for format c, found {form}; leave them out, or add --format c")
    if kind and rate is None:
        raise WrongUse("export: --filter needs the rate of the receiver's samples; add --rate HZ")
    if kind and cutoff is None and len(chosen) > 1:
        raise WrongUse(
            f"export: {len(chosen)} units share one filter, its cut-off is needed; give it as --filter {kind}:HZ"
        )
    made = (
        chosen_filter(kind, cutoff, rate, Archive(run.archive.root), chosen[0].unit)[0]
        if kind and rate is not None
        else None
    )
    step = given.get("step", 1.0)
    units = [unit.unit for unit in chosen]
    models = bias_models(run, units, step, given.get("turn_on")) if given.get("track") else None
    return Firmware(made, models, step)


def _write(contents: dict[str, bytes], output: Path | None) -> None:
    """Write the files: one to standard output, a file or a folder, several to a folder only."""
    (name, content), *others = contents.items()
    if output is None or output == STANDARD_OUTPUT:
        if others:
            raise WrongUse(
                f"export: {len(contents)} files in this format, one can be printed; give a folder with --output, or choose a "
                "unit with --units"
            )
        if name.endswith(BINARY):
            raise WrongUse(f"export: {name} is not text and cannot be printed; give a file with --output")
        print_text(content.decode())
        return
    folder = bool(others) or output.is_dir()
    for file, data in contents.items():
        files.publish(output / file if folder else output, data, "export", "give another file with --output")
    if folder:
        remark(f"export: {len(contents)} files in {output}")


def _print_certificates(
    run: Run, chosen: "Sequence[UnitCalibration]", signers: Sequence[str], archive: str | None
) -> None:
    """Print the state of the certificates of these coefficients on standard error."""
    from pipelines.certificates.coefficient_remarks import library_remarks
    from pipelines.certificates.days import today
    from pipelines.export import revoked_units
    from pipelines.stages.uncertainty.budget_terms import archived_terms

    given, day = {c.unit for c in chosen}, today()
    lines = [
        f"left out: {unit}, {revoked.sentence()}" for unit, revoked in revoked_units(run).items() if unit not in given
    ]
    lines += [
        f"{c.unit}: {c.certified}"
        for c in chosen
        if c.certificate is not None and not c.reasons and not c.certificate.holds(day)
    ]
    terms = archived_terms(run.about)
    if terms is not None and terms.follows is not None:
        lines.append(
            f"the coefficients hold at {terms.follows.nominal_V:g} V of supply: multiply the raw output by that over the "
            "measured supply before they are applied, or read it with a converter that is referred to the supply"
        )
    lines += [f"{c.unit} {c.certified}" for c in chosen if c.reasons]
    bare = {c.unit: c.outcome for c in chosen if c.certificate is None and not c.reasons}
    if bare:
        lines.append(f"not certified: {', '.join(bare)}")
    if "pass" in bare.values():
        issue = command_line("certificate", "issue", run.id, *archive_words(archive))
        lines[-1] += f"; '{issue}' gives them a period of validity"
    lines += [*library_remarks(run), *signers]
    for line in lines:
        remark(f"export: {line}")


def write_record(run: "Run", record: int, unit: str, form: str, output: Path | None) -> None:
    """Write the channels of a unit and of the reference in a record of a run; print the files.

    unit : serial number; empty for the first unit of the record
    Raises WrongUse: no such record, unit or format.
    """
    from pipelines.export.waveforms import channels_of, write_waveforms, writer_of

    suffix = writer_of(form).suffix
    channels = channels_of(run, record, unit)
    if is_standard_output(output, "export"):
        print_text(_one_text(form, channels, suffix))
        return
    target = output or Path(f"{run.id[:12]}-record{record}{suffix}")
    names = ", ".join(channel.name for channel in channels)
    for path in write_waveforms(form, channels, target):
        say(f"{path}: {names}")


def _one_text(form: str, channels: "list[Channel]", suffix: str) -> str:
    """The file of a format of text; refused for others, and where each clock has a file of its own."""
    from pipelines.export.waveforms import files_of_waveforms

    made = files_of_waveforms(form, channels, Path(f"record{suffix}"))
    try:
        (text,) = (data.decode() for data in made.values())
    except ValueError:
        raise WrongUse(
            f"export: format {form} gives {len(made)} files or no text, one of text is needed for standard output; "
            "name a file with --output"
        ) from None
    return text
