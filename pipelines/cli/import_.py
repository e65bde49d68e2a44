"""``tumbleline import``: recordings of other systems into the archive, with an optional fit."""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any, NoReturn

from inertial.counts import number_of
from pipelines.cli.next_commands import archive_words, command_line, print_next
from pipelines.cli.options import ArchiveOption, GroupOption, JoinOption, JsonOption, argument, option
from pipelines.cli.printing import conclude, error_console, print_table, say, short, short_values
from pipelines.cli.text.verdict_text import print_verdict_of_fit
from schemas.errors import WrongUse, did_you_mean
from schemas.foreign import shown

PART = "Measure"
ORDER = 160
SUMMARY = "Import recordings of other systems into the archive."
EXAMPLES = (
    "tumbleline import acc.csv --map time=t,x=ax,y=ay,z=az --units output=LSB --unit SN1",
    "tumbleline import acc.csv --mapping columns.toml --fit norm",
)

METHODS = ("norm", "plane", "faces", "temperature")


def command(
    files: Annotated[
        list[Path],
        argument(
            "FILE…",
            "Text, Parquet, MATLAB, NumPy, WAV, LVM; with an extra spreadsheets, HDF5, UFF58, TDMS, IDE, R, ULog, "
            "DataFlash, MCAP, ROS bags, MDF, miniSEED. Also .gz.",
        ),
    ],
    columns: Annotated[str, option("--map time=…,x=…,y=…,z=…", "Meaning of the columns of the file.")] = "",
    mapping: Annotated[
        Path | None, option("--mapping TOML", "TOML file with these options; options given here have priority.")
    ] = None,
    units: Annotated[str, option("--units output=LSB,time=s,temperature=degC", "Units of the columns.")] = "",
    unit: Annotated[str, option("--unit SN", "Serial number, if no column has it.")] = "",
    rows: Annotated[str, option("--rows samples|dwells", "Content of a row; samples by default.")] = "",
    rate: Annotated[float | None, option("--rate HZ", "Rate of samples without a time.")] = None,
    axes: Annotated[str, option("--axes x,y,z", "Order of the mapped axes.")] = "",
    signs: Annotated[str, option("--signs +,+,+", "Signs of the axes in that order.")] = "",
    poses: Annotated[str, option("--poses LABEL=+x,…", "Dwells to keep by label, with the face that is up.")] = "",
    headings: Annotated[
        str, option("--headings LABEL=deg,…", "Direction of x in each pose, degrees (of y where x is vertical).")
    ] = "",
    face: Annotated[str, option("--face +x|…|-z", "The face that is up all the time.")] = "",
    blocks: Annotated[float | None, option("--blocks S", "Dwells of this length, for a record in one pose.")] = None,
    positions: Annotated[
        int | None, option("--positions N", "Positions logged back to back, without the moves.")
    ] = None,
    window: Annotated[
        float | None, option("--window S", "Sliding window of the search for dwells; 1 s by default.")
    ] = None,
    threshold: Annotated[
        float | None, option("--threshold SD", "Standard deviation in a window that means motion, in the output unit.")
    ] = None,
    shortest: Annotated[float | None, option("--shortest S", "Shortest dwell; 1 s by default.")] = None,
    gaps: Annotated[
        str, option("--gaps refuse|split", "Rows without a number, and gaps in time; refuse by default.")
    ] = "",
    faulty: Annotated[
        str, option("--faulty refuse|leave-out|keep", "Constant axes and torn words; refuse by default.")
    ] = "",
    join: JoinOption = "",
    group: GroupOption = "",
    list_dwells: Annotated[
        bool, option("--list-dwells", "List every dwell: start, end, mean, sd, residual, influence.")
    ] = False,
    local_g: Annotated[
        float | None, option("--local-g M/S2", "Local gravity at the place of the measurement, m/s².")
    ] = None,
    verify: Annotated[str, option("--verify N|N%", "Dwells that the fit does not use; they verify it.")] = "",
    references: Annotated[
        Path | None, option("--references TOML", "Uncertainty of the references; a certificate needs it.")
    ] = None,
    measured: Annotated[str, option("--measured DATE", "Day of the measurement.")] = "",
    zero_output: Annotated[float | None, option("--zero-output VALUE", "Nominal output at 0 g; 0.")] = None,
    fit: Annotated[str, option("--fit norm|plane|faces|temperature", "Fit, and judge the fit.")] = "",
    procedure: Annotated[
        str,
        option(
            "--procedure NAME",
            "Dynamic test: the transfer function of a sweep, or with --map reference=… the waveforms of a procedure.",
        ),
    ] = "",
    part: Annotated[Path | None, option("--part TOML", "Keys of the procedure, and full_scale of the output.")] = None,
    effects: Annotated[
        str, option("--effects a,b,…", "Model of the transfer function; second_order,delay by default.")
    ] = "",
    archive: ArchiveOption = None,
    *,
    as_json: JsonOption = False,
) -> None:
    """Import recordings of other systems into the archive: a raw record and its dwells in the exchange format.

    Columns are named, or numbered from 1. Nothing is guessed: what neither the file nor its numbers show must be given. Exit
    status 1: the requested fit is not adequate, or cannot be judged.
    """
    from pipelines.importers import limited

    limited.start()
    if procedure and (columns or procedure != "sweep"):
        _waveforms(files, procedure, part, unit, (columns, units, rate, group), archive, as_json=as_json)
    if procedure:
        _transfer(files, unit, effects, archive, as_json=as_json)
    from pipelines.diagnosis.import_document import import_document
    from pipelines.importers import mapping as mapped

    given: dict[str, Any] = mapped.from_file(mapping) if mapping else {}
    options: dict[str, Any] = {
        "columns": mapped.pairs(columns, "--map"),
        "units": mapped.pairs(units, "--units"),
        "poses": mapped.pairs(poses, "--poses"),
        "headings": mapped.pairs(headings, "--headings"),
        "unit": unit,
        "face": face,
        "block_s": blocks,
        "positions": positions,
        "window_s": window,
        "threshold": threshold,
        "shortest_s": shortest,
        "gaps": gaps,
        "faulty": faulty,
        "join": join,
        "group": group,
        "rows": rows,
        "rate_hz": rate,
        "axes": [part.strip() for part in axes.split(",")] if axes else None,
        "signs": [part.strip() for part in signs.split(",")] if signs else None,
        "local_gravity_m_s2": local_g,
        "verify": verify,
        "measured": measured,
        "zero_output": zero_output,
    }
    keys = given | {key: value for key, value in options.items() if value not in ("", None, {}, [])}  # 0 is a value
    if fit and fit not in METHODS:
        raise WrongUse(
            f"--fit: found '{shown(fit)}', one of {', '.join(METHODS)} is needed; {did_you_mean(fit, METHODS)}"
        )
    stated = None
    if references is not None:
        from schemas.import_references import stated_references

        stated = stated_references(references, keys)
    sets = [files] if keys.get("join") else [[path] for path in files]
    working, where = error_console().status, str(mapping or "import")
    imports = [import_document(paths, keys, where, fit, archive, stated, working) for paths in sets]
    verdicts = [one["adequate"] for one in imports if one["fit"]]
    adequate = False if False in verdicts else None if None in verdicts else True
    document = imports[0] if len(imports) == 1 else {"imports": imports, "adequate": adequate}
    show = partial(_print_imports, imports, archive, list_dwells=list_dwells)
    conclude(document, show, as_json=as_json, passed=adequate is True)


def _transfer(files: list[Path], unit: str, effects: str, archive: str | None, *, as_json: bool) -> NoReturn:
    """Judge, store and print transfer functions; a part failed where one is not adequate or cannot be judged."""
    from pipelines.importers.transfer import import_transfer

    if not unit:
        raise WrongUse("import: no serial number, a transfer function needs one; add --unit SN")
    model = [part.strip() for part in effects.split(",")] if effects else ["second_order", "delay"]
    imported = [import_transfer(path, unit, model, archive) for path in files]
    document = dict(imported[0]) if len(imported) == 1 else {"imports": imported}
    passed = all(one["adequate"] is True for one in imported)
    conclude(document, lambda _: _print_transfers(imported), as_json=as_json, passed=passed)


def _waveforms(
    paths: list[Path],
    procedure: str,
    part: Path | None,
    unit: str,
    stated: tuple[str, str, float | None, str],
    archive: str | None,
    *,
    as_json: bool,
) -> NoReturn:
    """Reduce, keep and print the recordings of one unit; a part failed where a figure is not determined.

    stated : columns and units as the options have them, rate in Hz, group
    """
    from pipelines.importers.mapping import pairs
    from pipelines.importers.waveforms import RecordingLayout, import_waveforms

    if not unit:
        raise WrongUse("import: no serial number, the recordings of a test need one; add --unit SN")
    columns, units, rate, group = stated
    layout = RecordingLayout(pairs(columns, "--map"), pairs(units, "--units"), rate, group)
    imported = import_waveforms(paths, procedure, part, unit, layout, archive)
    passed = all(one["identified"] for one in imported["figures"])
    conclude(dict(imported), _print_waveforms, as_json=as_json, passed=passed)


def _print_transfers(imports: Sequence[Mapping[str, Any]]) -> None:
    for one in imports:
        say(f"{one['unit']}: {one['points']} points, kept as run {one['run']}")
        for line in one["text"]:
            say(f"  {line}")
        print_verdict_of_fit(one["adequate"], "the model does not describe these points")


def _print_waveforms(imported: Mapping[str, Any]) -> None:
    say(f"{imported['unit']}: {imported['records']} recordings, kept as run {imported['run']}")
    rows = [
        [one["figure"], one["axis"], short(one["value"]), short(one["uncertainty"]), one["unit"], one["note"]]
        for one in imported["figures"]
    ]
    print_table(["figure", "axis", "value", "standard uncertainty", "unit", "remark"], rows, whole=2)
    for line in imported["text"]:
        say(f"  {line}")


def _print_imports(imports: Sequence[dict[str, Any]], archive: str | None, _: object, *, list_dwells: bool) -> None:
    for one in imports:
        dwells = number_of(one["dwells"], "dwell")
        rows = f"{number_of(one['samples'], 'sample')}, {dwells}" if one["samples"] else dwells
        unit = one["out_unit"] or "a unit that is not known (--units output=… states it)"
        say(f"{', '.join(one['units'])}: {rows} in {unit}, kept as run {one['run']}")
        for remark in [*one["remarks"], *one["lines"]]:
            say(f"  {remark}")
        if list_dwells:
            _print_dwells(one["dwell_list"], one["out_unit"])
        if one["fit"]:
            print_verdict_of_fit(one["adequate"], "this fit does not describe these data")
            if one["fit"] == "norm" and one["adequate"] is False:
                print_next([command_line("diagnose", one["run"], *archive_words(archive))])


def _print_dwells(dwells: list[dict[str, Any]], unit: str) -> None:
    heads = ["dwell", "label", "start, s", "end, s", "samples", f"mean x / y / z, {unit}", f"sd x / y / z, {unit}",
             "residual, µg", "influence"]  # fmt: skip
    print_table(
        heads,
        [
            [
                str(one["dwell"]),
                one["label"],
                f"{one['start_s']:.2f}",
                f"{one['end_s']:.2f}",
                "" if one["n"] is None else str(one["n"]),
                " / ".join(f"{value:.6g}" for value in one["mean"]),
                "" if one["sd"] is None else short_values(one["sd"]),
                "" if one["residual_ug"] is None else f"{one['residual_ug']:.1f}",
                short(one["influence"]),
            ]
            for one in dwells
        ],
        whole=2,
    )
