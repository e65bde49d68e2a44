"""``tumbleline station program``: write the coefficients of a run into its devices, and verify them there."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from pipelines.archive import Archive
from pipelines.cli.options import (
    ArchiveOption,
    JsonOption,
    RunArgument,
    Setting,
    StationOption,
    option,
    set_option,
    settings,
)
from pipelines.cli.options import yes as yes_or_no
from pipelines.cli.printing import give, print_table, remark, say
from schemas.errors import DONE, PART_FAILED, WrongUse, did_you_mean

if TYPE_CHECKING:
    from pipelines.archive import Run
    from pipelines.export import UnitCalibration
    from schemas.station import StationConfig

UNATTENDED = "program: standard input ended before an answer, a line is needed; give --yes to write without an operator"


FORMS = ("float32", "q24", "teds")
SETTINGS = {
    "tolerance": Setting("UG", "largest allowed error in the two poses, 3000 µg by default", float, 1.0),
    "offset_registers": Setting("yes", "also write the offset registers of an ADXL355", yes_or_no),
    "teds": Setting("KEY=VALUE,…", "teds: as in export"),
}


def program(
    run: RunArgument = "latest",
    station: StationOption = None,
    units: Annotated[str, option("--units SN,…", "Write only these units; default: all that passed.")] = "",
    form: Annotated[
        str,
        option(
            "--format float32|q24|teds", "Form of the coefficients, or the data sheet of IEEE 1451.4 instead of them."
        ),
    ] = "float32",
    setting: Annotated[list[str] | None, set_option(SETTINGS)] = None,
    archive: ArchiveOption = None,
    *,
    yes: Annotated[bool, option("--yes -y", "Write without confirmation.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Write the coefficients of a run into the memory of its devices, which are in the slots of the run.

    For each unit: archive the content of the memory, write the older of its two copies, read it back, power cycle, read it
    back, and verify in two poses. The unit's certificate ends before the first write and is renewed after the verification.
    If a step fails, the unit is not certified, and the previously valid copy is unchanged. Exit status 1: a unit failed.
    """
    from pipelines.programming.job import chosen_units, document, program_run, station_of
    from pipelines.programming.outcome import Choice
    from schemas.foreign import shown
    from schemas.station import load_station

    if form not in FORMS:
        raise WrongUse(f"--format: found '{shown(form)}'; {did_you_mean(form, FORMS)}")
    given = settings(setting, SETTINGS, "program")
    source = Archive(archive).run(run)
    chosen = chosen_units(source, [serial.strip() for serial in units.split(",") if serial.strip()])
    config = load_station(station) if station is not None else station_of(source)
    if not yes and not _agreed(source.id, config.name, chosen):
        say("nothing was written")
        raise typer.Exit(DONE)
    if form == "teds":
        _write_teds(source, chosen, config, given.get("teds", ""), as_json=as_json)
    outcomes, certificates = program_run(
        source,
        chosen,
        config,
        Choice(form, given.get("offset_registers", False), given.get("tolerance", 3000.0)),
        lambda text: remark(f"program: {text}"),
    )
    result = document(source, outcomes, certificates)
    give(result, _print, as_json=as_json)
    raise typer.Exit(PART_FAILED if any(outcome.outcome != "proved" for outcome in outcomes) else DONE)


def _write_teds(
    source: "Run",
    chosen: "Sequence[tuple[int, UnitCalibration]]",
    config: "StationConfig",
    sheet: str,
    *,
    as_json: bool,
) -> NoReturn:
    """Write a data sheet into the memory of each device; Exit status 1: a unit failed."""
    from pipelines.certificates.measured import measured_on
    from pipelines.export.teds import data_sheet
    from pipelines.programming.teds import program_teds

    stated = data_sheet(sheet, measured_on(source))
    outcomes = program_teds(source, chosen, config, stated, lambda text: remark(f"program: {text}"))
    give({"run": source.id, "teds": [outcome.document() for outcome in outcomes]}, _print_teds, as_json=as_json)
    raise typer.Exit(PART_FAILED if any(outcome.outcome != "proved" for outcome in outcomes) else DONE)


def _print_teds(result: dict[str, Any]) -> None:
    rows = [
        [sheet["unit"], sheet["outcome"], ", ".join(page["axis"] for page in sheet["pages"])]
        for sheet in result["teds"]
    ]
    print_table(["unit", "outcome", "pages"], rows, title=f"run {result['run']}: TEDS")
    for sheet in result["teds"]:
        if sheet["outcome"] == "failed":
            say(f"  {sheet['unit']} failed at '{sheet['step']}': {sheet['reason']}")


def _agreed(run: str, station: str, chosen: "Sequence[tuple[int, UnitCalibration]]") -> bool:
    from pipelines.cli.terminal import agreed

    for slot, unit in chosen:
        remark(f"  slot {slot:>2}  {unit.unit}  {unit.certified}")
    question = f"Write the coefficients of run {run} into {len(chosen)} devices on station {station}?"
    return agreed(question, "y or Enter writes, n writes nothing", UNATTENDED)


def _print(result: dict[str, Any]) -> None:
    rows = []
    for unit in result["units"]:
        worst = max((abs(error) for pose in unit["poses"] for error in pose["error_ug"]), default=None)
        rows.append(
            [
                unit["unit"],
                unit["outcome"],
                unit["copy"] if unit["sequence"] else "",
                "" if unit["sequence"] is None else str(unit["sequence"]),
                unit["crc32"] if unit["sequence"] else "",
                "" if worst is None else f"{worst:.0f}",
                unit["certificate"] or "not certified",
            ]
        )
    heads = ["unit", "outcome", "copy", "sequence", "CRC-32", "largest error, µg", "certificate"]
    print_table(heads, rows, title=f"run {result['run']}")
    for unit in result["units"]:
        if unit["outcome"] == "failed":
            say(f"  {unit['unit']} failed at '{unit['step']}': {unit['reason']}")
