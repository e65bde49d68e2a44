"""Recordings of accelerometers: a file of any system, a DataFrame, or a run of an archive, as dwells that can be fitted."""

import hashlib
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import pandas as pd

from inertial.counts import number_of
from pipelines.archive import Archive, Run
from schemas.errors import DataRejected, WrongUse
from tumbleline.pictures import Picture, as_html, as_text

if TYPE_CHECKING:
    from pipelines.importers.proposal import Proposal
    from pipelines.importers.recognition import Recognition

Source = str | Path | pd.DataFrame


@cache
def _session() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="tumbleline-")


def session_folder() -> Path:
    """The folder of this process for what nobody asked to keep; it is removed when the process ends."""
    return Path(_session().name)


@dataclass(frozen=True)
class Recording:
    """Dwells of one or several units, and how they came about.

    run : that holds them, in the archive that was named, else in one of this process
    told : what was recognised, assumed and left out, as sentences · command : the equivalent import; empty for dwells
    """

    run: Run = field(repr=False)
    told: tuple[str, ...] = ()
    command: str = ""

    @property
    def dwells(self) -> pd.DataFrame:
        """One row per dwell, in the exchange format: outputs in ``out_unit``, forces in g, temperatures in °C, times in s."""
        from pipelines.importers.exchange import dwells_of_run

        return dwells_of_run(self.run)

    @property
    def history(self) -> pd.DataFrame | None:
        """Temperatures against time; None where they were not recorded."""
        from pipelines.importers.exchange import history_of_run

        return history_of_run(self.run) if "history" in self.run.tables() else None

    @property
    def samples(self) -> pd.DataFrame | None:
        """The raw samples of an import; None where the source had means."""
        return self.run.table("samples") if "samples" in self.run.tables() else None

    @property
    def units(self) -> list[str]:
        """Serial numbers."""
        return list(dict.fromkeys(self.dwells["unit"].astype(str)))

    def plot(self) -> Picture:
        """The outputs of the first unit by dwell."""
        from pipelines.drawing.chart import Chart, Plot, PlotAxis, Role, Trace

        dwells = self.dwells
        rows = dwells[dwells["unit"] == dwells["unit"].iloc[0]]
        names = [name for name in ("out_x", "out_y", "out_z") if name in rows]
        unit = str(rows["out_unit"].iloc[0]) if "out_unit" in rows else ""
        x = rows["dwell"].to_numpy(dtype=float)
        roles: dict[str, Role] = {"x": "x", "y": "y", "z": "z"}
        traces = tuple(Trace(name[-1], x, rows[name].to_numpy(dtype=float), role=roles[name[-1]]) for name in names)
        title = f"Outputs of {rows['unit'].iloc[0]}"
        return Picture(Chart(title, (Plot(title, PlotAxis("dwell"), PlotAxis(f"output / {unit}"), traces),)))

    def _lines(self) -> list[str]:
        counted = f"{number_of(len(self.dwells), 'dwell')} of {number_of(len(self.units), 'unit')}"
        return [f"{counted}; run {self.run.id}", *self.told, *([self.command] if self.command else [])]

    def _repr_html_(self) -> str:
        return as_html("Recording", self._lines(), self.dwells.head(6))

    def __str__(self) -> str:
        return as_text("Recording", self._lines())


def listed(names: Sequence[str] | str | None, what: str, run: Run | None = None) -> list[str] | None:
    """Ids of effects from a list, or from a text with commas as of a command; where none are given those of the run, or None."""
    from pipelines.diagnosis.inputs import effects_of
    from pipelines.jobs.model_files import refuse_unknown_effects

    if names is None:
        return None if run is None else effects_of(run)
    given: Any = names
    chosen: list[Any] = given.split(",") if isinstance(given, str) else [*given] if isinstance(given, Iterable) else []
    if not chosen or not all(isinstance(name, str) and name.strip() for name in chosen):
        raise WrongUse(
            f"{what}: effects: found {names!r}, ids of effects are needed, such as ['bias', 'scale']; leave it out for the "
            "default model"
        )
    ids = [name.strip() for name in chosen]
    refuse_unknown_effects(ids, what)
    return ids


def read(
    source: Source | Sequence[str | Path],
    *,
    history: Source | None = None,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    serial: str = "",
    archive: str | Path | None = None,
    **stated: Any,
) -> Recording:
    """A recording.

    Parameters
    ----------
    source : a file in any format of ``tumbleline import``, several files of one recording that follow one another, a table of
        dwells in the exchange format, a DataFrame of either, or the name of a run of ``archive``
    history : temperatures against time, of dwells in the exchange format; that beside a file of dwells by default
    columns, units : meaning → column (``x``, ``y``, ``z``, ``time``, ``temperature``, …) and quantity → unit (``output``,
        ``time``); what is not stated is recognised, and told in :attr:`Recording.told`
    serial : serial number of the device; the name of the file, or A, by default
    archive : folder that keeps the recording; None: it goes when the process ends
    stated : further keys of a mapping, as in ``tumbleline import``: ``rate_hz``, ``local_gravity_m_s2``, ``poses``, ``rows`` …

    Raises
    ------
    WrongUse
        The recording leaves something open; the message says what to state.
    DataRejected
        The recording cannot be used; the message says why.
    """
    from pipelines.importers.exchange import checked, checked_history, is_exchange, read_history

    several: Any = source  # anything may be given
    if units is not None and not isinstance(cast("Any", units), Mapping):
        raise WrongUse(
            f"read: units: found {units!r}, units by quantity are needed; write units={{'output': {units!r}}}"
        )
    if columns is not None and not isinstance(cast("Any", columns), Mapping):
        raise WrongUse(f"read: columns: found {columns!r}, columns by meaning are needed: columns={{'x': 'ax', …}}")
    unused = [
        *(["serial"] if serial else []),
        *stated,
        *(f"units['{what}']" for what in units or {} if what != "output"),
    ]
    if isinstance(source, pd.DataFrame):
        if not len(source):
            raise DataRejected("read: a DataFrame without rows, at least one is needed; check how it was made")
        named = [name for name in source.index.names if name is not None and name not in source]  # a time, most often
        source = source.reset_index(named) if named else source
        if is_exchange(source.columns) and not columns:
            _refuse(unused, "a table of dwells in the exchange format")
            past = history if isinstance(history, pd.DataFrame) else None if history is None else read_history(history)
            return _stored(checked(source, where="DataFrame", foreign=True), past, "DataFrame", archive, units)
        _refuse([] if history is None else ["history"], "a recording that is imported")
        return replace(_imported([_as_file(source)], columns, units, serial or "A", archive, stated), command="")
    from pipelines.importers import files

    if not isinstance(source, str | Path):
        paths: list[Any] = [*several] if isinstance(several, Iterable) and not isinstance(several, Mapping) else []
        if not paths or not all(isinstance(path, str | Path) for path in paths):
            raise WrongUse(
                f"read: found {type(source).__name__}, a file, files, a DataFrame or the name of a run is needed; make a table "
                "of arrays with pandas.DataFrame(values, columns=['x', 'y', 'z'])"
            )
        _refuse([] if history is None else ["history"], "a recording that is imported")
        return _imported([Path(path) for path in paths], columns, units, serial, archive, stated)
    if not files.is_file(str(source)):
        given = {"history": history, "columns": columns, "units": units}
        _refuse([*unused, *(name for name, value in given.items() if value is not None)], "a run of an archive")
        return Recording(Archive(None if archive is None else str(archive)).run(str(source)))
    path = Path(source)
    if columns is None and is_exchange(files.read(path)[0].columns):
        from pipelines.diagnosis.inputs import dwells_and_history

        _refuse(unused, "a table of dwells in the exchange format")
        beside = history if isinstance(history, str | Path) else ""
        dwells, past, _ = dwells_and_history(str(path), str(beside), None)
        past = checked_history(history, "history", foreign=True) if isinstance(history, pd.DataFrame) else past
        return _stored(dwells, past, path.name, archive, units)
    _refuse([] if history is None else ["history"], "a recording that is imported")
    return _imported([path], columns, units, serial, archive, stated)


def _refuse(unused: Sequence[str], of: str) -> None:
    """Refuse what :func:`read` was given and would not use."""
    if unused:
        raise WrongUse(
            f"read: {', '.join(unused)}: not used for {of}, which states it itself or has none; leave it out"
        )


def _stored(
    dwells: pd.DataFrame,
    history: pd.DataFrame | None,
    name: str,
    archive: str | Path | None,
    units: Mapping[str, str] | None,
) -> Recording:
    from pipelines.importers.keep import complete_table, keep_table_of_dwells

    dwells, told = complete_table(dwells, (units or {}).get("output", ""))
    return Recording(keep_table_of_dwells(dwells, history, name, _archive_address(archive)), told)


def _archive_address(archive: str | Path | None) -> str:
    return str(session_folder() / "archive") if archive is None else str(archive)


def _as_file(table: pd.DataFrame) -> Path:
    """The table as a file that an import reads, named by its content."""
    text = table.apply(lambda values: values.dt.total_seconds() if values.dtype.kind == "m" else values)
    text = text.to_csv(index=False).encode()
    path = session_folder() / hashlib.sha256(text).hexdigest()[:10] / "DataFrame.csv"
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(text)
    return path


def _imported(
    paths: Sequence[Path],
    columns: Mapping[str, str] | None,
    units: Mapping[str, str] | None,
    serial: str,
    archive: str | Path | None,
    stated: dict[str, Any],
) -> Recording:
    """A recording of another system, with what was stated of it and what is recognised beyond that."""
    from pipelines.diagnosis.import_document import import_document
    from pipelines.importers.mapping import build
    from pipelines.importers.proposal import Proposal
    from pipelines.importers.recognition import recognise

    seen = recognise(paths, join=stated.get("join", "rows" if len(paths) > 1 else ""))
    name = " + ".join(path.name for path in paths)
    proposal = seen.for_fit()
    found = dict(proposal.keys if proposal is not None else seen.keys or {})
    keys = found | stated
    keys["columns"] = dict(columns) if columns is not None else found.get("columns", {})
    keys["units"] = {**found.get("units", {}), **(units or {})}
    keys |= {"unit": serial} if serial else {}
    if open_ := _open(keys, seen, decided=proposal is not None):
        raise WrongUse(
            f"read: {name} does not state {'; '.join(open_)}; state it: columns={{'x': …}}, units={{'output': …}}, "
            f"rate_hz=…; recognised: {seen.import_command}"
        )
    build(keys, name)
    done = import_document([*paths], keys, name, "", _archive_address(archive), None, nullcontext)
    run = Archive(_archive_address(archive)).run(done["run"])
    return Recording(run, _told(seen, proposal, done["remarks"], stated), Proposal(keys).command(paths))


def _open(keys: dict[str, Any], seen: "Recognition", *, decided: bool) -> list[str]:
    """Keys and columns that are neither stated nor recognised; empty where the mapping is complete."""
    blanks = {"COLUMN", "UNIT", "HZ"}
    left = [f"column {m}" for m, name in keys["columns"].items() if name in blanks]
    left += [f"unit of {what}" for what, unit in keys["units"].items() if unit in blanks]
    left += ["rate_hz"] if keys.get("rate_hz") in blanks else []
    return left or ([] if decided or not seen.open or keys["columns"] else list(seen.open))


def _told(seen: "Recognition", proposal: "Proposal | None", remarks: Sequence[str], stated: Any) -> tuple[str, ...]:
    cures = ["(--rate " if key == "rate_hz" else f"(--set {key}=" for key in stated]  # end an assumption of a key
    assumed = () if proposal is None else (line for line in proposal.assumed if not any(cure in line for cure in cures))
    guessed = seen.guessed
    axes = ", ".join(filter(None, (guessed.column(axis) for axis in "xyz")))
    told = (
        [f"x, y, z: {axes} ({guessed.triad.reason}); in {guessed.output.meaning}: {guessed.output.reason}"]
        if axes
        else []
    )
    return (*told, *assumed, *(() if proposal is None else proposal.remarks), *remarks)


@dataclass(frozen=True)
class Example:
    """Four units that were measured twice; an effect is hidden in them.

    run, fresh : the first and the second measurement · model : to begin with
    """

    run: Recording
    fresh: Recording
    model: list[str]
    _truth: tuple[str, str] = field(repr=False)

    def reveal(self) -> str:
        """The hidden effect and its physics."""
        effect, physics = self._truth
        return f"{effect}: {physics}"


def example(effect: str = "random", *, seed: int = 11) -> Example:
    """A lot with a hidden effect, measured twice on the simulated station, as ``tumbleline demo``.

    Parameters
    ----------
    effect : an effect that ``tumbleline demo`` knows, or ``random``
    seed : the same seed gives the same data
    """
    from pipelines.demo.measure import measure
    from pipelines.demo.scenes import scene

    hidden = scene(effect, seed)
    lot = measure(hidden, seed)
    runs = read(lot.dwells, history=lot.history), read(lot.fresh, history=lot.fresh_history)
    return Example(*runs, list(hidden.model), (hidden.effect, hidden.truth))
