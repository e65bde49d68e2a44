"""``tumbleline import``: recordings of others into the archive, with a fit on the way where one is wanted."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pipelines.cli.options import ArchiveOption, JsonOption, console, error_console, print_json
from schemas.errors import DONE, PART_FAILED, WrongUse, did_you_mean
from schemas.foreign import shown

if TYPE_CHECKING:
    from pipelines.importers.mapping import Mapping

PART = "Measure"
ORDER = 160
SUMMARY = "Import recordings of other systems into the archive."

METHODS = ("norm", "faces", "temperature")
VERDICTS = {
    True: ("adequate", "bold green"),
    False: ("NOT ADEQUATE: this fit does not describe these data", "bold red"),
    None: ("CANNOT BE JUDGED: see above", "bold yellow"),
}
VERDICTS_OF_TRANSFER = {**VERDICTS, False: ("NOT ADEQUATE: the model does not describe these points", "bold red")}


def command(
    files: Annotated[list[Path], typer.Argument(metavar="FILE…", help="CSV, TSV, text, Parquet or MATLAB; also .gz.")],
    columns: Annotated[
        str, typer.Option("--map", metavar="time=…,x=…,y=…,z=…", help="What each column of the file means.")
    ] = "",
    mapping: Annotated[
        Path | None, typer.Option("--mapping", metavar="TOML", help="The same as a file; options here come first.")
    ] = None,
    units: Annotated[
        str, typer.Option("--units", metavar="output=LSB,time=s,temperature=degC", help="Units of the columns.")
    ] = "",
    unit: Annotated[str, typer.Option("--unit", metavar="SN", help="Serial number, if no column has it.")] = "",
    rows: Annotated[str, typer.Option("--rows", metavar="samples|dwells", help="What one row is; samples.")] = "",
    rate: Annotated[float | None, typer.Option("--rate", metavar="HZ", help="Rate of samples without a time.")] = None,
    axes: Annotated[str, typer.Option("--axes", metavar="x,y,z", help="Mapped axes in the order wanted.")] = "",
    signs: Annotated[str, typer.Option("--signs", metavar="+,+,+", help="Signs of the axes in that order.")] = "",
    poses: Annotated[
        str, typer.Option("--poses", metavar="LABEL=+x,…", help="Dwells to keep by label, with the face that is up.")
    ] = "",
    face: Annotated[str, typer.Option("--face", metavar="+x|…|-z", help="The face that is up all the time.")] = "",
    blocks: Annotated[
        float | None, typer.Option("--blocks", metavar="S", help="Dwells of this length, for a record in one pose.")
    ] = None,
    local_g: Annotated[
        float | None, typer.Option("--local-g", metavar="M/S2", help="Gravity where it was measured, m/s².")
    ] = None,
    fit: Annotated[str, typer.Option("--fit", metavar="norm|faces|temperature", help="Fit and judge at once.")] = "",
    procedure: Annotated[
        str,
        typer.Option("--procedure", metavar="sweep", help="A dynamic measurement: the transfer function of a sweep."),
    ] = "",
    effects: Annotated[
        str, typer.Option("--effects", metavar="a,b,…", help="Model of the transfer function; second_order,delay.")
    ] = "",
    archive: ArchiveOption = None,
    *,
    as_json: JsonOption = False,
) -> None:
    """Bring recordings of others into the archive: a raw record and its dwells in the exchange format.

    Columns are named (or numbered from 1 where a text file has no header). Nothing is guessed: what is not understood is
    refused. Exit status 1: the fit asked for is not adequate for these data, or they cannot tell.
    """
    if procedure:
        raise typer.Exit(_transfer(files, procedure, unit, effects, archive, as_json=as_json))
    from pipelines.importers import mapping as mapped

    given: dict[str, Any] = mapped.from_file(mapping) if mapping else {}
    options: dict[str, Any] = {
        "columns": mapped.pairs(columns, "--map"),
        "units": mapped.pairs(units, "--units"),
        "poses": mapped.pairs(poses, "--poses"),
        "unit": unit,
        "face": face,
        "block_s": blocks,
        "rows": rows,
        "rate_hz": rate,
        "axes": [part.strip() for part in axes.split(",")] if axes else None,
        "signs": [part.strip() for part in signs.split(",")] if signs else None,
        "local_gravity_m_s2": local_g,
    }
    wanted = given | {key: value for key, value in options.items() if value not in ("", None, {}, [])}  # 0 is a value
    _refuse_unmapped(files[0], wanted)
    how = mapped.build(wanted, str(mapping or "import"))
    _refuse_unknown_fit(fit)
    imports = [_import_one(path, how, fit, archive) for path in files]
    verdicts = [one["adequate"] for one in imports if one["fit"]]
    adequate = False if False in verdicts else None if None in verdicts else True
    if as_json:
        print_json(imports[0] if len(imports) == 1 else {"imports": imports, "adequate": adequate})
    else:
        for one in imports:
            _print(one)
    raise typer.Exit(DONE if adequate is True else PART_FAILED)


def _transfer(files: list[Path], procedure: str, unit: str, effects: str, archive: str | None, *, as_json: bool) -> int:
    """Judge and keep transfer functions; the exit status: part failed where one is not adequate, or cannot be judged."""
    from pipelines.importers.transfer import import_transfer

    if procedure != "sweep":
        raise WrongUse(
            f"--procedure: found '{shown(procedure)}', sweep is what can be imported; measure others with a recipe"
        )
    if not unit:
        raise WrongUse("import: no serial number, a transfer function needs one; add --unit SN")
    model = [part.strip() for part in effects.split(",")] if effects else ["second_order", "delay"]
    found = [import_transfer(path, unit, model, archive) for path in files]
    if as_json:
        print_json(dict(found[0]) if len(found) == 1 else {"imports": found})
    else:
        out = console()
        for one in found:
            out.print(f"{one['unit']}: {one['points']} points, kept as run {one['run']}", markup=False)
            for line in one["text"]:
                out.print(f"  {line}", markup=False, soft_wrap=True)
            verdict, style = VERDICTS_OF_TRANSFER[one["adequate"]]
            out.print(f"  {verdict}", style=style)
    return DONE if all(one["adequate"] is True for one in found) else PART_FAILED


def _refuse_unmapped(path: Path, wanted: dict[str, Any]) -> None:
    """Refuse a mapping without columns or the output's unit, with the columns that there are."""
    if "columns" in wanted and "units" in wanted:
        return
    from pipelines.importers import files
    from pipelines.importers.mapping import OUTPUT_UNITS

    if "columns" in wanted:
        raise WrongUse(
            f"import: the output's unit is not told, one of {', '.join(OUTPUT_UNITS)} is needed; add --units output=…"
        )
    table, _ = files.read(path)
    raise WrongUse(
        f"import: no column of {path.name} is mapped, x, y and z are needed at least (its columns: "
        f"{', '.join(map(str, table.columns))}); add --map time=…,x=…,y=…,z=… and --units output=…, or --mapping FILE.toml"
    )


def _refuse_unknown_fit(fit: str) -> None:
    if fit and fit not in METHODS:
        raise WrongUse(
            f"--fit: found '{shown(fit)}', one of {', '.join(METHODS)} is needed; {did_you_mean(fit, METHODS)}"
        )


def _import_one(path: Path, how: Mapping, fit: str, archive: str | None) -> dict[str, Any]:
    """Read, judge and keep one file; the document for JSON."""
    from pipelines.importers import files, judge, keep, record

    with error_console().status(f"reading {path.name}"):
        table, source = files.read(path)
        data = record.imported(table, how, path.name)
    judged = judge.judge(fit, data, how) if fit else None
    run = keep.keep(data, source, how, judged, archive)
    return {
        "run": run.id,
        "source": source.as_dict(),
        "units": data.units,
        "out_unit": data.out_unit,
        "samples": 0 if data.samples is None else len(data.samples),
        "dwells": 0 if data.dwells is None else len(data.dwells),
        "remarks": list(data.remarks),
        "fit": fit or None,
        "adequate": None if judged is None else judged.adequate,
        **({} if judged is None else judged.document),
        "lines": [] if judged is None else list(judged.lines),
    }


def _print(one: dict[str, Any]) -> None:
    """An import for people."""
    out = console()
    rows = f"{one['samples']} samples, {one['dwells']} dwells" if one["samples"] else f"{one['dwells']} dwells"
    out.print(f"{', '.join(one['units'])}: {rows} in {one['out_unit']}, kept as run {one['run']}", markup=False)
    for remark in [*one["remarks"], *one["lines"]]:
        out.print(f"  {remark}", markup=False, soft_wrap=True)
    if one["fit"]:
        verdict, style = VERDICTS[one["adequate"]]
        out.print(f"  {verdict}", style=style)
