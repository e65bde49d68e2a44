"""Files that are broken, or unpack to more than anybody can have meant."""

import gzip
import io
import struct
import subprocess
import sys
import zlib
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from long_suites import mostly_slow
from root_process import ROOT
from scipy.io import savemat

from pipelines.importers import exchange, files
from pipelines.tables.dwell_table import covariates
from schemas.errors import DataRejected

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


PROGRAM = """
import resource, sys
from pathlib import Path
from pipelines.importers import files
from schemas.errors import DataRejected
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
for path in sys.argv[1:]:
    try: files.content_here(Path(path))
    except DataRejected as problem: print(problem)
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
"""


@pytest.mark.slow
def test_files_that_unpack_to_too_much_are_refused_in_little_memory(tmp_path: Path) -> None:
    paths = [tmp_path / f"{bomb.__name__}.csv" for bomb in (bomb_gzip, bomb_matlab, bomb_parquet, bomb_texts)]
    for path, bomb in zip(paths, (bomb_gzip, bomb_matlab, bomb_parquet, bomb_texts), strict=True):
        path.write_bytes(bomb())
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, *map(str, paths)], capture_output=True, text=True, check=True, cwd=ROOT
    )
    *messages, grown = done.stdout.splitlines()
    for path, message in zip(paths, messages, strict=True):
        assert path.name in message
        assert "unpack to" in message
    assert int(grown) < 500_000  # kB


def test_a_gzip_file_cut_or_changed_is_refused(tmp_path: Path) -> None:
    whole = gzip.compress(b"t,ax,ay,az\n" + b"0.01,0.0,0.6,0.8\n" * 400, mtime=0)
    for data in (whole[:-20], whole[:5], whole[:40] + b"\x00" * 9 + whole[49:], whole + b"\x1f\x8brest"):
        (tmp_path / "a.csv.gz").write_bytes(data)
        with pytest.raises(DataRejected, match=r"gzip file of .* that does not unpack"):
            files.read(tmp_path / "a.csv.gz")
