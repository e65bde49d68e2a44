"""A disk that is full at any write of a run: one message, status 2; with space again the command goes on to the same bytes."""

import errno
from pathlib import Path

import pytest
from capture_double import BRIEF, CaptureDouble, small_job

from pipelines.archive import Archive, files
from pipelines.chain.chain import ORDER
from pipelines.chain.runner import Runner
from schemas.errors import UNUSABLE, ArchiveUnusable

RESULTS = ("readings", "history", "verdicts", "dwells", "coefficients", "covariance", "residuals", "grades", "figures")


class Disk:
    """A disk with room for so many files; the one after them is cut off half way."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.room, self.written = 10**9, 0
        self._write = files._write_durably
        monkeypatch.setattr(files, "_write_durably", self.write)

    def write(self, path: Path, data: bytes) -> None:
        if self.written >= self.room:
            path.write_bytes(data[: len(data) // 2])
            raise OSError(errno.ENOSPC, "No space left on device", str(path))
        self._write(path, data)
        self.written += 1


def run(folder: Path, name: str) -> dict[str, bytes]:
    runner = Runner(small_job(folder, *BRIEF), Archive(folder / name), measure=CaptureDouble())
    for stage in ORDER[:-1]:
        runner.stage(stage)
    return {name: (runner.run.path / f"{name}.parquet").read_bytes() for name in RESULTS}


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, bytes], int]:
    """The bytes of a run on a sound disk, and how many files it took."""
    with pytest.MonkeyPatch.context() as patch:
        disk = Disk(patch)
        folder = tmp_path_factory.mktemp("whole")
        return run(folder, "archive"), disk.written


QUICK = (0.8,)  # within the results
PARTS = (0.0, 0.01, 0.03, 0.2, 0.5, 0.77, 0.8, 0.85, 0.9, 0.95, 0.999)


@pytest.mark.parametrize("part", [pytest.param(p, marks=() if p in QUICK else pytest.mark.slow) for p in PARTS])
def test_a_full_disk_is_refused_by_name_and_loses_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, whole: tuple[dict[str, bytes], int], part: float
) -> None:
    results, count = whole
    disk = Disk(monkeypatch)
    disk.room = int(part * count)
    with pytest.raises(ArchiveUnusable, match=r"cannot be written .*space") as refused:
        run(tmp_path, "archive")
    assert refused.value.exit_status == UNUSABLE
    assert not list(tmp_path.glob("archive/**/.tmp-*"))
    disk.room = 10**9
    assert run(tmp_path, "archive") == results
