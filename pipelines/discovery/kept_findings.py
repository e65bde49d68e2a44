"""The discoveries of the last look, kept beside the evidence: the same ids the next time, and no name is found twice."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from typing import Any

from pipelines.archive import Archive, derived, files
from pipelines.archive.store import Place
from pipelines.discovery.documents import DiscoverDocument, DiscoveryRow
from pipelines.discovery.evidence_state import Evidences
from pipelines.discovery.lot_source import DiscoveryArchive
from pipelines.discovery.nights import held
from pipelines.discovery.score_store import FOLDER
from pipelines.tables.json_values import json_value

_GROWN = 1.05  # more lots than this factor: the names are found again


def alarm_key(state: Evidences) -> list[str]:
    """The alarms of a state as text: while they are the same, so are the names."""
    return sorted(f"{alarm.driver} {alarm.place}" for alarm in state.alarms if not held(state, alarm))


def rows_of_before(source: DiscoveryArchive, state: Evidences) -> list[DiscoveryRow] | None:
    """The discoveries of the last night, where no alarm is new and few lots came in since; None where they are found again."""
    before = _stored(source)
    if before is None or before["alarms"] != alarm_key(state) or len(state.order) > _GROWN * before["lots"]:
        return None
    return before["discoveries"]


def discovered_before(archive: Archive) -> list[tuple[str, int]]:
    """Kinds of devices with discoveries of an earlier look, and their number; nothing is judged."""
    top = archive.root / FOLDER
    names = (
        sorted(place.name for place in top.iterdir() if place.name not in {"scores", "lock"}) if top.is_dir() else []
    )
    found = ((name, _read_found(top / name / "found")) for name in names)
    return [
        (name, len(stored["discoveries"])) for name, stored in found if stored is not None and stored["discoveries"]
    ]


def _stored(source: DiscoveryArchive) -> dict[str, Any] | None:
    return _read_found(source.folder() / "found")


def _read_found(place: Place) -> dict[str, Any] | None:
    if not place.is_file():
        return None
    data, standing = derived.unframed(place)
    return json.loads(data) if standing == derived.SOUND else None


def remembered(source: DiscoveryArchive, state: Evidences, document: DiscoverDocument) -> DiscoverDocument:
    """Keep a document beside the evidence, so that discoveries have the same ids the next time."""
    stored = _stored(source) or {"discoveries": [], "lots": 0}
    before: list[dict[str, Any]] = stored["discoveries"]
    used, free = {row["id"] for row in before}, list(before)
    numbers = (f"D{n}" for n in range(1, 10_000))
    for row in document["discoveries"]:
        same = next(
            (old for old in free if old["driver"] == row["driver"] and set(old["effects"]) & set(row["effects"])), None
        )
        if same is not None:
            free.remove(same)
            row["id"], row["since"], row["lots_then"] = same["id"], same["since"], same["lots_then"]
        else:
            row["id"] = next(one for one in numbers if one not in used)
            used.add(row["id"])
    known = {row["id"] for row in before}
    document["new"] = [row["id"] for row in document["discoveries"] if row["id"] not in known]
    kept = {
        "discoveries": document["discoveries"],
        "lots": len(state.order),
        "alarms": alarm_key(state),
        "when": datetime.now(UTC).isoformat(timespec="seconds"),
    }
    if stored.get("alarms") != kept["alarms"] or len(state.order) > _GROWN * stored["lots"]:
        files.publish(source.folder() / "found", derived.framed(json.dumps(json_value(kept), sort_keys=True).encode()))
    return document
