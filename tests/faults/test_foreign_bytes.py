"""Mutated files of every kind that people bring: refused in one message or read by the rules, soon, and in little memory."""

import decimal
import gzip
import io
import re
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from foreign_samples import READERS, mat, packed, parquet, raw, samples
from long_suites import rounds

from inertial.errors import InertialError
from pipelines.importers.limited import MIB, ReadingLimits, in_reader
from schemas.errors import TumblelineError

SEED, TOGETHER = 20261122, 500
MANY = rounds(4000, 10_000)
LIMITS = ReadingLimits(1024 * MIB, 300, 1200)  # of so many mutations together, which take half a minute
SLOW_S, LONGEST_MESSAGE = 10.0, 1000
TABLES = 4  # of the readers: dwells, raw, recording, history

# -- mutations ------------------------------------------------------------------------------------------------------------

PLAIN = b"nan inf -inf 1e300 -1e300 9e302 1e-320 -1 0 1e18 -400.0 true True null .. =cmd|x \x00 \xff\xfe \xef\xbb\xbf"
PLAIN += (
    b" \" ' $\\frac{x$ , ; \\ \xe2\x80\xae 2026-01-01T00:00:00 99999999999999999999 4294967295 1,2,3 n/a 1_000 \xd9\xa3"
)
LONG = [b"9" * 5000, b"0x" + b"f" * 6000, b"[" * 3000, b"{" * 3000, b"[[" * 2000, b"a." * 3000 + b"b = 1", b"x" * 70000]
WORDS = [*PLAIN.split(b" "), *LONG, b"", b" ", b"\n", b"\r", b"\t", "\u0410\u0412\u0421".encode()]
NUMBER = re.compile(rb"-?\d+\.?\d*(?:e-?\d+)?")


def _word(rng):
    return WORDS[int(rng.integers(len(WORDS)))]


def _place(rng, data):
    """Anywhere; often near the end, where Parquet has its footer, or the beginning."""
    n, chance = max(len(data), 1), rng.random()
    if chance < 0.6:
        return int(rng.integers(n))
    return int(min(rng.geometric(1 / 200), n) - 1 if chance < 0.76 else n - min(rng.geometric(1 / 300), n))


def flip(rng, data):
    out = bytearray(data)
    for _ in range(int(rng.integers(1, 9))):
        if out:
            out[_place(rng, out)] ^= 1 << int(rng.integers(8))
    return bytes(out)


def other_bytes(rng, data):
    at, n = _place(rng, data), int(rng.choice([1, 2, 4, 8, 16]))
    new = rng.bytes(n) if rng.random() < 0.6 else bytes([int(rng.choice([0, 255, 127, 128]))]) * n
    return data[:at] + new + data[at + n :]


def cut(rng, data):
    return data[: _place(rng, data)]


def without(rng, data):
    at = _place(rng, data)
    return data[:at] + data[at + int(rng.integers(1, 200)) :]


def twice(rng, data):
    at, n = _place(rng, data), int(rng.integers(1, 300))
    return data[: at + n] + data[at : at + n] * int(rng.integers(1, 4)) + data[at + n :]


def word_in(rng, data):
    at = _place(rng, data)
    return data[:at] + _word(rng) + data[at:]


def number_out(rng, data):
    matches = list(NUMBER.finditer(data)) if len(data) < 200_000 else []
    if not matches:
        return word_in(rng, data)
    for hit in sorted({int(k) for k in rng.integers(len(matches), size=int(rng.choice([1, 1, 1, 3])))}, reverse=True):
        data = data[: matches[hit].start()] + _word(rng) + data[matches[hit].end() :]
    return data


def cells_out(rng, data):
    """A cell, or a whole column of a table; the value behind a key."""
    lines = data.split(b"\n")
    if b" = " in data:
        keys = [k for k, line in enumerate(lines) if b" = " in line]
        k = int(rng.choice(keys))
        value = _word(rng) if rng.random() < 0.5 else b'"' + _word(rng) + b'"'
        lines[k] = lines[k].split(b" = ", 1)[0] + b" = " + (b"[" + value + b"]" if rng.random() < 0.2 else value)
        return b"\n".join(lines)
    mark = next((one for one in (b"\t", b";", b",") if one in lines[0]), b",")
    column, word = int(rng.integers(lines[0].count(mark) + 1)), _word(rng)
    rows = range(len(lines)) if rng.random() < 0.3 else [int(rng.integers(len(lines)))]
    for k in rows:
        cells = lines[k].split(mark)
        if column < len(cells):
            cells[column] = word
            lines[k] = mark.join(cells)
    return b"\n".join(lines)


def lines_moved(rng, data):
    lines = data.split(b"\n")
    rng.shuffle(lines)
    return b"\n".join(lines[: int(rng.integers(1, len(lines) + 1))])


def digit(rng, data):
    """One digit another."""
    places = [k for k, letter in enumerate(data[:100_000]) if 48 <= letter <= 57]
    if not places:
        return data
    at = places[int(rng.integers(len(places)))]
    return data[:at] + str(int(rng.integers(10))).encode() + data[at + 1 :]


def retyped(rng, ending, data):
    """A table written whole by its library, with a column of values, a type or a name that it should not have."""
    frame = pd.read_parquet(io.BytesIO(data)) if ending == ".parquet" else raw()
    n = len(frame)
    numbers = np.arange(n)
    stamp, text = pd.Timestamp("2026-01-01"), ["=cmd|x", None, [1.0, 2.0], {"a": 1}, b"\xff", "x" * 70000]
    new = [
        *(np.full(n, value) for value in (np.nan, np.inf, -400.0, 0.0, 1.8e18)),
        *(numbers % 2 == 0, -1.0 * numbers, numbers[::-1], numbers * 1e300, numbers.astype(np.int8)),
        *(numbers + 0.5j if ending == ".mat" else numbers, numbers.astype(np.uint64) + 2**63),
        *(stamp + pd.to_timedelta(numbers, unit="ms"), pd.to_timedelta(numbers, unit="us")),
        *([value] * n for value in (*text, stamp.date(), stamp.time())),
        *([decimal.Decimal(int(k)) for k in numbers], [str(k) for k in numbers], [f"A{k}" * 300 for k in numbers]),
        *(pd.array([value, None] * n, dtype=kind)[:n] for value, kind in ((1, "Int64"), (True, "boolean"))),
        pd.Categorical([str(k % 3) for k in numbers]),
    ]
    column = str(rng.choice(list(frame.columns)))
    frame = frame.assign(**{column: new[int(rng.integers(len(new)))]}) if rng.random() < 0.85 else frame
    if rng.random() < 0.2:
        names = ["", "x" * 300, "a\nb", "__index_level_0__", "record", "unit", "n"]
        frame = frame.rename(columns={column: str(rng.choice(names))})
    if rng.random() < 0.2:
        frame = frame.head(int(rng.integers(0, 3)))
    try:
        return parquet(frame) if ending == ".parquet" else mat(frame, packed=rng.random() < 0.5)
    except Exception:  # noqa: BLE001 - there is no such file then
        return data


PACKED = (".parquet", ".mat", ".gz", ".h5", ".tdms", ".wav", ".rda")
BINARY = (flip, other_bytes, cut, without, twice, word_in)
TEXT = (*BINARY, digit, digit, number_out, number_out, cells_out, cells_out, cells_out, lines_moved)


def mutated(rng, ending, data):
    """A few mutations one after another; of what is packed, mostly of the content."""
    if ending.endswith(".gz") and rng.random() < 0.7:
        return packed(mutated(rng, ending.removesuffix(".gz"), gzip.decompress(data)))
    if ending in {".parquet", ".mat"} and rng.random() < 0.5:
        return retyped(rng, ending, data)
    kinds = BINARY if ending.endswith(PACKED) else TEXT
    for _ in range(int(rng.choice([1, 1, 1, 2, 4]))):
        data = kinds[int(rng.integers(len(kinds)))](rng, data)
    return data


def mutation(seed, number, every):
    """Reader, ending and bytes of the mutation of this number, the same whenever it is asked for."""
    rng = np.random.default_rng([seed, number])
    names = list(every)
    # tables have more formats than the rest: three of five
    name = names[int(rng.integers(TABLES))] if rng.random() < 0.6 else names[int(rng.integers(TABLES, len(names)))]
    ending, data = every[name][int(rng.integers(len(every[name])))]
    return name, ending, mutated(rng, ending, data)


def outcomes(seed, numbers):
    """Number, reader, what came of it, its words and the seconds of the processor; in the process with limits."""
    warnings.simplefilter("error")
    every, found = samples(), []
    with tempfile.TemporaryDirectory() as folder:
        for name, some in every.items():  # as they are they are read
            for ending, data in some:
                path = Path(folder) / f"sample{ending}"
                path.write_bytes(data)
                READERS[name](path)
        for number in numbers:
            name, ending, data = mutation(seed, number, every)
            path = Path(folder) / f"mutated{ending}"
            path.write_bytes(data)
            begun = time.process_time()
            found.append((number, name, *outcome(READERS[name], path), time.process_time() - begun))
    return found


def outcome(reader, path):
    """Accepted, refused with its message, or broken with its traceback."""
    try:
        reader(path)
    except (TumblelineError, InertialError) as problem:
        return "refused", str(problem)
    except Exception:  # noqa: BLE001 - that is what is looked for
        return "broken", traceback.format_exc()
    return "accepted", ""


@pytest.mark.slow  # a few of every format of recordings: tests/contract/test_readers.py; of recipes: test_refused_tables.py
@pytest.mark.timeout(7200)
def test_no_mutated_file_ends_in_a_traceback_a_hang_or_much_memory() -> None:
    found = []
    for first in range(0, MANY, TOGETHER):  # what kills or holds up the process fails with these numbers
        numbers = range(first, min(first + TOGETHER, MANY))
        found += in_reader(LIMITS, f"mutations {numbers}", outcomes, SEED, numbers)
    came = Counter(one[2] for one in found)
    sys.stdout.write(f"seed {SEED}: {dict(came)}\n")
    assert [one for one in found if one[2] == "broken"] == []
    assert came.total() == MANY
    assert [one for one in found if one[4] > SLOW_S] == []
    assert [words for _, _, _, words, _ in found if len(words) > LONGEST_MESSAGE or "\n" in words] == []
    assert {one[1] for one in found if one[2] == "accepted"} >= {"dwells", "raw", "slots", "recording"}
