"""GT3X files by the description of the format (github.com/actigraph/GT3X-File-Format): what is read of them, and what is not."""

import struct
import zipfile
from functools import reduce
from operator import xor
from pathlib import Path

import numpy as np
import pytest

from pipelines.importers import files
from schemas.errors import DataRejected

RATE, START = 60, 1_700_000_000
ACTIVITY, PARAMETERS, ACTIVITY_2 = 0x00, 0x15, 0x1A
SCALE_256, RATE_60 = (55 << 16, 0x09400000), (10 << 16 | 1, RATE)
"""Identifier and value; 256 as a floating-point number of the Simple Serial Protocol: 0.5·2⁹."""


def packet(kind: int, at: int, content: bytes) -> bytes:
    whole = struct.pack("<BBIH", 0x1E, kind, at, len(content)) + content
    return whole + bytes([~reduce(xor, whole) & 0xFF])


def gt3x(path: Path, packets: list[bytes]) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("info.txt", f"Serial Number: TAS1E00000000\r\nSample Rate: {RATE}\r\n")
        archive.writestr("log.bin", b"".join(packets))
    return path


def twelve_bits(rows: np.ndarray) -> bytes:
    """Counts (n, 3) as words of 12 bits in the order y, x, z."""
    bits = "".join(f"{int(count) & 0xFFF:012b}" for row in rows for count in row[[1, 0, 2]])
    return int(bits, 2).to_bytes(len(bits) // 8, "big")


def recorded(rng: np.random.Generator) -> tuple[np.ndarray, list[bytes]]:
    counts = rng.integers(-2048, 2048, (3, RATE, 3))
    return counts, [packet(ACTIVITY, START + k, twelve_bits(rows)) for k, rows in enumerate(counts)]


PARAMETER = packet(PARAMETERS, START, b"".join(struct.pack("<II", *one) for one in (SCALE_256, RATE_60)))


def test_a_gt3x_file_is_read_within_the_limits_of_a_reading(tmp_path: Path, rng: np.random.Generator) -> None:
    """Its library reserves 4 GB of address space, more than the process that reads may have."""
    pytest.importorskip("actfast")
    counts, packets = recorded(rng)
    content, source = files.read_content(gt3x(tmp_path / "worn.gt3x", [PARAMETER, *packets]))
    assert source.form == "wearable"
    np.testing.assert_allclose(content.table[["acc_x", "acc_y", "acc_z"]], counts.reshape(-1, 3) / 256.0, atol=1e-6)
    np.testing.assert_allclose(content.table["time"], np.arange(3 * RATE) / RATE, atol=1e-6)
    assert content.units["acc_x"] == "g"


def test_a_gt3x_file_without_samples_or_without_their_scale_is_refused(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    pytest.importorskip("actfast")
    newer = packet(ACTIVITY_2, START, bytes(6 * RATE))
    with pytest.raises(DataRejected, match=r"no samples of acceleration were found.*ACTIVITY2 are not read"):
        files.read_content(gt3x(tmp_path / "newer.gt3x", [PARAMETER, newer]))
    with pytest.raises(DataRejected, match=r"no packet of parameters, which state rate and scale; export it as CSV"):
        files.read_content(gt3x(tmp_path / "bare.gt3x", recorded(rng)[1]))
