"""Attributes of units and runs, added to an archive: append-only, with source, author and date; and listed."""

import math
import re
from collections.abc import Iterable, Mapping
from datetime import UTC, datetime, timedelta
from io import StringIO
from pathlib import Path
from typing import Any, Literal, cast

import numpy as np
import pandas as pd

from inertial.counts import number_of
from inertial.discovery.evidence import DATE, MEAN, SLOT, STATION, UNIT
from pipelines.archive import Archive, files
from pipelines.archive.attributes import FOLDER, attribute_files, known_attributes
from pipelines.archive.locks import alone
from pipelines.archive.provenance import provenance
from pipelines.discovery.documents import AddedAttributes, KnownAttribute, ListedAttributes
from pipelines.importers.text_table import decoded
from schemas.errors import WrongUse, close_matches, did_you_mean

By = Literal["serial", "run"]

NOT_DRIVERS = {"grade", "outcome", "pass", "passed", "fail", "failed", "yield", "certificate"}
"""Columns derived from the calibration result: as drivers they would show effects that do not exist (selection bias)."""

_SHOWN = 5
_DAY = re.compile(r"\d{4}-\d{2}-\d{2}")
_FIRST_TO_BEGIN = timedelta(hours=14)  # a day begins so much earlier in the easternmost time zone than in UTC
_DECIMAL_COMMA = r"^\s*([+-]?\d+),(\d+)\s*$"


def add_attributes(archive: Archive, table: pd.DataFrame, by: By, source: str) -> AddedAttributes:
    """Add a table of attributes to an archive, with a key column ``serial`` (or ``unit``) or ``run``; returns the counts.

    Raises
    ------
    WrongUse
        The key is missing, empty or has conflicting values, no column of an attribute is left, or one has a driver's name.
    """
    archive.refuse_none()
    if twice := table.columns[table.columns.duplicated()].tolist():
        raise WrongUse(f"attributes: {source} has two columns '{twice[0]}', names must differ; rename or remove one")
    key = _key_column(table, by, source)
    named = [str(name) for name in table.columns if name != key]
    if taken := [name for name in named if name in (MEAN, DATE, STATION, SLOT, UNIT)]:
        raise WrongUse(
            f"attributes: {source} has a column '{taken[0]}', the name of a driver that every run has; rename or remove it"
        )
    refused = [name for name in named if name.lower() in NOT_DRIVERS]
    names = [name for name in named if name not in refused]
    if not names:
        more = f"; {', '.join(refused)} follow from the result" if refused else ""
        raise WrongUse(f"attributes: {source} has no column beside {key}, an attribute is needed{more}")
    before = known_attributes(archive)
    known = before.serial if by == "serial" else before.run
    values = _values(table, key, names, source)
    new, counts = dict[str, dict[str, str]](), {"added": 0, "changed": 0, "unchanged": 0}
    for subject, texts in values.items():
        for name, value in texts.items():
            old = known.get(subject, {}).get(name)
            kind = "added" if old is None else "unchanged" if old == value else "changed"
            counts[kind] += 1
            if kind != "unchanged":
                new.setdefault(subject, {})[name] = value
    file = _append(archive, {"by": by, "source": source, "values": new, **provenance()}) if new else ""
    infos = archive.runs()
    present = {info.id for info in infos} if by == "run" else {unit for info in infos for unit in info.units}
    unknown = [subject for subject in values if subject not in present]
    similar = {subject: [*close] for subject in unknown[:_SHOWN] if (close := close_matches(subject, present))}
    return {
        **counts,  # type: ignore[typeddict-item]  # the three counts
        "by": by,
        "names": names,
        "unknown": unknown,
        "similar": similar,
        "refused": refused,
        "future": _future(new),
        "quantities": [name for name in names if as_numbers(known_attributes(archive).values(name)) is not None],
        "file": file,
    }


def as_numbers(values: Iterable[str]) -> dict[str, float] | None:
    """Numbers by text if the values are a quantity (dates, as days; or numbers, some with a fraction); None for labels."""
    present = {value for value in values if value}
    days = bool(present) and all(_DAY.fullmatch(value) for value in present)
    try:
        numbers = {value: float(np.datetime64(value, "D").astype(float) if days else value) for value in present}
    except ValueError:
        return None
    if days:
        return numbers
    finite = all(math.isfinite(number) for number in numbers.values())
    return numbers if finite and any(not number.is_integer() for number in numbers.values()) else None


def _future(values: Mapping[str, Mapping[str, str]]) -> list[str]:
    """Dates after today, each with its attribute and subject; a date when something is due may be."""
    today = (datetime.now(UTC) + _FIRST_TO_BEGIN).date().isoformat()
    every = ((subject, name, value) for subject, texts in values.items() for name, value in texts.items())
    return [
        f"{value} as {name} of {subject}" for subject, name, value in every if _DAY.fullmatch(value) and value > today
    ]


def _append(archive: Archive, content: Mapping[str, Any]) -> str:
    """Write the next file of attributes, under a lock, and return its name."""
    with alone(archive.root / FOLDER, wait=True):
        path = archive.root / FOLDER / f"{len(attribute_files(archive)) + 1:06d}.json"
        files.publish(path, files.manifest_bytes(content))
    return path.name


def _key_column(table: pd.DataFrame, by: By, source: str) -> str:
    wanted = ("serial", "unit") if by == "serial" else ("run",)
    found = next((str(name) for name in table.columns if str(name).lower() in wanted), None)
    if found is None:
        names = [str(name) for name in table.columns]
        raise WrongUse(
            f"attributes: {source} has no column '{wanted[0]}', one is needed with --by {by}; "
            f"{did_you_mean(wanted[0], names)}"
        )
    return found


def _values(table: pd.DataFrame, key: str, names: list[str], source: str) -> dict[str, dict[str, str]]:
    """The values as text by key and attribute, without empty cells."""
    out: dict[str, dict[str, str]] = {}
    for row in table.to_dict("records"):
        subject = _text(row[key])
        if not subject:
            raise WrongUse(
                f"attributes: {source} has a row without {key}, one is needed in each; fill it in or remove the row"
            )
        texts = out.setdefault(subject, {})
        for name in names:
            value = _text(row[name])
            if _DAY.fullmatch(value) and as_numbers([value]) is None:
                raise WrongUse(
                    f"attributes: {source} has {value} as {name} of {subject}, which no calendar has; correct it or empty it"
                )
            if value and texts.get(name, value) != value:
                raise WrongUse(
                    f"attributes: {source} has two values of {name} for {subject} ({texts[name]}, {value}), one is needed; "
                    "add the newer one in a file of its own"
                )
            if value:
                texts[name] = value
    return out


def _text(value: object) -> str:
    """A cell as text: integers without a decimal point, empty for a missing value."""
    if value is None or value is pd.NaT or (isinstance(value, float) and math.isnan(value)):
        return ""
    if isinstance(value, (float, np.floating)) and float(value).is_integer():
        return str(int(value))
    return str(value).strip()


def sentences(added: AddedAttributes) -> list[str]:
    """Sentences on the attributes that were added."""
    what = ", ".join(added["names"])
    new = number_of(added["added"], "new value")
    lines = [f"{what}: {new}, {added['changed']} changed, {added['unchanged']} as before"]
    labels = [name for name in added["names"] if name not in added["quantities"]]
    kinds = (("quantities", added["quantities"]), ("labels", labels))
    lines.append("; ".join(f"{kind}: {', '.join(names)}" for kind, names in kinds if names))
    if added["unknown"]:
        counted = number_of(len(added["unknown"]), str(added["by"]))
        lines.append(f"not in the archive yet: {counted} ({_some(added['unknown'], _SHOWN)}); they are kept")
        lines += [f"{subject}: {did_you_mean(subject, close)}" for subject, close in added["similar"].items()]
    if added["future"]:
        dates = number_of(len(added["future"]), "date")
        lines.append(
            f"after today: {dates} ({_some(added['future'], _SHOWN)}), today or earlier is needed unless something is due then; "
            "correct what is wrong in a file of its own"
        )
    if added["refused"]:
        lines.append(f"not taken, because they follow from the result: {', '.join(added['refused'])}")
    return lines


_EXAMPLES = 4


def added_from(archive: Archive, path: Path, by: str) -> tuple[AddedAttributes, list[str]]:
    """Add the attributes of a file to an archive; returns the counts and sentences about them.

    Raises
    ------
    WrongUse
        The file is missing or not a table.
    """
    if by not in {"serial", "run"}:
        raise WrongUse(f"attributes: --by is '{by}', serial or run is needed")
    if not path.is_file():
        raise WrongUse(f"attributes: there is no file {path}; give a .csv or .parquet file")
    try:
        table = pd.read_parquet(path) if path.suffix.lower() == ".parquet" else _text_table(path)
    except (ValueError, OSError) as problem:  # pandas' and Arrow's errors of a file are of these kinds
        raise WrongUse(
            f"attributes: {path} is no table ({str(problem).splitlines()[0]}); give a .csv or .parquet file"
        ) from None
    added = add_attributes(archive, table, cast("By", by), path.name)
    return added, sentences(added)


def _text_table(path: Path) -> pd.DataFrame:
    """The cells of a text file as text; divided by commas, or by semicolons or tabs as spreadsheets of some countries save it."""
    text, _ = decoded(path.read_bytes(), path.name)
    head = text.partition("\n")[0]
    divider = max(",;\t", key=head.count)
    rows = pd.read_csv(StringIO(text), sep=divider, header=None, dtype=str, keep_default_na=False)
    if divider != ",":
        rows = rows.replace(_DECIMAL_COMMA, r"\1.\2", regex=True)
    return rows[1:].set_axis(list(rows.iloc[0]), axis=1)


def listed(archive: Archive) -> ListedAttributes:
    """Every attribute of units and of runs, with the number of known values, the number of levels, and examples."""
    known = known_attributes(archive)
    rows: list[KnownAttribute] = []
    for kind, by_key in (("units", known.serial), ("runs", known.run)):
        names = dict.fromkeys(name for values in by_key.values() for name in values)
        for name in names:
            values = [texts[name] for texts in by_key.values() if name in texts]
            levels = sorted(set(values))
            examples = _some(levels, _EXAMPLES)
            rows.append(
                {
                    "attribute": name,
                    "of": kind,
                    "known": len(values),
                    "levels": len(levels),
                    "judged_as": "quantity" if as_numbers(values) else "labels",
                    "such_as": examples,
                }
            )
    return {"attributes": rows}


def _some(texts: list[str], most: int) -> str:
    return ", ".join(texts[:most]) + (", …" if len(texts) > most else "")
