"""Runs of an archive by name or by what they are: ``all``, beginnings of names, ``device:…``, ``since:DATE``."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, date, datetime, time
from typing import TYPE_CHECKING, Any

from pipelines.archive import files
from schemas.errors import WrongUse, did_you_mean

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pipelines.archive import Archive

KEYS = ("device", "station", "unit", "recipe", "since", "until")
ALL, LATEST = "all", "latest"


@dataclass(frozen=True)
class Entry:
    """One run of an archive as its ``run.json`` tells.

    measured : when its data were measured, which for a re-run is when the first run of them was
    derived : whether the run is a re-run of another, or goes on with the measurements of one
    """

    id: str
    recipe: str
    device: str
    station: str
    units: tuple[str, ...]
    measured: datetime
    derived: bool


def entries(archive: Archive) -> list[Entry]:
    """Every run, the one measured first first."""
    found = [_entry(path.parent.name, files.read_json(path)) for path in (archive.root / "runs").glob("*/run.json")]
    return sorted(found, key=lambda entry: (entry.measured, entry.id))


def entry_of(run_id: str, about: dict[str, Any]) -> Entry:
    """One run as its ``run.json`` tells."""
    return _entry(run_id, about)


def selected(archive: Archive, words: Sequence[str]) -> list[Entry]:
    """The runs that are meant, each once, the one measured first first.

    Words with a colon must all hold; names and their beginnings add up. Where runs are chosen by what they are, re-runs are
    left out, for the run that they were made from stands for its data.

    Raises
    ------
    WrongUse
        A word names nothing, or no run is left.
    """
    known = entries(archive)
    parts = [part.strip() for word in words for part in word.split(",") if part.strip()]
    filters = [_filter(part) for part in parts if _key(part)]
    names = [part for part in parts if not _key(part)]
    if not known:
        raise WrongUse(
            f"archive {archive.root}: there is no run yet; make one with 'tumbleline run', or name another archive"
        )
    by_name = [name for name in names if name != ALL]
    chosen = _named(known, by_name, archive) if by_name else [entry for entry in known if not entry.derived]
    left = [entry for entry in chosen if all(_holds(entry, key, value) for key, value in filters)]
    if not left:
        raise WrongUse(
            f"archive {archive.root}: none of {len(chosen)} runs is {' '.join(words)}; {_there_is(chosen, filters)}"
            " look with 'tumbleline list'"
        )
    return left


def _key(part: str) -> str:
    """The key of a word such as ``device:ADXL355``; empty for a name."""
    key, colon, _ = part.partition(":")
    if not colon:
        return ""
    if key not in KEYS:
        raise WrongUse(f"selection: '{part}' is not known; {did_you_mean(key, KEYS)}")
    return key


def _filter(part: str) -> tuple[str, Any]:
    key, _, value = part.partition(":")
    if not value:
        raise WrongUse(f"selection: '{part}' says nothing after the colon, a value is needed; write {key}:VALUE")
    if key == "since":
        return key, moment(value, part)
    return (key, moment(value, part, end=True)) if key == "until" else (key, value)


def moment(text: str, where: str, *, end: bool = False) -> datetime:
    """A date or time as UTC; a date alone is its beginning, or its end where that is asked for."""
    try:
        found = datetime.fromisoformat(text)
        if len(text) <= len("2026-01-31"):
            found = datetime.combine(date.fromisoformat(text), time.max if end else time.min)
    except ValueError:
        raise WrongUse(f"{where}: '{text}' is no date, YYYY-MM-DD is needed; correct it") from None
    return found if found.tzinfo else found.replace(tzinfo=UTC)


def _named(known: list[Entry], names: list[str], archive: Archive) -> list[Entry]:
    ids = [entry.id for entry in known]
    chosen: set[str] = set()
    for name in names:
        here = [ids[-1]] if name == LATEST else [i for i in ids if i == name] or [i for i in ids if i.startswith(name)]
        if not here:
            raise WrongUse(f"archive {archive.root}: no run is called '{name}'; {did_you_mean(name, ids)}")
        chosen.update(here)
    return [entry for entry in known if entry.id in chosen]


def _holds(entry: Entry, key: str, value: Any) -> bool:
    if key == "since":
        return entry.measured >= value
    if key == "until":
        return entry.measured <= value
    if key == "unit":
        return value in entry.units
    return str(getattr(entry, key)).lower() == str(value).lower()


def _there_is(chosen: list[Entry], filters: list[tuple[str, Any]]) -> str:
    """What the runs do have where a filter left none, for the keys that were asked for."""
    said: list[str] = []
    for key, _ in filters:
        if key in {"since", "until"}:
            said.append(f"measured {chosen[0].measured:%Y-%m-%d} to {chosen[-1].measured:%Y-%m-%d};")
        elif key != "unit":
            names = sorted({str(getattr(entry, key)) for entry in chosen})
            said.append(f"{key}: {', '.join(names[:5])}{' …' if len(names) > 5 else ''};")
    return " ".join(dict.fromkeys(said))


def _entry(run_id: str, about: dict[str, Any]) -> Entry:
    lot = about.get("lot", {})
    when = datetime.fromisoformat(about.get("measured") or about["when"])
    return Entry(
        id=run_id,
        recipe=about.get("recipe", {}).get("name", "import" if "source" in about else about.get("name", "")),
        device=lot.get("device", ""),
        station=about.get("station", {}).get("name", ""),
        units=tuple(unit["serial"] for unit in lot.get("units", [])),
        measured=when if when.tzinfo else when.replace(tzinfo=UTC),
        derived="rerun_of" in about or bool(about.get("parents")),
    )
