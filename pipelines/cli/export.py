"""``tumbleline export``: coefficients for firmware, autopilots and spreadsheets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from pkgutil import iter_modules
from typing import TYPE_CHECKING, Annotated

from pipelines.archive import Archive, Run, files
from pipelines.cli.options import ArchiveOption, JsonOption, RunArgument, option
from pipelines.cli.printing import STANDARD_OUTPUT, print_text, remark
from schemas.errors import WrongUse, did_you_mean

PART = "Results"
ORDER = 340
SUMMARY = "Write coefficients for firmware and autopilots."
EXAMPLES = (
    "tumbleline export latest --format c --output calibration.h",
    "tumbleline export latest --format px4 --nominal 256000 --units SN1 --device-id 1310988 --output SN1.params",
)

BINARY = ".mat"

_FOLDER = Path(__file__).parent.parent / "export" / "formats"
_FORMATS = {module.name: "" for module in iter_modules([str(_FOLDER)])}  # their names, without importing them
for _name in _FORMATS:  # the first line of a module says what it writes
    _line = (_FOLDER / f"{_name}.py").read_text(encoding="utf-8").partition("\n")[0]
    _FORMATS[_name] = _line.strip('"').partition(": ")[2].replace("``", "")
EPILOG = ("Formats:", *(f"{name}: {text}" for name, text in _FORMATS.items()))


if TYPE_CHECKING:
    from pipelines.export import UnitCalibration
    from pipelines.export.settings import Firmware


def command(
    run: RunArgument = "latest",
    form: Annotated[str, option("--format", f"{', '.join(_FORMATS)}; described below.")] = "json",
    units: Annotated[str, option("--units SN,…", "Export only these units; default: all that passed.")] = "",
    output: Annotated[
        Path | None,
        option(
            "--output -o FILE|DIR",
            "Output file, or a folder where each unit has a file of its own; default, or -: standard output.",
        ),
    ] = None,
    nominal: Annotated[
        float | None,
        option(
            "--nominal",
            "ardupilot, betaflight, px4: output per g by which the driver divides; that of the device's preset.",
        ),
    ] = None,
    device_id: Annotated[
        str,
        option(
            "--device-id ID|SN=ID,…",
            "px4 (CAL_ACC0_ID), ardupilot (INS_ACC_ID): number of the sensor in the autopilot.",
        ),
    ] = "",
    sensor: Annotated[int, option("--sensor 0…3", "ardupilot, px4: place of the accelerometer in the autopilot.")] = 0,
    arithmetic: Annotated[str, option("--arithmetic double|float|q24", "c: arithmetic of the code.")] = "double",
    rate: Annotated[
        float | None, option("--rate HZ", "kalibr, ros: rate of the receiver; that of the static record.", min=1e-9)
    ] = None,
    counts_per_g: Annotated[int, option("--counts-per-g", "betaflight: counts of 1 g (acc_1G).")] = 2048,
    low_pass: Annotated[str, option("--filter KIND", "c: low-pass of the force, as in correct; with --rate.")] = "",
    cutoff: Annotated[float | None, option("--cutoff HZ", "c: its -3 dB frequency, as in correct.", min=1e-9)] = None,
    turn_on: Annotated[float | None, option("--turn-on UG", "c, with --track: as in correct.", min=0.0)] = None,
    teds: Annotated[
        str,
        option(
            "--teds KEY=VALUE,…",
            "teds: manufacturer, model, version (A1), mass_g, initials, and period_days where no certificate states it.",
        ),
    ] = "",
    step: Annotated[float, option("--step S", "c, with --track: as in correct.", min=1e-3)] = 1.0,
    archive: ArchiveOption = None,
    *,
    track: Annotated[bool, option("--track", "c: with the filter of the bias, as in correct.")] = False,
    failed: Annotated[bool, option("--failed", "Also export units that failed their limits.")] = False,
    revoked: Annotated[bool, option("--revoked", "Also export units whose calibration was revoked.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Write coefficients: bias b and response K as polynomials in temperature, to apply as a = K⁻¹(ã − b).

    Files for autopilots hold one unit each, and state in µg what the format cannot hold. Only units that passed are exported;
    revoked calibrations are left out. An option that begins with names of formats is for these formats.
    """
    from pipelines.certificates.coefficient_remarks import signature_remarks
    from pipelines.certificates.measured import measured_on
    from pipelines.export import FORMATS, ExportSettings, device_ids, export_files, unit_calibrations
    from pipelines.export.teds import data_sheet
    from pipelines.jobs.model_files import use_formulas_of

    form = "json" if as_json else form
    if form not in FORMATS:
        raise WrongUse(f"export: no format is called '{form}'; {did_you_mean(form, FORMATS)}")
    source = Archive(archive).run(run)
    use_formulas_of(source)
    serials = tuple(serial.strip() for serial in units.split(",")) if units else ()
    chosen = unit_calibrations(source, serials, failed=failed, revoked=revoked)
    ids = device_ids(device_id, [c.unit for c in chosen])
    settings = ExportSettings(nominal, ids, sensor, arithmetic, rate, counts_per_g)
    if form == "teds":
        settings = replace(settings, data_sheet=data_sheet(teds, measured_on(source)))
    if low_pass or track:
        settings = replace(
            settings, firmware=_firmware(source, chosen, form, (low_pass, cutoff, rate), (track, step, turn_on))
        )
    contents = export_files(form, chosen, source.id, settings)
    _print_certificates(source, chosen, signature_remarks(source, [c.unit for c in chosen]))
    _write(contents, output)


def _firmware(
    run: Run,
    chosen: Sequence[UnitCalibration],
    form: str,
    low_pass: tuple[str, float | None, float | None],
    tracking: tuple[bool, float, float | None],
) -> Firmware:
    """The low-pass and the models of the bias that C code gets.

    low_pass : kind, cut-off and rate, Hz · tracking : whether, step in s, change of the bias from switch-on to switch-on in µg
    """
    from pipelines.export.filtering import chosen_filter
    from pipelines.export.settings import Firmware, bias_models

    kind, cutoff, rate = low_pass
    if form != "c":
        raise WrongUse(
            f"export: --filter and --track are for format c, found {form}; leave them out, or add --format c"
        )
    if kind and rate is None:
        raise WrongUse("export: --filter needs the rate of the receiver's samples; add --rate HZ")
    if kind and cutoff is None and len(chosen) > 1:
        raise WrongUse(f"export: {len(chosen)} units share one filter, its cut-off is needed; add --cutoff HZ")
    made = (
        chosen_filter(kind, cutoff, rate, Archive(run.archive.root), chosen[0].unit)[0]
        if kind and rate is not None
        else None
    )
    wanted, step, turn_on = tracking
    models = bias_models(run, [unit.unit for unit in chosen], step, turn_on) if wanted else None
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


def _print_certificates(run: Run, chosen: Sequence[UnitCalibration], signers: Sequence[str]) -> None:
    """Print the state of the certificates of these coefficients on standard error."""
    from pipelines.certificates.coefficient_remarks import library_remarks
    from pipelines.certificates.days import today
    from pipelines.export import revoked_units
    from pipelines.stages.uncertainty.budget_terms import archived_terms

    given, day = {c.unit for c in chosen}, today()
    lines = [f"left out: {unit}, {one.sentence()}" for unit, one in revoked_units(run).items() if unit not in given]
    lines += [f"{c.unit}: {c.certified}" for c in chosen if c.certificate is not None and not c.certificate.holds(day)]
    terms = archived_terms(run.about)
    if terms is not None and terms.follows is not None:
        lines.append(
            f"the coefficients hold at {terms.follows.nominal_V:g} V of supply: multiply the raw output by that over the "
            "measured supply before they are applied, or read it with a converter that is referred to the supply"
        )
    bare = [c.unit for c in chosen if c.certificate is None]
    if bare:
        lines.append(f"not certified: {', '.join(bare)}; 'tumbleline certify {run.id}' gives them a period of validity")
    lines += [*library_remarks(run), *signers]
    for line in lines:
        remark(f"export: {line}")
