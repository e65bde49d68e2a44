"""A file from a stranger harms nobody: broken, unpacking to too much, held up for ever, taking all memory, leaving copies."""

import gzip
import io
import os
import signal
import struct
import threading
import time
import zlib
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from each import each
from long_suites import mostly_slow
from scipy.io import savemat

from pipelines.importers import exchange, files, limited
from pipelines.importers.limited import MIB, ReadingLimits, in_reader
from pipelines.tables.dwell_table import covariates
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


@each((b"9**99**99", b"math.e**9", b"__import_", b"1/2/3/4/5", b"1.0/0.000"), repr)
def test_a_string_of_an_ide_recording_that_is_no_number_is_refused_and_not_evaluated(
    text: bytes, tmp_path: Path, foreign_ide: bytes
) -> None:
    """In a process that can be ended: what is evaluated never returns."""
    (tmp_path / "bomb.ide").write_bytes(foreign_ide.replace(b"1.0/32768", text))
    with pytest.raises(DataRejected, match=r"^bomb\.ide: an IDE recording with the rate or time scale"):
        in_tests(files.content_here, tmp_path / "bomb.ide", limits=ReadingLimits(1024 * MIB, 20, 60))


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
    with ThreadPoolExecutor(8) as threads:
        assert len({*threads.map(lambda _: in_tests(of_its_process), range(8))}) == 1


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
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGTERM])
def test_a_killed_command_leaves_neither_its_reader_nor_a_copy(tmp_path: Path, monkeypatch, how: int) -> None:
    (tmp_path / "copies").mkdir()
    monkeypatch.setenv("TMPDIR", str(tmp_path / "copies"))
    command = get_context("spawn").Process(target=in_tests, args=(copies_to, str(tmp_path)), daemon=True)
    command.start()
    while not (tmp_path / "began").is_file():
        assert command.is_alive()
        time.sleep(0.05)
    reader = Path(f"/proc/{command.pid}/task/{command.pid}/children").read_text(encoding="ascii").split()
    os.kill(command.pid, how)
    command.join(10)
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


# -- files that are broken, or unpack to more than anybody can have meant ---------------------------------------------------

DWELLS = pd.DataFrame({"unit": "A1", "dwell": range(4), "time_s": np.arange(4) * 10.0}).assign(
    out_x=0.1, out_y=0.2, out_z=1.0
)


def test_broken_notes_of_pandas_and_an_index_without_a_name_in_a_parquet_file_do_not_matter(tmp_path: Path) -> None:
    table = pa.Table.from_pandas(DWELLS).replace_schema_metadata({b"pandas": b'{"index_columns": [{"kind": 7'})
    pq.write_table(table, tmp_path / "d.parquet")
    assert len(exchange.read_dwells(tmp_path / "d.parquet")) == 4
    DWELLS.set_index(pd.Index([5, 6, 7, 9])).to_parquet(tmp_path / "d.parquet")
    assert covariates(exchange.read_dwells(tmp_path / "d.parquet")) == []


@pytest.mark.parametrize("packed", mostly_slow([False, True], True))
def test_a_corrupted_matlab_file_is_refused(tmp_path: Path, *, packed: bool) -> None:
    sink = io.BytesIO()
    savemat(sink, {"t": np.arange(1000.0), "s": {"a": np.arange(5.0)}}, do_compression=packed)
    rng, path, refused = np.random.default_rng(1), tmp_path / "a.mat", 0
    for _ in range(20):
        data = bytearray(sink.getvalue())
        data[int(rng.integers(128, min(len(data), 220)))] ^= 1 << int(rng.integers(8))
        path.write_bytes(bytes(data))
        try:
            files.read(path)
        except DataRejected:
            refused += 1
    assert refused > 4


def test_a_matlab_file_that_can_end_the_process_of_the_library_is_refused(tmp_path: Path) -> None:
    """The library takes a type of element as a place in a list without looking."""
    sink = io.BytesIO()
    savemat(sink, {"a": np.arange(9.0)})
    data = bytearray(sink.getvalue())
    at = data.index(struct.pack("<II", 9, 72))
    data[at : at + 4] = struct.pack("<I", 60_000)
    (tmp_path / "a.mat").write_bytes(data)
    with pytest.raises(DataRejected, match=r"a\.mat: (its reader was ended|a MATLAB file that cannot be read)"):
        files.read(tmp_path / "a.mat")
    (tmp_path / "a.mat").write_bytes(sink.getvalue())
    assert list(files.read(tmp_path / "a.mat")[0].columns) == ["a"]


def bomb_gzip(form: int = 31) -> bytes:
    """256 MiB of zeros in a quarter of one."""
    packer, piece = zlib.compressobj(6, zlib.DEFLATED, form), bytes(2**24)
    return b"".join([*(packer.compress(piece) for _ in range(16)), packer.flush()])


def bomb_matlab() -> bytes:
    body = bomb_gzip(zlib.MAX_WBITS)
    return b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + struct.pack("<II", 15, len(body)) + body


def bomb_parquet() -> bytes:
    sink = io.BytesIO()
    columns = {name: pa.repeat(0.5, 2**24) for name in ("t", "ax", "ay", "az")}
    pq.write_table(pa.table(columns), sink)
    return sink.getvalue()


def bomb_texts() -> bytes:
    """A text of a megabyte, once in the dictionary, in 2000 rows."""
    sink = io.BytesIO()
    texts = pa.DictionaryArray.from_arrays(pa.array(np.zeros(2000, dtype=np.int32)), pa.array(["x" * 2**20]))
    pq.write_table(pa.table({"unit": texts}), sink)
    return sink.getvalue()


@pytest.mark.slow
@pytest.mark.parametrize("bomb", [bomb_gzip, bomb_matlab, bomb_parquet, bomb_texts])
def test_a_file_that_unpacks_to_too_much_is_refused_in_little_memory(bomb: Callable[[], bytes], tmp_path: Path) -> None:
    (tmp_path / "bomb.csv").write_bytes(bomb())
    with pytest.raises(DataRejected, match=r"bomb\.csv: .*unpack to"):
        in_tests(files.content_here, tmp_path / "bomb.csv", limits=ReadingLimits(500 * MIB, 60, 120))


def test_a_gzip_file_cut_or_changed_is_refused(tmp_path: Path) -> None:
    whole = gzip.compress(b"t,ax,ay,az\n" + b"0.01,0.0,0.6,0.8\n" * 400, mtime=0)
    for data in (whole[:-20], whole[:5], whole[:40] + b"\x00" * 9 + whole[49:], whole + b"\x1f\x8brest"):
        (tmp_path / "a.csv.gz").write_bytes(data)
        with pytest.raises(DataRejected, match=r"gzip file of .* that does not unpack"):
            files.content_here(tmp_path / "a.csv.gz")
