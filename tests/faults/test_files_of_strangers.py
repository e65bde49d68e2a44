"""A file from a stranger harms nobody: readers that never return, that take all memory, or that leave copies behind."""

import gzip
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from each import each
from long_suites import mostly_slow
from root_process import ROOT

from pipelines.importers import files, limited
from pipelines.importers.limited import MIB, ReadingLimits, in_reader
from schemas.errors import DataRejected

FEW = ReadingLimits(256 * MIB, 20, 60)  # the first request of a reader imports this module there


def never_returns(seconds: float) -> int:
    """One operation of Python that holds everything else up, as the library of IDE recordings did."""
    time.sleep(seconds)
    return 9**99**99 if seconds >= 0 else 0


def takes_memory(mib: int) -> int:
    return len(bytearray(mib * MIB))


def of_its_process() -> int:
    return os.getpid()


def loads() -> int:
    """What a copy needs."""
    import pipelines.importers.readers.uff58 as module

    return len(module.__name__)


def copies_to(folder: str) -> None:
    from pipelines.importers.readers.uff58 import as_file

    with as_file(b"x" * 1000) as path:
        Path(folder, "began").write_text(f"{path} {len(path.read_bytes())}", encoding="utf-8")
        time.sleep(60)


def in_tests(function, *given, limits: ReadingLimits = FEW):
    return in_reader(limits, "a.bin", function, *given)


@pytest.fixture
def foreign_ide(shared_data: Path) -> bytes:
    pytest.importorskip("idelib")
    return (shared_data / "dynamic-files" / "enDAQ-test.ide").read_bytes()


PROGRAM = """
import sys
from pathlib import Path
from pipelines.importers.files import *
for name in sys.argv[1:]:
    try:
        content_here(Path(name))
    except DataRejected as refusal:
        print(refusal)
"""


def test_a_string_of_an_ide_recording_that_is_no_number_is_refused_and_not_evaluated(
    tmp_path: Path, foreign_ide: bytes
) -> None:
    """In a process that can be ended: what is evaluated never returns."""
    texts = (b"9**99**99", b"math.e**9", b"__import_", b"1/2/3/4/5", b"1.0/0.000")
    bombs = [tmp_path / f"bomb{number}.ide" for number in range(len(texts))]
    for path, text in zip(bombs, texts, strict=True):
        path.write_bytes(foreign_ide.replace(b"1.0/32768", text))
    command = [sys.executable, "-c", PROGRAM, *map(str, bombs)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=60, check=True)
    refusals = done.stdout.splitlines()
    assert len(refusals) == len(bombs)
    for path, refusal in zip(bombs, refusals, strict=True):
        assert refusal.startswith(f"{path.name}: an IDE recording with the rate or time scale")


def test_a_number_or_a_quotient_in_an_ide_recording_is_read_as_before(tmp_path: Path, foreign_ide: bytes) -> None:
    (tmp_path / "a.ide").write_bytes(foreign_ide.replace(b"1.0/32768", b" 1/16384 "))
    group = "32 16g DC Acceleration"
    slow = files.read_content(tmp_path / "a.ide", group)[0].table["time"].to_numpy()
    (tmp_path / "a.ide").write_bytes(foreign_ide)
    fast = files.read_content(tmp_path / "a.ide", group)[0].table["time"].to_numpy()
    assert np.ptp(slow) == pytest.approx(2.0 * np.ptp(fast), rel=0.02)


@pytest.mark.slow
def test_a_reader_that_never_returns_ends_at_its_time_of_the_processor() -> None:
    before = time.monotonic()
    with pytest.raises(DataRejected, match=r"a\.bin: not read after 1 s of the processor"):
        in_tests(never_returns, 0, limits=ReadingLimits(256 * MIB, 1, 20))
    assert time.monotonic() - before < 15
    assert in_tests(of_its_process) != os.getpid()  # and the next file is read


def test_a_reader_that_waits_ends_at_the_time_of_the_clock() -> None:
    with pytest.raises(DataRejected, match="not read after 1 s, "):
        in_tests(never_returns, 60, limits=ReadingLimits(256 * MIB, 5, 1))


def test_a_reader_has_the_memory_of_its_limit_and_no_more() -> None:
    assert in_tests(takes_memory, 100) == 100 * MIB
    with pytest.raises(DataRejected, match=r"takes more than 256 MB of memory"):
        in_tests(takes_memory, 300)


def test_a_defect_of_a_reader_keeps_its_kind_and_place_and_one_process_reads_one_file_at_a_time() -> None:
    with pytest.raises(ZeroDivisionError) as caught:
        in_tests(divmod, 1, 0)
    assert "limited_process" in "".join(caught.value.__notes__)
    found: list[int] = []
    threads = [threading.Thread(target=lambda: found.append(in_tests(of_its_process))) for _ in range(8)]
    for one in threads:
        one.start()
    for one in threads:
        one.join()
    assert len(set(found)) == 1


def test_a_recording_comes_back_as_its_reader_gave_it_and_a_pipe_is_read(tmp_path: Path) -> None:
    table = pd.DataFrame({"t": np.arange(500) / 100.0, "ax": 1, "text": "a", "m": pd.Timestamp("2026-01-01")})
    for name, write in (("a.csv", lambda p: table.to_csv(p, index=False)), ("a.parquet", table.to_parquet)):
        write(tmp_path / name)
        here, there = files.content_here(tmp_path / name), files.read_content(tmp_path / name)
        pd.testing.assert_frame_equal(here[0].table, there[0].table)
        assert (here[0].remarks, here[1]) == (there[0].remarks, there[1])
        there[0].table.iloc[0, 0] = 5.0  # its arrays can be written
    os.mkfifo(tmp_path / "pipe")  # which is read by the process that has it
    writer = threading.Thread(target=lambda: (tmp_path / "pipe").write_text("t,x\n" + "1,2\n" * 20, encoding="utf-8"))
    writer.start()
    assert len(files.read(tmp_path / "pipe")[0]) == 20
    writer.join()


@each([b"\n", b",\n", b"1,\n", b",,,,,,,,\n", b"1 1 1 1\n", b"1\n"])
def test_15_kb_of_gzip_with_millions_of_cells_are_refused_before_they_are_a_table(line: bytes, tmp_path: Path) -> None:
    path = tmp_path / "a.csv.gz"
    path.write_bytes(gzip.compress(line * (10 * MIB // len(line)), 9))
    with pytest.raises(DataRejected, match=r"a\.csv\.gz: \d+ bytes hold about \d+ cells, at most \d+ are read"):
        files.content_here(path)


@pytest.mark.slow
def test_a_killed_reader_leaves_no_copy_of_a_recording(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path / "copies"))
    (tmp_path / "copies").mkdir()
    limited.end()
    assert in_tests(loads, limits=ReadingLimits(256 * MIB, 20, 60))  # its libraries do not count
    with pytest.raises(DataRejected, match="not read after 2 s"):
        in_tests(copies_to, str(tmp_path), limits=ReadingLimits(256 * MIB, 5, 2))
    assert (tmp_path / "began").read_text(encoding="utf-8").endswith(" 1000")
    assert list((tmp_path / "copies").iterdir()) == []


@pytest.mark.slow
@pytest.mark.parametrize("how", mostly_slow([signal.SIGKILL, signal.SIGTERM], signal.SIGKILL))
def test_a_killed_command_leaves_neither_its_reader_nor_a_copy(tmp_path: Path, how: int) -> None:
    (tmp_path / "copies").mkdir()
    program = (
        f"import sys; sys.path.insert(0, {str(Path(__file__).parent)!r})\n"
        "import test_files_of_strangers as tests\n"
        f"tests.in_tests(tests.copies_to, {str(tmp_path)!r}, limits=tests.ReadingLimits(2**28, 9, 60))\n"
    )
    environment = os.environ | {"TMPDIR": str(tmp_path / "copies"), "PYTHONPATH": f"{ROOT}:{ROOT / 'tests'}"}
    with subprocess.Popen([sys.executable, "-c", program], env=environment, stderr=subprocess.DEVNULL) as command:
        while not (tmp_path / "began").is_file():
            assert command.poll() is None
            time.sleep(0.05)
        reader = Path(f"/proc/{command.pid}/task/{command.pid}/children").read_text(encoding="ascii").split()
        command.send_signal(how)
        command.wait(10)
    deadline = time.monotonic() + 10
    while any(_runs(pid) for pid in reader):
        assert time.monotonic() < deadline
        time.sleep(0.05)
    assert list((tmp_path / "copies").iterdir()) == []


def _runs(pid: str) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False
