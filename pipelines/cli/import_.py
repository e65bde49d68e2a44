"""``tumbleline import``: recordings of other systems into the archive, with an optional fit."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from inertial.counts import number_of
from pipelines.cli.next_commands import archive_words, command_line, print_next
from pipelines.cli.options import (
    ArchiveOption,
    GroupOption,
    JoinOption,
    JsonOption,
    console,
    error_console,
    print_json,
    print_table,
    short,
    short_values,
)
from schemas.errors import DONE, PART_FAILED, WrongUse, did_you_mean
from schemas.foreign import shown

if TYPE_CHECKING:
    from pipelines.importers.content import Content
    from pipelines.importers.mapping import Mapping
    from schemas.import_references import ImportReferences

PART = "Measure"
ORDER = 160
SUMMARY = "Import recordings of other systems into the archive."
EXAMPLES = (
    "tumbleline import acc.csv --map time=t,x=ax,y=ay,z=az --units output=LSB --unit SN1",
    "tumbleline import acc.csv --mapping columns.toml --fit norm",
)

METHODS = ("norm", "plane", "faces", "temperature")
VERDICTS = {
    True: ("adequate", "bold green"),
    False: ("NOT ADEQUATE: this fit does not describe these data", "bold red"),
    None: ("CANNOT BE JUDGED: see above", "bold yellow"),
}
VERDICTS_OF_TRANSFER = {**VERDICTS, False: ("NOT ADEQUATE: the model does not describe these points", "bold red")}


def command(
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE…",
            help="Text, Parquet, MATLAB, WAV, LVM; with an extra HDF5, UFF58, TDMS, IDE, R. Also .gz.",
        ),
    ],
    columns: Annotated[
        str, typer.Option("--map", metavar="time=…,x=…,y=…,z=…", help="Meaning of the columns of the file.")
    ] = "",
    mapping: Annotated[
        Path | None,
        typer.Option(
            "--mapping", metavar="TOML", help="TOML file with these options; options given here have priority."
        ),
    ] = None,
    units: Annotated[
        str, typer.Option("--units", metavar="output=LSB,time=s,temperature=degC", help="Units of the columns.")
    ] = "",
    unit: Annotated[str, typer.Option("--unit", metavar="SN", help="Serial number, if no column has it.")] = "",
    rows: Annotated[
        str, typer.Option("--rows", metavar="samples|dwells", help="Content of a row; samples by default.")
    ] = "",
    rate: Annotated[float | None, typer.Option("--rate", metavar="HZ", help="Rate of samples without a time.")] = None,
    axes: Annotated[str, typer.Option("--axes", metavar="x,y,z", help="Order of the mapped axes.")] = "",
    signs: Annotated[str, typer.Option("--signs", metavar="+,+,+", help="Signs of the axes in that order.")] = "",
    poses: Annotated[
        str, typer.Option("--poses", metavar="LABEL=+x,…", help="Dwells to keep by label, with the face that is up.")
    ] = "",
    headings: Annotated[
        str,
        typer.Option(
            "--headings", metavar="LABEL=deg,…", help="Direction of x in each pose, degrees (of y where x is vertical)."
        ),
    ] = "",
    face: Annotated[str, typer.Option("--face", metavar="+x|…|-z", help="The face that is up all the time.")] = "",
    blocks: Annotated[
        float | None, typer.Option("--blocks", metavar="S", help="Dwells of this length, for a record in one pose.")
    ] = None,
    positions: Annotated[
        int | None, typer.Option("--positions", metavar="N", help="Positions logged back to back, without the moves.")
    ] = None,
    window: Annotated[
        float | None,
        typer.Option("--window", metavar="S", help="Sliding window of the search for dwells; 1 s by default."),
    ] = None,
    threshold: Annotated[
        float | None,
        typer.Option(
            "--threshold", metavar="SD", help="Standard deviation in a window that means motion, in the output unit."
        ),
    ] = None,
    shortest: Annotated[
        float | None, typer.Option("--shortest", metavar="S", help="Shortest dwell; 1 s by default.")
    ] = None,
    gaps: Annotated[
        str,
        typer.Option(
            "--gaps", metavar="refuse|split", help="Rows without a number, and gaps in time; refuse by default."
        ),
    ] = "",
    faulty: Annotated[
        str,
        typer.Option(
            "--faulty", metavar="refuse|leave-out|keep", help="Constant axes and torn words; refuse by default."
        ),
    ] = "",
    join: JoinOption = "",
    group: GroupOption = "",
    list_dwells: Annotated[
        bool, typer.Option("--list-dwells", help="List every dwell: start, end, mean, sd, residual, influence.")
    ] = False,
    local_g: Annotated[
        float | None,
        typer.Option("--local-g", metavar="M/S2", help="Local gravity at the place of the measurement, m/s²."),
    ] = None,
    verify: Annotated[
        str, typer.Option("--verify", metavar="N|N%", help="Dwells that the fit does not use; they verify it.")
    ] = "",
    references: Annotated[
        Path | None,
        typer.Option("--references", metavar="TOML", help="Uncertainty of the references; a certificate needs it."),
    ] = None,
    measured: Annotated[str, typer.Option("--measured", metavar="DATE", help="Day of the measurement.")] = "",
    zero_output: Annotated[
        float | None, typer.Option("--zero-output", metavar="VALUE", help="Nominal output at 0 g; 0.")
    ] = None,
    fit: Annotated[
        str, typer.Option("--fit", metavar="norm|plane|faces|temperature", help="Fit, and judge the fit.")
    ] = "",
    procedure: Annotated[
        str,
        typer.Option(
            "--procedure",
            metavar="NAME",
            help="Dynamic test: the transfer function of a sweep, or with --map reference=… the waveforms of a procedure.",
        ),
    ] = "",
    part: Annotated[
        Path | None, typer.Option("--part", metavar="TOML", help="Keys of the procedure, and full_scale of the output.")
    ] = None,
    effects: Annotated[
        str,
        typer.Option(
            "--effects", metavar="a,b,…", help="Model of the transfer function; second_order,delay by default."
        ),
    ] = "",
    archive: ArchiveOption = None,
    *,
    as_json: JsonOption = False,
) -> None:
    """Import recordings of other systems into the archive: a raw record and its dwells in the exchange format.

    Columns are named, or numbered from 1. Nothing is guessed: what neither the file nor its numbers show must be given. Exit
    status 1: the requested fit is not adequate, or cannot be judged.
    """
    if procedure and (columns or procedure != "sweep"):
        from pipelines.cli.waveform_import import import_and_print

        stated = (columns, units, rate, group)
        raise typer.Exit(import_and_print(files, procedure, part, unit, stated, archive, as_json=as_json))
    if procedure:
        raise typer.Exit(_transfer(files, procedure, unit, effects, archive, as_json=as_json))
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
    _refuse_unknown_fit(fit)
    stated = None
    if references is not None:
        from pipelines.importers.stated_references import stated_references

        stated = stated_references(references, keys)
    sets = [files] if keys.get("join") else [[path] for path in files]
    imports = [_import_one(paths, keys, str(mapping or "import"), fit, archive, stated) for paths in sets]
    verdicts = [one["adequate"] for one in imports if one["fit"]]
    adequate = False if False in verdicts else None if None in verdicts else True
    if as_json:
        print_json(imports[0] if len(imports) == 1 else {"imports": imports, "adequate": adequate})
    else:
        for one in imports:
            _print(one, archive, list_dwells=list_dwells)
    raise typer.Exit(DONE if adequate is True else PART_FAILED)


def _transfer(files: list[Path], procedure: str, unit: str, effects: str, archive: str | None, *, as_json: bool) -> int:
    """Judge and store transfer functions; the exit status is 1 if one is not adequate or cannot be judged."""
    from pipelines.importers.transfer import import_transfer

    if procedure != "sweep":
        raise WrongUse(
            f"--procedure: found '{shown(procedure)}', sweep is what can be imported; measure others with a recipe"
        )
    if not unit:
        raise WrongUse("import: no serial number, a transfer function needs one; add --unit SN")
    model = [part.strip() for part in effects.split(",")] if effects else ["second_order", "delay"]
    imported = [import_transfer(path, unit, model, archive) for path in files]
    if as_json:
        print_json(dict(imported[0]) if len(imported) == 1 else {"imports": imported})
    else:
        out = console()
        for one in imported:
            out.print(f"{one['unit']}: {one['points']} points, kept as run {one['run']}", markup=False)
            for line in one["text"]:
                out.print(f"  {line}", markup=False, soft_wrap=True)
            verdict, style = VERDICTS_OF_TRANSFER[one["adequate"]]
            out.print(f"  {verdict}", style=style)
    return DONE if all(one["adequate"] is True for one in imported) else PART_FAILED


def _mapping(keys: dict[str, Any], content: Content, where: str, name: str) -> Mapping:
    """The mapping, with the unit that the file states where none was given; one without columns or unit is refused."""
    from pipelines.importers import mapping as mapped
    from pipelines.importers import stated_units

    if "columns" not in keys:
        raise WrongUse(
            f"import: no column of {name} is mapped, x, y and z are needed at least (its columns: "
            f"{', '.join(map(str, content.table.columns))}); add --map time=…,x=…,y=…,z=… and --units output=…, or --mapping "
            f"FILE.toml; 'tumbleline inspect {name}' proposes a command"
        )
    complete = stated_units.completed(keys, content)
    if "output" not in complete.get("units", {}) and all(axis in keys["columns"] for axis in mapped.NEEDED):
        raise WrongUse(
            f"import: the unit of the output is not given and {name} states none, one of {', '.join(mapped.OUTPUT_UNITS)} is "
            f"needed; add --units output=…; 'tumbleline inspect {name}' shows the size of the numbers"
        )
    how = mapped.build(complete, where)
    stated_units.refuse_contradiction(how, content, name)
    return how


def _refuse_unknown_fit(fit: str) -> None:
    if fit and fit not in METHODS:
        raise WrongUse(
            f"--fit: found '{shown(fit)}', one of {', '.join(METHODS)} is needed; {did_you_mean(fit, METHODS)}"
        )


def _import_one(
    paths: list[Path],
    keys: dict[str, Any],
    where: str,
    fit: str,
    archive: str | None,
    stated: ImportReferences | None,
) -> dict[str, Any]:
    """Read, judge and store one recording; the document for JSON."""
    from pipelines.importers import keep, record, sources
    from pipelines.importers import mapping as mapped
    from pipelines.importers.dwell_list import dwell_rows
    from pipelines.importers.pose_check import CHECK_AXIS

    name = " + ".join(path.name for path in paths)
    columns, units = keys.get("columns"), keys.get("units")
    if isinstance(columns, dict) and isinstance(units, dict) and "output" in units:
        mapped.build(keys, where)  # an error of the mapping is reported before a file is read
    with error_console().status(f"reading {name}"):
        time = str(columns.get("time", "")) if isinstance(columns, dict) else ""
        content, source, breaks = sources.read(
            paths, join=str(keys.get("join", "")), time=time, group=str(keys.get("group", ""))
        )
        how = _mapping(keys, content, where, name)
        data = record.imported(content.table, how, name, content, breaks)
    judged = None
    if fit:
        from pipelines.diagnosis.imported import judge

        with error_console().status("fitting and judging"):
            judged = judge(fit, data, how)
    run = keep.keep(data, source, how, judged, archive, stated)
    turned = fit == "plane" and judged is not None and judged.adequate is not False  # its one axis is meant to be still
    return {
        "run": run.id,
        "source": source.as_dict(),
        "units": data.units,
        "out_unit": data.out_unit,
        "samples": 0 if data.samples is None else len(data.samples),
        "dwells": 0 if data.dwells is None else len(data.dwells),
        "remarks": [*(r for r in data.remarks if not (turned and r.startswith(CHECK_AXIS))), *_slips(how)],
        "faults": list(data.faults),
        "fit": fit or None,
        "adequate": None if judged is None else judged.adequate,
        **({} if judged is None else judged.document),
        "lines": [] if judged is None else list(judged.lines),
        "dwell_list": dwell_rows(data, judged, how),
    }


def _slips(how: Mapping) -> list[str]:
    """A sentence for every covariate whose name is close to a known one."""
    return [
        f"'{shown(name)}' is imported as a covariate; if you mean {' or '.join(close)}, import again with that name"
        for name, close in how.likely_slips.items()
    ]


def _print(one: dict[str, Any], archive: str | None, *, list_dwells: bool) -> None:
    """An import for people."""
    out = console()
    dwells = number_of(one["dwells"], "dwell")
    rows = f"{number_of(one['samples'], 'sample')}, {dwells}" if one["samples"] else dwells
    out.print(f"{', '.join(one['units'])}: {rows} in {one['out_unit']}, kept as run {one['run']}", markup=False)
    for remark in [*one["remarks"], *one["lines"]]:
        out.print(f"  {remark}", markup=False, soft_wrap=True)
    if list_dwells:
        _print_dwells(one["dwell_list"], one["out_unit"])
    if one["fit"]:
        verdict, style = VERDICTS[one["adequate"]]
        out.print(f"  {verdict}", style=style)
        if one["fit"] == "norm" and one["adequate"] is False:
            print_next(out, [command_line("diagnose", one["run"], *archive_words(archive))])


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
