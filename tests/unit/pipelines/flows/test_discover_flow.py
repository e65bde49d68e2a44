"""The nightly flow: its page, its document, and the alert that follows from them."""

from datetime import UTC, datetime
from pathlib import Path

import pytest

from pipelines.demo.archive_lots import Line, write_lots
from pipelines.flows import discover
from pipelines.monitoring.alerts import alerts_of


def test_a_night_writes_page_and_document_and_a_discovery_is_an_alert(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = write_lots(tmp_path, Line(2), 3)
    told: list[str] = []
    monkeypatch.setattr(discover, "create_markdown_artifact", lambda key, markdown: told.append(markdown))
    monkeypatch.setattr(discover, "look", discover.look.fn)
    assert discover.discover_in_archive.fn(str(made.folder), pages=str(tmp_path / "pages")) == 0
    assert "0 discoveries in 3 lots" in told[0]
    page, document = sorted((tmp_path / "pages").iterdir())
    assert page.suffix == ".html"
    row = {
        "id": "D1",
        "effects": ["third_order"],
        "drivers": ["wafer"],
        "driver": "wafer",
        "size_ug": 0.4,
        "since": "2026-01-01",
    }
    found = document.read_text("utf-8").replace(
        '"discoveries": []', f'"discoveries": [{str(row).replace(chr(39), chr(34))}]'
    )
    document.write_text(found, encoding="utf-8")
    snapshot = type("Empty", (), {"when": datetime.now(UTC), "runs": [], "stations": None, "late": []})()
    monkeypatch.setattr("pipelines.monitoring.alerts._of_runs", lambda _: [])
    (alert,) = alerts_of(snapshot, tmp_path / "pages")
    assert (alert["kind"], alert["subject"]) == ("discovery", "wafer")
    assert "third_order by wafer, rms 0.4 µg" in alert["text"]
