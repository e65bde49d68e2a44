"""Interruptions of a run at its station: open door, pauses, repeated dwells, units that were given up."""

from typing_extensions import TypedDict

from pipelines.archive import Run
from pipelines.tables.frames import rows_of

KINDS = ("suspended", "spoilt", "resumed", "unit_lost", "power", "emergency_stop", "stopped")
PAUSES = ("suspended", "spoilt")
DOOR = "door is open"


class Interruption(TypedDict):
    """One event, at ``time_s`` on the station's clock; ``record`` and ``pose`` of its dwell, −1 and empty where it has none."""

    time_s: float
    kind: str
    record: int
    pose: str
    reason: str
    action: str


class RepeatedDwell(TypedDict):
    """A dwell that was discarded and measured again: how many times, and why."""

    record: int
    pose: str
    times: int
    reasons: list[str]


class Interruptions(TypedDict):
    """All interruptions of a run; ``paused_s`` is the sum of the times from a pause to the event that resumed the run, s."""

    door_opened: int
    pauses: int
    paused_s: float
    repeated_dwells: list[RepeatedDwell]
    events: list[Interruption]


def interruptions(run: Run) -> Interruptions | None:
    """The interruptions of a run; None where its archive has no events (imported data, or an older version)."""
    if "events" not in run.tables():
        return None
    poses = _poses(run)
    rows = [row for row in rows_of(run.table("events")) if row["kind"] in KINDS]
    events: list[Interruption] = [
        {
            "time_s": float(row["time_s"]),
            "kind": str(row["kind"]),
            "record": int(row["record"]),
            "pose": poses.get(int(row["record"]), ""),
            "reason": str(row["reason"]),
            "action": str(row["action"]),
        }
        for row in rows
    ]
    pauses = [event for event in events if event["kind"] in PAUSES]
    return {
        "door_opened": sum(DOOR in event["reason"] for event in pauses),
        "pauses": len(pauses),
        "paused_s": round(_paused(events), 3),
        "repeated_dwells": _repeated(events),
        "events": events,
    }


def _poses(run: Run) -> dict[int, str]:
    if "readings" not in run.tables():
        return {}
    readings = run.table("readings").drop_duplicates("record")
    return {int(record): str(pose) for record, pose in zip(readings["record"], readings["pose"], strict=True)}


def _paused(events: list[Interruption]) -> float:
    """Seconds from the first of consecutive pauses to the event that resumed the run, summed."""
    total, since = 0.0, None
    for event in events:
        if event["kind"] in PAUSES and since is None:
            since = event["time_s"]
        elif event["kind"] == "resumed" and since is not None:
            total, since = total + event["time_s"] - since, None
        elif event["kind"] in {"stopped", "emergency_stop"}:
            since = None
    return total


def _repeated(events: list[Interruption]) -> list[RepeatedDwell]:
    dwells: dict[int, RepeatedDwell] = {}
    for event in events:
        if event["kind"] == "spoilt":
            new: RepeatedDwell = {"record": event["record"], "pose": event["pose"], "times": 0, "reasons": []}
            dwell = dwells.setdefault(event["record"], new)
            dwell["times"] += 1
            dwell["reasons"].append(event["reason"])
    return list(dwells.values())
