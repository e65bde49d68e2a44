"""The evidence of an archive, updated night by night: a ledger of the new lots and the new alarms of each night.

``discovery/<device>/nights/<number>.json`` is never rewritten: a run whose calibration is revoked later is removed from that
night on, which the entry records. ``discovery/<device>/state`` is a derived cache of the sums, which can be computed again from
the scores. ``discovery/<device>/found`` has the discoveries of the last night, so that they keep their ids and are new once.
"""

import json
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from itertools import groupby
from typing import Any

from inertial.discovery.running_sums import FIRST
from pipelines.archive import Archive, derived, files
from pipelines.archive.locks import alone
from pipelines.archive.store import Place
from pipelines.discovery.documents import DiscoverDocument, DiscoveryRow, UnexplainedRow
from pipelines.discovery.evidence_state import Alarm, Evidences, state_bytes, stored_state
from pipelines.discovery.lot_source import DiscoveryArchive
from pipelines.discovery.score_store import FOLDER
from pipelines.tables.json_values import json_value

_VERSION = 5  # of the stored findings: only ids of an earlier version are used, and the naming is repeated
_GROWN = 1.05  # growth of the number of lots from which on the naming is repeated
_NOTHING: dict[str, Any] = {"discoveries": [], "unexplained": [], "lots": 0, "ids": 0, "alarms": None}


def grown_by_days(source: DiscoveryArchive, state: Evidences, runs: Sequence[str]) -> Evidences:
    """Evidence with further lots, one night for each day of measurement, so that a backlog of years is processed at once."""
    for _, of_day in groupby(runs, key=source.day_of):
        state.night += 1
        for sensor, station in source.lots(of_day):
            state.sensor.add(sensor)
            state.station.add(station)
            state.order.append(sensor.run)
        generation = 1 + max(state.generations.values(), default=-1)
        for driver in state.sensor.drivers:
            state.generations.setdefault(driver, generation)
        state.alarms += state.raised()
    return state


def brought_up(source: DiscoveryArchive) -> Evidences:
    """The evidence of the archive, updated with runs scored and revoked since the last night."""
    folder = source.folder()
    with alone(folder, wait=True):
        nights = [files.read_json(path) for path in _listed(folder / "nights") if path.name.endswith(".json")]
        state = stored_state(source, folder, nights)
        if state is None:
            state = _replayed(source, nights, ())
        gone = [run for run in state.order if run in source.revoked]
        if gone:
            night, state = state.night, _replayed(source, nights, gone)
            state.night = night
        counted = {*state.order, *state.taken_out}
        new = [run for run in source.pooled() if run not in counted and run not in source.revoked]
        if new or gone:
            before = state.night
            state = grown_by_days(source, state, new)
            _write(folder, state, before, new, gone, nights)
        return state


def _listed(folder: Place) -> list[Place]:
    """What a folder holds, by name; nothing where it is not there."""
    return sorted(folder.iterdir(), key=lambda path: path.name) if folder.is_dir() else []


def _replayed(source: DiscoveryArchive, nights: Sequence[Mapping[str, Any]], gone: Sequence[str]) -> Evidences:
    """The evidence, computed again in the order of the ledger, with the attributes that were known in each night.

    Lots without scores, those removed later and those that are ``gone`` now are left out.
    """
    state = Evidences.fresh(source)
    state.taken_out = [*(run for night in nights for run in night["taken_out"]), *gone]
    out = set(state.taken_out)
    for night in nights:
        source.known_until(night["when"])
        runs = [run for run in night["runs"] if run in source.store.heads and run not in out]
        state = grown_by_days(source, state, runs)
    source.known_until("")
    # an alarm that was raised remains, even if a run that contributed to it was removed since
    index = {str(hypothesis): at for at, hypothesis in enumerate(state.hypotheses)}
    state.alarms += state.unknown(
        Alarm(alarm["driver"], index[alarm["column"]], night["night"], alarm["lots"], alarm["log_e"])
        for night in nights
        for alarm in night["alarms"]
        if alarm["column"] in index
    )
    return state


def _write(
    folder: Place,
    state: Evidences,
    before: int,
    new: Sequence[str],
    gone: Sequence[str],
    nights: Sequence[Mapping[str, Any]],
) -> None:
    """Write the entry of a night, which is never rewritten, and the state as a cache."""
    data = state_bytes(state) if len(state.order) >= FIRST else b""  # the first lots wait, and are read again
    entry = {
        "night": state.night,
        "when": datetime.now(UTC).isoformat(timespec="seconds"),
        "runs": list(new),
        "taken_out": list(gone),
        "lots": len(state.order),
        "alarms": [
            {
                "driver": alarm.driver,
                "column": str(state.hypotheses[alarm.index]),
                "lots": alarm.lots,
                "log_e": round(alarm.log_e, 2),
            }
            for alarm in state.alarms
            if alarm.night > before
        ],
        "state": files.hash_of(data),
        "previous": files.hash_of(files.json_bytes(nights[-1])) if nights else "",
    }
    files.publish_first(folder / "nights" / f"{len(nights) + 1:06d}.json", files.json_bytes(entry))
    files.publish(folder / "state", derived.framed(data))


def found_before(source: DiscoveryArchive, state: Evidences) -> tuple[list[DiscoveryRow], list[UnexplainedRow]] | None:
    """Discoveries and unexplained dependences of the last night; None if alarms or the number of lots changed too much."""
    before = _found(source.folder())
    if before["alarms"] != _alarms(state) or len(state.order) > _GROWN * before["lots"]:
        return None
    return before["discoveries"], before["unexplained"]


def discovered_before(archive: Archive) -> list[tuple[str, int]]:
    """Kinds of devices with stored discoveries, named or not, and their number; nothing is evaluated."""
    found = {folder.name: _found(folder) for folder in _listed(archive.root / FOLDER)}
    counts = {name: len(stored["discoveries"]) + len(stored["unexplained"]) for name, stored in found.items()}
    return [(name, count) for name, count in counts.items() if count]


def _alarms(state: Evidences) -> list[str]:
    """The alarms that are discoveries, as text: while they do not change, the names do not either."""
    return sorted(f"{alarm.driver} {alarm.index}" for alarm in state.judged(held=False))


def _found(folder: Place) -> dict[str, Any]:
    """The stored findings of a kind of device, their number of lots and of ids."""
    path = folder / "found"
    data, standing = derived.unframed(path) if path.is_file() else (b"", "")
    if standing != derived.SOUND:
        return _NOTHING
    found: dict[str, Any] = json.loads(data)
    if found.get("version") == _VERSION:
        return found
    rows = [*found["discoveries"], *found.get("unexplained", [])]
    known = max((int(row["id"][1:]) for row in rows), default=0)
    return {**_NOTHING, "ids": known, **found, "alarms": None}


def remembered(
    source: DiscoveryArchive, state: Evidences, document: DiscoverDocument, *, keep: bool
) -> DiscoverDocument:
    """The document with discoveries identified by their earlier ids, and the list of new ones.

    keep : store the findings, so that they are not new the next time; not for an evaluation of a part of the archive
    """
    stored = _found(source.folder())
    left: list[dict[str, Any]] = [*stored["discoveries"], *stored["unexplained"]]
    rows = [*document["discoveries"], *document["unexplained"]]
    document["new"] = []
    for row in rows:
        row["id"] = ""
    # match equal effects first; then discoveries that were unexplained before and have a name now, or vice versa
    for matches in (_effects_in_common, lambda old, new: not _effects(old) or not _effects(new)):
        for row in (row for row in rows if not row["id"]):
            earlier = next((old for old in left if old["driver"] == row["driver"] and matches(old, row)), None)
            if earlier is not None:
                left.remove(earlier)
                row["id"], row["since"], row["lots_then"] = earlier["id"], earlier["since"], earlier["lots_then"]
    for row in (row for row in rows if not row["id"]):
        row["id"] = f"D{stored['ids'] + len(document['new']) + 1}"
        document["new"].append(row["id"])
    found = {
        "version": _VERSION,
        "discoveries": document["discoveries"],
        "unexplained": document["unexplained"],
        "lots": len(state.order),
        "ids": stored["ids"] + len(document["new"]),
        "alarms": _alarms(state),
        "when": datetime.now(UTC).isoformat(timespec="seconds"),
    }
    if keep and (stored["alarms"] != found["alarms"] or found["lots"] > _GROWN * stored["lots"]):
        files.publish(source.folder() / "found", derived.framed(json.dumps(json_value(found), sort_keys=True).encode()))
    return document


def _effects(row: Mapping[str, Any]) -> set[str]:
    """The class of effects of a discovery; empty for an unexplained dependence."""
    return set(row.get("effects", ()))


def _effects_in_common(old: Mapping[str, Any], new: Mapping[str, Any]) -> bool:
    return bool(_effects(old) & _effects(new)) or _effects(old) == _effects(new)
