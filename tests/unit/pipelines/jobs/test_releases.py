"""Releases and calibrations of an archive are files with numbers for names; others are not looked at."""

from pathlib import Path

from pipelines.archive import Archive
from pipelines.archive.cleaning import clean
from pipelines.jobs.releases import releases


def test_a_superscript_digit_is_no_number_of_a_file(tmp_path: Path) -> None:
    archive = Archive(tmp_path / "archive")
    archive.prepare()
    for folder in ("releases", "calibrations/aa/0123456789abcdef"):
        (archive.root / folder).mkdir(parents=True)
        (archive.root / folder / "².json").write_text("{}", encoding="utf-8")
    assert releases(archive) == []
    assert clean(archive).anchored == 0
