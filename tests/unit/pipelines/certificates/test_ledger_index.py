"""The ledger's noted events: the same as the files tell, whatever was noted before."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from ledger_events import event

from benchmarks.generated_ledger import write_events
from pipelines.certificates import Ledger
from pipelines.certificates import ledger_index as module
from pipelines.certificates.ledger_index import INDEX_FOLDER, histories_of
from schemas.errors import ArchiveUnusable


@pytest.fixture
def ledger(tmp_path: Path) -> Ledger:
    filled = Ledger(tmp_path)
    evidence = (("coefficients", "1" * 64), ("grades", "2" * 64))
    for number in range(200):
        one = event(serial=f"A{number:03d}", sequence=1, evidence=evidence, when="2026-01-01T00:00:00+00:00")
        write_events(
            tmp_path, [one, replace(one, sequence=2, action="supersede", run="r-2", start="2026-06-01", ends=(1,))]
        )
    return filled


def told(root: Path) -> list[str]:
    return sorted(map(repr, histories_of(root).units))


def test_what_was_noted_is_what_the_files_tell(ledger: Ledger, tmp_path: Path) -> None:
    first, files = told(tmp_path), histories_of(tmp_path)
    assert (tmp_path / INDEX_FOLDER).is_dir()
    assert files.read == 0
    assert told(tmp_path) == first
    assert sorted(map(repr, [ledger.events(f"A{n:03d}") for n in range(200)])) == first
    for damage in (lambda path: path.write_bytes(path.read_bytes()[:100]), lambda path: path.write_bytes(b"foreign")):
        damage(min((tmp_path / INDEX_FOLDER).iterdir()))  # it is made again
        assert told(tmp_path) == first
        assert histories_of(tmp_path).read == 0
    shutil.rmtree(tmp_path / INDEX_FOLDER)
    assert told(tmp_path) == first


def test_only_events_that_are_new_or_changed_are_read_and_those_that_are_gone_are_not_told(
    ledger: Ledger, tmp_path: Path
) -> None:
    told(tmp_path)
    ledger.revoke("A007", "dropped", day="2026-07-01")
    place = next((tmp_path / "calibrations").glob("*/*/000002.json"))
    place.write_text(place.read_text(encoding="utf-8").replace('"bench"', '"bench-2"'), encoding="utf-8")
    histories = histories_of(tmp_path)
    assert histories.read == 2
    assert sum(len(own) for own in histories.units) == 401
    assert sum("bench-2" in one for one in told(tmp_path)) == 1
    told(tmp_path)
    shutil.rmtree(next((tmp_path / "calibrations").glob("*/*")))
    assert len(told(tmp_path)) == 199
    next((tmp_path / "calibrations").glob("*/*/000001.json")).unlink()
    assert len(histories_of(tmp_path).problems) == 1
    with pytest.raises(ArchiveUnusable, match=r"has event 000002\.json where number 1 is needed"):
        list(ledger.all())


def test_a_ledger_that_may_only_be_read_is_told_all_the_same(
    ledger: Ledger, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_args: object) -> None:
        raise ArchiveUnusable("archive: read-only")

    monkeypatch.setattr(module.files, "publish", refuse)
    assert len(list(ledger.all())) == 400
    assert not (tmp_path / INDEX_FOLDER).exists()
