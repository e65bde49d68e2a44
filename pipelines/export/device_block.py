"""The block of coefficients in a device's own memory: fixed layout, little-endian, CRC-32 at its end.

::

    offset  type      content
    0       char[4]   "TLCB"
    4       uint16    version of the layout, 1
    6       uint16    form of the coefficients: 1 float32 (bias, response), 2 Q24 (bias, inverse; see the exported C)
    8       uint16    length of the block with its CRC, bytes
    10      uint16    0
    12      uint32    sequence number: of two valid copies the larger one counts
    16      char[64]  serial number, filled with 0
    80      uint32    number of the certificate (3 of SN1/3); 0 without a certificate
    84      uint32    date, yyyymmdd
    88      float32   lowest, then highest measured temperature, °C
    96      float64   output per g by which Q24 divides the output; 0 for float32
    104     int16[4]  steps of the offset registers that the coefficients assume (x, y, z), and 0
    112     4 bytes   48 coefficients: bias[4][3], then response[4][3][3] or inverse[4][3][3], float32 or int32
    304     uint32    CRC-32 (ISO-HDLC) of all bytes before
"""

import struct
import zlib
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from inertial.arrays import Array
from pipelines.export.fixed_point import FixedPoint, fixed_point, thousandths
from pipelines.export.polynomials import ORDER, UnitCalibration, corrected_output
from schemas.errors import WrongUse

Form = Literal["float32", "q24"]
FORMS: dict[Form, int] = {"float32": 1, "q24": 2}
STORED: dict[Form, str] = {"float32": "<f4", "q24": "<i4"}
MAGIC, VERSION = b"TLCB", 1
HEAD = "<4sHHHHI64sIIffd4h"
COEFFICIENTS = 48
LENGTH = struct.calcsize(HEAD) + 4 * COEFFICIENTS + 4
_BIAS = 3 * ORDER


@dataclass(frozen=True)
class CoefficientBlock:
    """The content of one copy of the memory.

    scale : output per g of the form Q24; 0 for float32
    bias : (4, 3), matrix : (4, 3, 3), as they are stored: float32, or integers in units of 2⁻²⁴
    """

    form: Form
    sequence: int
    unit: str
    certificate: int
    date: int
    temperatures: tuple[float, float]
    scale: float
    offsets: tuple[int, int, int]
    bias: Array
    matrix: Array

    def correct(self, output: Array, temperature: float) -> Array:
        """Specific force (n, 3) in g of outputs (n, 3), as firmware computes it from the block."""
        if self.form == "q24":
            integers = self.bias.astype(np.int64), self.matrix.astype(np.int64)
            return FixedPoint(self.scale, *integers, thousandths(self.temperatures)).correct(output, temperature)
        return corrected_output(self.bias, self.matrix, output, temperature)


def block_of(
    unit: UnitCalibration,
    form: Form,
    *,
    sequence: int,
    certificate: int,
    date: int,
    offsets: tuple[int, int, int],
    step: int,
) -> CoefficientBlock:
    """The block of a unit's calibration.

    Parameters
    ----------
    offsets : steps of the offset registers, which the coefficients take into account; step : counts per step

    Raises
    ------
    WrongUse
        The model has an effect that the block cannot hold, or the serial number is too long.
    """
    if unit.left_out:
        raise WrongUse(
            f"program: effect {', '.join(unit.left_out)} cannot be stored in the device's block, which holds bias, scale, "
            "misalignment and their temperature terms; fit a model without it"
        )
    if len(unit.unit.encode()) > 64:
        raise WrongUse(
            f"program: serial number '{unit.unit}' has more than 64 bytes, the block has room for 64; shorten it"
        )
    bias = unit.bias.copy()
    bias[0] += step * np.array(offsets, dtype=np.float64)
    moved = replace(unit, bias=bias)
    shared = (form, sequence, unit.unit, certificate, date, unit.temperatures)
    if form == "q24":
        fixed = fixed_point(moved)
        exact = [v.astype(np.float64) for v in (fixed.bias, fixed.inverse)]
        return CoefficientBlock(*shared, fixed.scale, offsets, *exact)
    exact = [v.astype(np.float32).astype(np.float64) for v in (moved.bias, moved.response)]
    return CoefficientBlock(*shared, 0.0, offsets, *exact)


def pack(block: CoefficientBlock) -> bytes:
    """The bytes of a block."""
    head = struct.pack(
        HEAD, MAGIC, VERSION, FORMS[block.form], LENGTH, 0, block.sequence, block.unit.encode(), block.certificate,
        block.date, *block.temperatures, block.scale, *block.offsets, 0,
    )  # fmt: skip
    values = np.concatenate([block.bias.ravel(), block.matrix.ravel()])
    body = head + values.astype(STORED[block.form]).tobytes()
    return body + struct.pack("<I", zlib.crc32(body))


def unpack(content: bytes) -> CoefficientBlock | None:
    """The block in a memory; None where there is none, or it is not intact: erased, all zero, half written, damaged."""
    data = content[:LENGTH]
    if len(data) < LENGTH or not data.startswith(MAGIC) or zlib.crc32(data[:-4]) != struct.unpack("<I", data[-4:])[0]:
        return None
    _, version, form, length, _, sequence, unit, certificate, date, low, high, scale, *offsets = struct.unpack_from(
        HEAD, data
    )
    named: Form | None = next((name for name, number in FORMS.items() if number == form), None)
    if version != VERSION or length != LENGTH or named is None:
        return None
    values = np.frombuffer(data, STORED[named], COEFFICIENTS, struct.calcsize(HEAD)).astype(np.float64)
    x, y, z = offsets[:3]
    return CoefficientBlock(
        named, sequence, unit.rstrip(b"\0").decode("utf-8", "replace"), certificate, date, (low, high), scale, (x, y, z),
        values[:_BIAS].reshape(ORDER, 3), values[_BIAS:].reshape(ORDER, 3, 3),
    )  # fmt: skip
