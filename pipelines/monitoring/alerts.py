"""Alerts to a web hook: runs crashed, failed, missed or late, stations not left safe, findings of the audit, discoveries.

Each alert is posted until the receiver accepts it, and not after that: its id is then written to the state folder, atomically and
synchronised to the disk. A process that is killed between these two steps posts the alert twice, with the same id.
"""

import json
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from hashlib import sha256
from http.client import HTTPException
from pathlib import Path
from typing import Any, cast

from pipelines.archive.files import json_bytes, publish
from pipelines.monitoring.documents import Alert
from pipelines.monitoring.snapshot import Snapshot
from schemas.errors import WrongUse

TIMEOUT_S = 10.0
ACCEPTED_FILE = "alerts.json"
MOST_IDS = 5000
AUDIT_AGE = timedelta(days=10)  # findings of an older audit are not posted
CONTENT_REFUSED = {400, 413, 422}  # answers that refuse one alert for its content; the alerts after it are posted
KINDS = {"CRASHED": "crashed", "FAILED": "failed", "CANCELLED": "missed"}


def alerts_of(snapshot: Snapshot, audits: Path | None = None) -> list[Alert]:
    """All alerts from the numbers and the newest audit, including those that were posted before.

    audits : folder of the documents of the audits (``pages`` of the deployment weekly-audit); none where None
    """
    alerts = [*_of_runs(snapshot), *_of_stations(snapshot)]
    if audits is None:
        return alerts
    return [*alerts, *_of_audit(audits, snapshot.when), *_of_discoveries(audits, snapshot.when)]


class _NoRedirection(urllib.request.HTTPRedirectHandler):
    """A redirection is an error here: a POST would become a GET, whose answer accepts nothing."""

    def redirect_request(self, *_: Any, **_named: Any) -> None:
        return None


class Poster:
    """Posts the alerts that the receiver has not accepted yet.

    address : of the web hook, http or https
    folder : state folder, which holds the ids of accepted alerts

    Raises WrongUse: the address begins with neither ``http://`` nor ``https://``.
    """

    def __init__(self, address: str, folder: Path) -> None:
        if not address.startswith(("http://", "https://")):
            raise WrongUse(f"alerts: web hook '{address}', an address such as https://host/path is needed; correct it")
        self._address, self._path = address, folder / ACCEPTED_FILE

    def post(self, alerts: list[Alert]) -> tuple[int, str]:
        """Number of alerts accepted in this call, and the first error; the next call posts the remaining alerts."""
        accepted = self._accepted()
        count, fault = 0, ""
        for alert in alerts:
            if alert["id"] in accepted:
                continue
            try:
                self._send(alert)
            except (OSError, HTTPException) as problem:
                fault = fault or f"alerts: the web hook does not accept an alert ({problem}); it is posted again"
                if not isinstance(problem, urllib.error.HTTPError):
                    return count, fault
                problem.close()
                if problem.code in CONTENT_REFUSED:
                    continue
                return count, fault
            accepted[alert["id"]] = time.time()
            newest = sorted(accepted.items(), key=lambda item: item[1])[-MOST_IDS:]
            publish(self._path, json_bytes(dict(newest)))
            count += 1
        return count, fault

    def _send(self, alert: Alert) -> None:
        headers = {"Content-Type": "application/json", "User-Agent": "tumbleline"}
        request = urllib.request.Request(self._address, json.dumps(alert).encode(), headers)  # noqa: S310 - checked above
        with urllib.request.build_opener(_NoRedirection).open(request, timeout=TIMEOUT_S):
            return

    def _accepted(self) -> dict[str, float]:
        try:
            content = json.loads(self._path.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return {}
        known = cast("dict[Any, Any]", content if isinstance(content, dict) else {})
        return {str(key): float(value) for key, value in known.items() if isinstance(value, int | float)}


def _of_runs(snapshot: Snapshot) -> Iterator[Alert]:
    if snapshot.queues is None:
        return
    for run in snapshot.queues.ended:
        kind = KINDS[run.state]
        text = f"run {run.name} of queue {run.queue}: {kind}; {run.message or 'no message'}"
        yield _alert(kind, f"{run.id} {run.count}", run.name, text, snapshot.when)
    for run in snapshot.queues.late(snapshot.when):
        text = f"run {run.name} of queue {run.queue} was due at {run.since:%Y-%m-%d %H:%M} UTC and has not started"
        yield _alert("late", run.id, run.name, text, snapshot.when)


def _of_stations(snapshot: Snapshot) -> Iterator[Alert]:
    remedy = "check axes and chamber, see 'tumbleline station status'"
    for name, run in sorted(snapshot.stations.unsafe.items()) if snapshot.stations else ():
        text = f"station {name} was not reported safe after {run}; {remedy}"
        yield _alert("unsafe", f"{name} {run}", name, text, snapshot.when)


def _of_discoveries(folder: Path, now: datetime) -> Iterator[Alert]:
    """Discoveries of the newest night; each is posted once."""
    named, unexplained = (_newest(folder, "discover", key, now) for key in ("discoveries", "unexplained"))
    for row in (*named, *unexplained):
        effects, drivers = (" | ".join(map(str, row.get(key, ()))) for key in ("effects", "drivers"))
        what = f"{effects} by {drivers}, rms {float(row.get('size_ug') or 0.0):.2g} µg; {row.get('because')}"
        if not effects:
            what = f"unexplained by {row.get('driver')}, no effect of the catalogue explains it"
        text = f"discovery {row.get('id')}: {what}"
        yield _alert("discovery", f"{row.get('id')} {row.get('since')}", str(row.get("driver", "")), text, now)


def _newest(folder: Path, kind: str, key: str, now: datetime) -> list[dict[str, Any]]:
    """A list of the newest document of a kind; empty where there is no document, or an old one."""
    newest = max(folder.glob(f"{kind}-*.json"), key=lambda path: path.name, default=None)
    if newest is None or now - datetime.fromtimestamp(newest.stat().st_mtime, UTC) > AUDIT_AGE:
        return []
    try:
        return list(json.loads(newest.read_text(encoding="utf-8"))[key])
    except (OSError, ValueError, KeyError, TypeError):
        return []


def _of_audit(folder: Path, now: datetime) -> Iterator[Alert]:
    """Findings of the newest audit document; a finding that appears in several audits is posted once."""
    for finding in _newest(folder, "audit", "findings", now):
        subject = str(finding.get("subject", ""))
        text = f"audit, {finding.get('whose', 'audit')}: {finding.get('message', '')}"
        yield _alert("audit", f"{finding.get('kind')} {subject} {finding.get('message')}", subject, text, now)


def _alert(kind: str, identity: str, subject: str, text: str, when: datetime) -> Alert:
    name = sha256(f"{kind} {identity}".encode()).hexdigest()[:24]
    at = when.isoformat(timespec="seconds")
    return {"source": "tumbleline", "kind": kind, "id": name, "subject": subject, "text": text, "when": at}
