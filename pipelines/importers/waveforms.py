"""Import of dynamic tests: waveforms of unit and reference, reduced and judged in the same way as those of a station."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from pydantic import ValidationError

from inertial.errors import InertialError
from pipelines.importers import files
from pipelines.importers.content import Content, unit_in
from pipelines.importers.documents import WaveformFigure, WaveformImport
from pipelines.importers.files import digest_of
from pipelines.importers.keep import keep_tables, lot_of_import
from pipelines.importers.mapping import TIME_UNITS
from pipelines.importers.stated_units import column_name
from pipelines.importers.values import finite_column
from pipelines.procedures import PROCEDURES, procedure_tables
from pipelines.procedures.base import FromWaveforms, NominalScale
from pipelines.procedures.figures import FigureValue, Finding, Outcome
from pipelines.procedures.recorded import (
    REFERENCE,
    Device,
    ProcedureRecord,
    ProcedureStep,
    UnitRecord,
)
from schemas.errors import DataRejected, WrongUse, did_you_mean
from schemas.foreign import shown
from schemas.poses import Pose
from schemas.toml_files import explain, parse_toml, read_text
from schemas.units import AXES

ACCELERATION = {"g": 1.0, "m/s^2": 1.0 / 9.80665, "m/s²": 1.0 / 9.80665, "m/s2": 1.0 / 9.80665, "mg": 1e-3}
VOLT = {"V": 1.0, "mV": 1e-3}
TIMES = {**TIME_UNITS, "µs": 1e-6}
CHANNELS = ("time", *AXES, "reference", *(f"reference_{axis}" for axis in AXES))
"""What a column of a recording can be: one output and one reference for each axis at most."""
UNEVEN = 0.01
"""Part of a sample interval by which a time may depart from an even grid."""


@dataclass(frozen=True)
class RecordingLayout:
    """Layout of the recordings: columns and units by meaning, rate in Hz, group of channels (or two: units, reference)."""

    columns: Mapping[str, str]
    units: Mapping[str, str]
    rate_hz: float | None = None
    group: str = ""


def import_waveforms(
    paths: Sequence[Path],
    procedure: str,
    part: Path | None,
    unit: str,
    layout: RecordingLayout,
    archive: str | None = None,
    device: str = "",
) -> WaveformImport:
    """Figures and findings of a procedure from the recordings of one unit, one file a record; stored as a run of the archive.

    Parameters
    ----------
    part : TOML file with the keys of the procedure, and ``full_scale`` of the output where clipping is to be judged

    Raises
    ------
    WrongUse
        The procedure has no import, or a channel is not named.
    DataRejected
        A file has no sample interval, no unit, or samples that cannot be used.
    """
    for meaning in layout.columns:
        if meaning not in CHANNELS:
            raise WrongUse(
                f"import: --map {shown(meaning)}=…: no channel of a recording; {did_you_mean(meaning, CHANNELS)}"
            )
    test, stated, content, full_scale = _part(procedure, part)
    records: list[ProcedureRecord] = []
    recordings = [_recording(path, layout, stated, test) for path in paths]
    sources, out_unit = [made.source for made in recordings], recordings[0].unit
    stated = _scaled(stated, out_unit, part)
    driven = [made.samples if made.reference is None else made.reference for made in recordings]
    try:
        stated = test.completed(stated, driven)
    except InertialError as problem:
        raise DataRejected(f"{paths[0].name}: {problem}") from None
    for number, (path, made, drive) in enumerate(zip(paths, recordings, driven, strict=True)):
        if made.unit != out_unit:
            raise DataRejected(f"{path.name}: output in {made.unit}, {out_unit} in the files before; import them apart")
        pose = Pose(name="imported", outer_deg=0.0, inner_deg=0.0)
        setting = test.setting_of(stated, drive)
        step = ProcedureStep(path.name, pose, stated.temperature_C, role="imported", setting=setting)
        reading = {
            "unit": unit,
            "unit_C": stated.temperature_C,
            "supply_V": np.nan,
            "full_scale": full_scale,
            "out_unit": out_unit,
        }
        samples = {unit: made.samples} | ({} if made.reference is None else {REFERENCE: made.reference})
        records.append(ProcedureRecord(number, step, pd.DataFrame([reading]), samples))
    sensor = Device({}, {}, full_scale, out_unit)
    try:
        points = test.reduce(stated, records, sensor)
        mapped = [axis for axis in AXES if axis in layout.columns]
        points = points[points["axis"].isin(mapped)].reset_index(drop=True)
        outcome = test.evaluate(stated, points, sensor)
        verdict = test.verdict(stated, points)
    except InertialError as problem:
        raise DataRejected(f"{paths[0].name}: {problem}") from None
    values = outcome.figures.get(unit, [])
    texts = [(f.subject, f.text) for f in outcome.findings]
    texts += _without_value(values)
    texts += [("file", remark) for remark in recordings[0].remarks]
    if not np.isfinite(full_scale):
        texts.append(
            ("not judged", "clipping at the end of the range: full_scale is not given; add it to the file of --set")
        )
    content |= stated.model_dump(include={"duration_ms", "before_ms"} - set(content))
    about = {
        "name": f"{test.title} of {unit}, recorded elsewhere",
        "source": sources[0].as_dict(),
        "sources": [source.as_dict() for source in sources],
        "lot": lot_of_import([unit], device=device),
    }
    parameters = {
        "procedure": procedure, "unit": unit, "part": content, "columns": dict(layout.columns), "units": dict(layout.units),
        "rate_hz": layout.rate_hz, "group": layout.group,
    }  # fmt: skip
    parameters |= {"device": device} if device else {}
    outcome = Outcome({unit: values}, [Finding(unit, *text) for text in texts])
    tables = procedure_tables([(0, procedure, points, outcome)])
    run = keep_tables("import of waveforms", digest_of(sources), parameters, about, tables, archive)
    units = {spec.name: spec.unit for spec in test.figures}
    figures: list[WaveformFigure] = [
        {
            "figure": f.figure, "axis": f.axis, "value": f.value if f.identified and np.isfinite(f.value) else None,
            "uncertainty": f.uncertainty if f.identified and np.isfinite(f.uncertainty) else None, "unit": units[f.figure],
            "identified": bool(f.identified and np.isfinite(f.value)), "measured": f.measured, "note": f.note,
        }
        for f in values
    ]  # fmt: skip
    return {
        "run": run.id,
        "unit": unit,
        "device": device or None,
        "procedure": procedure,
        "records": len(records),
        "verdict": verdict,
        "figures": figures,
        "text": [f"{subject}: {text}" for subject, text in texts],
    }


def _without_value(values: Sequence[FigureValue]) -> list[tuple[str, str]]:
    """The figures without a value, those of one reason together: what the files cannot hold, and what they do not determine."""
    of_reason: dict[tuple[str, str], list[str]] = {}
    for figure in values:
        if not (figure.identified and np.isfinite(figure.value)):
            subject = "not determined" if figure.measured else "not measured"
            of_reason.setdefault((subject, figure.note), []).append(figure.figure)
    return [(subject, f"{', '.join(names)}: {note}") for (subject, note), names in of_reason.items()]


def _part(procedure: str, path: Path | None) -> tuple[FromWaveforms, Any, dict[str, Any], float]:
    """The procedure, its part, the content of its file, and the full scale of the output (infinite where it is not given)."""
    can = {name: test for name, test in PROCEDURES.items() if isinstance(test, FromWaveforms)}
    if procedure not in can:
        what = f"--procedure: found '{shown(procedure)}', {', '.join(can)} can be imported"
        raise WrongUse(f"{what}; {did_you_mean(procedure, can)}")
    content: dict[str, Any] = parse_toml(read_text(path, "part"), str(path)) if path else {}
    content = {"kind": procedure} | content
    full_scale = content.pop("full_scale", np.inf)
    if not (isinstance(full_scale, int | float) and full_scale > 0.0):
        raise WrongUse(
            f"{path}: full_scale is {full_scale!r}, a number above 0 in the unit of the output is needed; correct it"
        )
    part = can[procedure].part
    try:
        stated = part.model_validate(content)
    except ValidationError as problem:
        raise explain(problem, str(path or "--set FILE.toml"), part) from None
    return can[procedure], stated, content, float(full_scale)


def _scaled(part: Any, out_unit: str, path: Path | None) -> Any:
    """The part with a scale: the scale is stated, or follows from an output that is an acceleration.

    A recording made elsewhere has no multi-position test that determines it.
    """
    if not isinstance(part, NominalScale) or part.scale is not None:
        return part
    if out_unit in ACCELERATION:
        return part.model_copy(update={"scale": 1.0 / ACCELERATION[out_unit]})
    raise WrongUse(
        f"import: procedure {part.kind} has no scale, output per g is needed for figures in g; add scale = … to "
        f"{path or 'a file and give it with --set FILE.toml'}"
    )


class _Recording(NamedTuple):
    """One file: the unit, the reference (None without it), the unit of the output, and the source."""

    samples: UnitRecord
    reference: UnitRecord | None
    unit: str
    source: files.SourceFile
    remarks: tuple[str, ...]


def _recording(path: Path, layout: RecordingLayout, part: Any, procedure: FromWaveforms) -> _Recording:
    first, _, second = (piece.strip() for piece in layout.group.partition(","))
    content, source = files.read_content(path, first)
    other = files.read_content(path, second)[0] if second else content
    of = {
        meaning: other if meaning.startswith("reference") else content
        for meaning in layout.columns
        if meaning != "time"
    }
    named = {meaning: _named(layout.columns[meaning], channels) for meaning, channels in of.items()}
    layout = replace(layout, columns={**layout.columns, **named})
    outputs = {axis: layout.columns[axis] for axis in AXES if axis in layout.columns}
    driven = "reference" in layout.columns
    if not outputs or (procedure.needs_reference and not driven):
        there = ", ".join(shown(str(name)) for name in content.table.columns)
        raise WrongUse(
            f"import: reference and at least one of x, y, z are needed for {path.name} (its columns: {there}); add --map "
            "reference=…,z=…"
        )
    text = _unit(content, layout, "output", next(iter(outputs.values())), path.name)
    known = VOLT if procedure.reference_unit == "V" else ACCELERATION
    samples = UnitRecord(time := _clock(content, layout, path.name), np.zeros((len(time), 3)))
    for axis, column in outputs.items():
        samples.output[:, AXES.index(axis)] = finite_column(content.table, column, path.name)
    if not driven:
        return _Recording(samples, None, text, source, content.remarks)
    reference_unit = _unit(other, layout, "reference", layout.columns["reference"], path.name)
    if reference_unit not in known:
        raise DataRejected(
            f"{path.name}: reference in '{shown(reference_unit)}', one of {', '.join(known)} is needed; state it with "
            "--unit-of reference=…"
        )
    drive_time = _clock(other, layout, path.name)
    drive = np.zeros((len(drive_time), 3))
    driven_axis = AXES.index(part.axis) if hasattr(part, "axis") else 0
    drive[:, driven_axis] = known[reference_unit] * finite_column(other.table, layout.columns["reference"], path.name)
    for k, axis in enumerate(AXES):
        if f"reference_{axis}" in layout.columns:
            column = layout.columns[f"reference_{axis}"]
            drive[:, k] = known[reference_unit] * finite_column(other.table, column, path.name)
    return _Recording(samples, UnitRecord(drive_time, drive), text, source, content.remarks)


def _named(column: str, content: Content) -> str:
    """The name of a column that is given by its name or its number; as it is given where there is none."""
    return column_name([*map(str, content.table.columns)], column) or column


def _unit(content: Content, layout: RecordingLayout, meaning: str, column: str, where: str) -> str:
    """Unit of a channel: as stated by the command, else by the file; a unit that neither states is refused."""
    stated = content.units.get(column, "") or unit_in(column)
    given = layout.units.get(meaning, "")
    if not (given or stated):
        raise DataRejected(
            f"{where}: column '{shown(column)}' has no unit, one is needed; add --unit-of {meaning}=… from the "
            "sensor's data sheet"
        )
    if given and stated and given != stated:
        raise WrongUse(
            f"{where}: column '{shown(column)}' states {shown(stated)}, --unit-of has {shown(given)}; correct one"
        )
    return given or stated


def _clock(content: Content, layout: RecordingLayout, where: str) -> np.ndarray:
    """Times in s from 0: by a time column, the file's interval, or --rate; a file without any is refused."""
    n = len(content.table)
    column = layout.columns.get("time") or next(
        (name for name in content.table.columns if name.partition("[")[0].strip().lower() in {"time", "x_value"}), ""
    )
    column = _named(column, content)
    interval = content.interval_s
    if layout.rate_hz:
        interval = 1.0 / layout.rate_hz
    elif column and (
        (unit := layout.units.get("time") or content.units.get(column, "") or unit_in(column)) or not interval
    ):
        if unit not in TIMES:
            raise DataRejected(
                f"{where}: column '{shown(column)}' has no unit of time, one of {', '.join(TIMES)} is needed; add "
                "--unit-of time=…"
            )
        time = TIMES[unit] * finite_column(content.table, column, where)
        steps = np.diff(time)
        stated, interval = interval, float((time[-1] - time[0]) / max(n - 1, 1))
        # printed digits of a clock that agrees with the stated interval may be coarse
        agrees = stated is not None and abs(interval - stated) <= UNEVEN * stated
        if interval <= 0.0 or (not agrees and np.max(np.abs(steps - interval)) > max(UNEVEN, 2e-16 * n) * interval):
            raise DataRejected(
                f"{where}: the times are not evenly spaced, a constant sample interval is needed; export without gaps"
            )
    if interval is None or not interval > 0.0:
        raise DataRejected(
            f"{where}: no sample interval is stated, one is needed; map the time with --map time=…, or add --rate HZ"
        )
    if n < 16:
        raise DataRejected(f"{where}: {n} samples, 16 or more are needed; record longer")
    return np.arange(n) * interval
