"""Selection of runs of an archive by name or property: ``all``, beginnings of names, ``device:…``, ``since:DATE``."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, date, datetime, time
from typing import Any

from pipelines.archive import Archive, files
from schemas.errors import WrongUse, close_matches, did_you_mean

KEYS = ("device", "station", "unit", "recipe", "since", "until")
ALL, LATEST = "all", "latest"


@dataclass(frozen=True)
class SelectedRun:
    """One run of an archive, from its ``run.json``.

    measured : time of the measurement; for a re-run that of the first run of the data
    derived : whether the run is a re-run of another, analyses its data again, or continues with its measurements
    capture : what was captured; empty for an import
    """

    id: str
    recipe: str
    device: str
    station: str
    units: tuple[str, ...]
    measured: datetime
    derived: bool
    capture: str = ""


def entries(archive: Archive) -> list[SelectedRun]:
    """Every run, in the order of measurement."""
    runs = [entry_of(path.parent.name, files.read_json(path)) for path in (archive.root / "runs").glob("*/run.json")]
    known = set[str]()
    for k, entry in enumerate(runs := sorted(runs, key=lambda entry: (entry.measured, entry.id))):
        if entry.capture in known:  # a fit of an older version does not state whose data it has
            runs[k] = replace(entry, derived=True)
        elif entry.capture and not entry.derived:
            known.add(entry.capture)
    return runs


def entry_of(run_id: str, about: dict[str, Any]) -> SelectedRun:
    """One run, from its ``run.json``."""
    lot = about.get("lot", {})
    when = datetime.fromisoformat(about.get("measured") or about["when"])
    return SelectedRun(
        id=run_id,
        recipe=about.get("recipe", {}).get("name", "import" if "source" in about else about.get("name", "")),
        device=lot.get("device", ""),
        station=about.get("station", {}).get("name", ""),
        units=tuple(unit["serial"] for unit in lot.get("units", [])),
        measured=when if when.tzinfo else when.replace(tzinfo=UTC),
        derived="rerun_of" in about or bool(about.get("parents")),
        capture=str(about.get("capture") or ""),
    )


def selected(archive: Archive, words: Sequence[str]) -> list[SelectedRun]:
    """The selected runs, each once, in the order of measurement.

    All conditions with a colon must hold; names and beginnings of names add runs. Conditions do not select re-runs, because
    the original run has the same data.

    Raises WrongUse: a name or key is unknown, or no run matches.
    """
    known = entries(archive)
    parts = [part.strip() for word in words for part in word.split(",") if part.strip()]
    filters = [_filter(part) for part in parts if ":" in part]
    by_name = [part for part in parts if ":" not in part and part != ALL]
    if not known:
        raise WrongUse(
            f"archive {archive.root}: no run exists; make one with 'tumbleline run', or name another archive"
        )
    chosen = _named(known, by_name, archive) if by_name else [entry for entry in known if not entry.derived]
    left = [entry for entry in chosen if all(_holds(entry, key, value) for key, value in filters)]
    if not left:
        raise WrongUse(
            f"archive {archive.root}: none of {len(chosen)} runs is {' '.join(words)}; {_there_is(chosen, filters)}"
            " look with 'tumbleline list'"
        )
    return left


def _filter(part: str) -> tuple[str, Any]:
    """Key and value of a condition such as ``device:ADXL355``."""
    key, _, value = part.partition(":")
    if key not in KEYS:
        raise WrongUse(f"selection: '{part}' is not known; {did_you_mean(key, KEYS)}")
    if not value:
        raise WrongUse(f"selection: '{part}' says nothing after the colon, a value is needed; write {key}:VALUE")
    return key, moment(value, part, end=key == "until") if key in {"since", "until"} else value


def moment(text: str, where: str, *, end: bool = False) -> datetime:
    """A date or time as UTC; a date alone is the beginning of the day, or its end on request."""
    try:
        when = datetime.fromisoformat(text)
        if len(text) <= len("2026-01-31"):
            when = datetime.combine(date.fromisoformat(text), time.max if end else time.min)
    except ValueError:
        raise WrongUse(f"{where}: '{text}' is no date, YYYY-MM-DD is needed; correct it") from None
    return when if when.tzinfo else when.replace(tzinfo=UTC)


def _named(known: list[SelectedRun], names: list[str], archive: Archive) -> list[SelectedRun]:
    ids = [entry.id for entry in known]
    chosen: set[str] = set()
    for name in names:
        name = archive.run(name).id if name == LATEST else name  # noqa: PLW2901 - by its start, as every command means it
        here = [i for i in ids if i == name] or [i for i in ids if i.startswith(name)]
        if not here:
            raise WrongUse(f"archive {archive.root}: no run is called '{name}'; {did_you_mean(name, ids)}")
        chosen.update(here)
    return [entry for entry in known if entry.id in chosen]


def _holds(entry: SelectedRun, key: str, value: Any) -> bool:
    if key == "since":
        return entry.measured >= value
    if key == "until":
        return entry.measured <= value
    if key == "unit":
        return value in entry.units
    return str(getattr(entry, key)).lower() == str(value).lower()


def _there_is(chosen: list[SelectedRun], filters: list[tuple[str, Any]]) -> str:
    """The values of the runs for the keys of a filter that no run matches."""
    texts: list[str] = []
    for key, value in filters:
        if key in {"since", "until"}:
            texts.append(f"measured {chosen[0].measured:%Y-%m-%d} to {chosen[-1].measured:%Y-%m-%d};")
        elif key == "unit":
            close = close_matches(str(value), {unit for entry in chosen for unit in entry.units})
            texts += [f"{did_you_mean(str(value), close)}"] if close else []
        else:
            names = sorted({str(getattr(entry, key)) for entry in chosen})
            texts.append(f"{key}: {', '.join(names[:5])}{' …' if len(names) > 5 else ''};")
    return " ".join(dict.fromkeys(texts))
