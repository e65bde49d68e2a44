"""``tumbleline import``: recordings of other systems into the archive, with an optional fit."""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any, NoReturn

from inertial.counts import number_of
from pipelines.cli.next_commands import archive_words, command_line, print_next
from pipelines.cli.options import (
    READING,
    AllOption,
    ArchiveOption,
    JsonOption,
    Setting,
    argument,
    option,
    set_option,
    settings,
    stated_device,
)
from pipelines.cli.printing import conclude, error_console, print_table, say, short, short_values
from pipelines.cli.text.verdict_text import print_verdict_of_fit
from pipelines.importers.documents import TransferImport, WaveformImport
from schemas.errors import WrongUse, did_you_mean
from schemas.foreign import shown
from schemas.tables import ADEQUATE, NOT_JUDGED

PART = "Measure"
ORDER = 160
SUMMARY = "Import recordings of other systems into the archive."
EXAMPLES = (
    "tumbleline import acc.csv --map time=t,x=ax,y=ay,z=az --unit-of output=LSB --units SN1",
    "tumbleline import acc.csv --set columns.toml --fit norm",
)

WAVEFORMS = ("reference", "x", "y", "z")
"""Channels that make an import of a sweep one of waveforms, not of points."""
METHODS = ("norm", "plane", "faces", "temperature")


def _pairs(text: str) -> dict[str, str]:
    from pipelines.importers.mapping import pairs

    return pairs(text, "--set")


def _listed(text: str) -> list[str]:
    return [part.strip() for part in text.split(",")]


KEYS = {
    "rows": Setting("samples|dwells", "content of a row, samples by default"),
    "local_gravity_m_s2": Setting("M/S2", "local gravity at the place of the measurement", float),
    "poses": Setting("LABEL=+x,…", "dwells to keep by label, with the face that is up", _pairs),
    "headings": Setting("LABEL=deg,…", "direction of x in each pose, degrees (of y where x is vertical)", _pairs),
    "face": Setting("+x|…|-z", "the face that is up all the time"),
    "block_s": Setting("S", "dwells of this length, for a record in one pose", float),
    "positions": Setting("N", "positions logged back to back, without the moves", int),
    "window_s": Setting("S", "sliding window of the search for dwells, 1 s by default", float),
    "threshold": Setting("SD", "standard deviation in a window that means motion, in the output unit", float),
    "shortest_s": Setting("S", "shortest dwell, 1 s by default", float),
    "gaps": Setting("refuse|split", "rows without a number, and gaps in time; refuse by default"),
    "faulty": Setting("refuse|leave-out|keep", "constant axes and torn words; refuse by default"),
    "axes": Setting("x,y,z", "order of the mapped axes", _listed),
    "signs": Setting("+,+,+", "signs of the axes in that order", _listed),
    "verify": Setting("N|N%", "dwells that the fit does not use; they verify it"),
    "zone": Setting("NAME", "zone of local times that state none, such as Europe/Berlin"),
    "measured": Setting("DATE", "day of the measurement"),
    "zero_output": Setting("VALUE", "nominal output at 0 g, 0 by default", float),
    **READING,
}


def command(
    files: Annotated[
        list[Path],
        argument(
            "FILE…",
            "Text, Parquet, MATLAB, NumPy, WAV, LVM; with an extra spreadsheets, HDF5, UFF58, TDMS, IDE, R, ULog, "
            "DataFlash, MCAP, ROS bags, MDF, miniSEED. Also .gz.",
        ),
    ],
    columns: Annotated[
        list[str] | None, option("--map time=…,x=…,y=…,z=…", "Meaning of the columns of the file.")
    ] = None,
    unit_of: Annotated[
        list[str] | None, option("--unit-of output=LSB,time=s,temperature=degC", "Units of measure of the columns.")
    ] = None,
    units: Annotated[str, option("--units SN", "Serial number, if no column has it.")] = "",
    device: Annotated[str, option("--device PRESET|NAME", "Kind of device; audit and discover compare its like.")] = "",
    rate: Annotated[float | None, option("--rate HZ", "Rate of samples without a time.")] = None,
    setting: Annotated[
        list[str] | None,
        set_option(
            KEYS,
            "Or --set FILE.toml: a file with these keys and the tables columns and units; with --procedure the keys of the "
            "procedure and full_scale. What the command line gives has priority; may be repeated.",
        ),
    ] = None,
    references: Annotated[
        Path | None, option("--references TOML", "Uncertainty of the references; a certificate needs it.")
    ] = None,
    fit: Annotated[str, option("--fit norm|plane|faces|temperature", "Fit, and judge the fit.")] = "",
    procedure: Annotated[
        str,
        option(
            "--procedure NAME",
            "Dynamic test: the points of a sweep (--map frequency=…,magnitude=…,phase=…), or with --map reference=… the "
            "waveforms of a procedure.",
        ),
    ] = "",
    effects: Annotated[
        str, option("--effects a,b,…", "Model of the transfer function; second_order,delay by default.")
    ] = "",
    archive: ArchiveOption = None,
    *,
    list_dwells: AllOption = False,
    as_json: JsonOption = False,
) -> None:
    """Import recordings of other systems into the archive: a raw record and its dwells in the exchange format.

    Columns are named, or numbered from 1. Nothing is guessed: what neither the file nor its numbers show must be given. Exit
    status 1: the requested fit, or the model of a test, is not adequate or cannot be judged, or a figure of a test that the
    files hold is not determined.
    """
    from pipelines.importers import limited

    limited.start()
    from pipelines.importers import mapping as mapped

    file, given = _settings(setting)
    listed, stated_units = ",".join(columns or ()), ",".join(unit_of or ())
    waveforms = procedure != "sweep" or any(channel in mapped.pairs(listed, "--map") for channel in WAVEFORMS)
    if procedure and (other := sorted(given.keys() - ({"group"} if waveforms else set()))):
        raise WrongUse(f"import: --set {other[0]} is for records at rest, --procedure is given; leave it out")
    if procedure and not units:
        raise WrongUse(f"import: no serial number, --procedure {procedure} needs one; add --units SN")
    if procedure:
        kind, slip = stated_device(device)
        if waveforms:
            from pipelines.importers.waveforms import RecordingLayout, import_waveforms

            channels = mapped.pairs(listed, "--map"), mapped.pairs(stated_units, "--unit-of")
            layout = RecordingLayout(*channels, rate, given.get("group", ""))
            recorded = import_waveforms(files, procedure, file, units, layout, archive, kind)
            _conclude_waveforms(recorded, slip, as_json=as_json)
        from pipelines.importers.transfer import import_transfer
        from pipelines.importers.transfer_columns import stated_layout

        model = [effect.strip() for effect in (effects or "second_order,delay").split(",")]
        points = stated_layout(listed, stated_units, file)
        _conclude_transfers(
            [import_transfer(path, units, model, archive, points, kind) for path in files], slip, as_json=as_json
        )
    from pipelines.diagnosis.import_document import import_document

    keys: dict[str, Any] = mapped.from_file(file) if file else {}
    options = {
        "columns": mapped.pairs(listed, "--map"),
        "units": mapped.pairs(stated_units, "--unit-of"),
        "unit": units,
        "device": device,
        "rate_hz": rate,
        **given,
    }
    keys |= {key: value for key, value in options.items() if value not in ("", None, {}, [])}  # 0 is a value
    device, slip = stated_device(str(keys.get("device", "")))
    keys |= {"device": device} if device else {}
    if fit and fit not in METHODS:
        raise WrongUse(
            f"--fit: found '{shown(fit)}', one of {', '.join(METHODS)} is needed; {did_you_mean(fit, METHODS)}"
        )
    stated = None
    if references is not None:
        from schemas.import_references import stated_references

        stated = stated_references(references, keys)
    sets = [files] if keys.get("join") else [[path] for path in files]
    working, where = error_console().status, str(file or "import")
    imports = [import_document(paths, keys, where, fit, archive, stated, working) for paths in sets]
    for imported in imports:
        imported["remarks"] += slip
    verdicts = [imported["adequate"] for imported in imports if imported["fit"]]
    adequate = False if False in verdicts else None if None in verdicts else True
    document = imports[0] if len(imports) == 1 else {"imports": imports, "adequate": adequate}
    show = partial(_print_imports, imports, archive, list_dwells=list_dwells)
    conclude(document, show, as_json=as_json, passed=adequate is True)


def _settings(given: list[str] | None) -> tuple[Path | None, dict[str, Any]]:
    """The file among the values of ``--set``, and the keys that the others state."""
    files = [text for text in given or () if "=" not in text]
    if len(files) > 1:
        raise WrongUse(f"import: --set {' and --set '.join(files)}, one file is possible; leave one out")
    keys = settings([text for text in given or () if "=" in text], KEYS, "import")
    return (Path(files[0]) if files else None), keys


def _conclude_waveforms(imported: WaveformImport, slip: tuple[str, ...], *, as_json: bool) -> NoReturn:
    """Print a dynamic test; a part failed where its model is not adequate, or a figure that was recorded is not determined."""
    imported["text"] += slip
    held = [figure["identified"] for figure in imported["figures"] if figure["measured"]]
    passed = bool(held) and all(held) and imported["verdict"] in {"", ADEQUATE}
    conclude(dict(imported), _print_waveforms, as_json=as_json, passed=passed)


def _conclude_transfers(transfers: list[TransferImport], slip: tuple[str, ...], *, as_json: bool) -> NoReturn:
    """Print transfer functions; a part failed where a model is not adequate or cannot be judged."""
    for transfer in transfers:
        transfer["text"] += slip
    document = dict(transfers[0]) if len(transfers) == 1 else {"imports": transfers}
    passed = all(transfer["adequate"] is True for transfer in transfers)
    conclude(document, lambda _: _print_transfers(transfers), as_json=as_json, passed=passed)


def _say_kept(imported: Mapping[str, Any], units: Sequence[str], what: str) -> None:
    """Print the units of an import, with their kind of device where it is stated, what was kept of them, and as which run."""
    listed = ", ".join(units) if len(units) <= 8 else f"{len(units)} units, {units[0]} to {units[-1]}"
    device = f" ({imported['device']})" if imported["device"] else ""
    say(f"{listed}{device}: {what}, kept as run {imported['run']}")


def _print_transfers(imports: Sequence[Mapping[str, Any]]) -> None:
    for transfer in imports:
        _say_kept(transfer, [transfer["unit"]], f"{transfer['points']} points")
        for line in transfer["text"]:
            say(f"  {line}")
        print_verdict_of_fit(transfer["adequate"], "the model does not describe these points")


def _print_waveforms(imported: Mapping[str, Any]) -> None:
    _say_kept(imported, [imported["unit"]], number_of(imported["records"], "recording"))
    found = [figure for figure in imported["figures"] if figure["identified"]]
    rows = [[f["figure"], f["axis"], short(f["value"]), short(f["uncertainty"]), f["unit"]] for f in found]
    if rows:
        print_table(["figure", "axis", "value", "standard uncertainty", "unit"], rows, fixed=2)
    for line in imported["text"]:
        say(f"  {line}")
    if imported["verdict"]:
        adequate = None if imported["verdict"] == NOT_JUDGED else imported["verdict"] == ADEQUATE
        print_verdict_of_fit(adequate, "the model does not describe these recordings")


def _print_imports(imports: Sequence[dict[str, Any]], archive: str | None, _: object, *, list_dwells: bool) -> None:
    for imported in imports:
        dwells = number_of(imported["dwells"], "dwell")
        rows = f"{number_of(imported['samples'], 'sample')}, {dwells}" if imported["samples"] else dwells
        unit = imported["out_unit"] or "a unit that is not known (--unit-of output=… states it)"
        _say_kept(imported, imported["units"], f"{rows} in {unit}")
        for remark in [*imported["remarks"], *imported["lines"]]:
            say(f"  {remark}")
        if list_dwells:
            _print_dwells(imported["dwell_list"], imported["out_unit"])
        if imported["fit"]:
            print_verdict_of_fit(imported["adequate"], "this fit does not describe these data")
            if imported["fit"] == "norm" and imported["adequate"] is False:
                print_next([command_line("diagnose", imported["run"], *archive_words(archive))])


def _print_dwells(dwells: list[dict[str, Any]], unit: str) -> None:
    heads = ["dwell", "label", "start, s", "end, s", "samples", f"mean x / y / z, {unit}", f"sd x / y / z, {unit}",
             "residual, µg", "influence"]  # fmt: skip
    print_table(
        heads,
        [
            [
                str(dwell["dwell"]),
                dwell["label"],
                f"{dwell['start_s']:.2f}",
                f"{dwell['end_s']:.2f}",
                "" if dwell["n"] is None else str(dwell["n"]),
                " / ".join(f"{value:.6g}" for value in dwell["mean"]),
                "" if dwell["sd"] is None else short_values(dwell["sd"]),
                "" if dwell["residual_ug"] is None else f"{dwell['residual_ug']:.1f}",
                short(dwell["influence"]),
            ]
            for dwell in dwells
        ],
        fixed=2,
    )
