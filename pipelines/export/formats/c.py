"""C: a C99 header with coefficients and checksum of every unit, and what applies them; low-pass and bias on request."""

import re
import struct
import zlib
from collections.abc import Callable, Sequence
from importlib.resources import files
from typing import Any

import numpy as np

from pipelines.export.fixed_point import ONE, fixed_point
from pipelines.export.omissions import comment, largest_error_ug
from pipelines.export.polynomials import ORDER, UnitCalibration, refuse_equal_names, refuse_fewer_axes
from pipelines.export.settings import ExportSettings
from schemas.errors import WrongUse
from schemas.units import AXES

SUFFIX = ".h"
FEWER_AXES = True

_PACKED = {"double": "d", "float": "f", "q24": "i"}
_TAKEN = {"calibration", "correct", "crc32", "crc32_number", "from_counts", "intact", "limited", "product"}
_COUNTS_BITS = 48  # of the factor from counts to fixed point


def write(units: Sequence[UnitCalibration], run: str, settings: ExportSettings) -> str:
    """The header as text, in double or single precision or in fixed point (``--set arithmetic``)."""
    kind = settings.arithmetic
    fixed = kind == "q24"
    refuse_equal_names(units, [_symbol(unit) for unit in units], "C")
    behind = bool(settings.firmware.low_pass or settings.firmware.bias)
    if behind:
        refuse_fewer_axes(units, "export: --filter or track")
    real, suffix = ("float", "f") if kind == "float" else ("double", "")
    head, tail = _template("q24" if fixed else "real").split("@UNITS@\n")
    blocks = [_fixed_unit(unit) if fixed else _real_unit(unit, kind) for unit in units]
    names = {"CHECKSUM": _template("checksum").rstrip("\n")}  # first: the names below occur in it
    names |= {"RUN": run, "OUT_UNIT": units[0].out_unit, "ORDER": str(ORDER), "REAL": real, "F": suffix}
    names |= {"BYTES": str(struct.calcsize(_PACKED[kind])), "BITS": "uint64_t" if kind == "double" else "uint32_t"}
    names |= {"NUMBER": "int32_t" if fixed else real, "MATRIX": "inverse" if fixed else "response"}
    if fixed and behind:
        raise WrongUse("export: --filter and track need --set arithmetic=double or float; choose one of them")
    exact = np.float32 if kind == "float" else np.float64
    of_filter = settings.firmware.names(_literal(exact), _braces)
    tail = tail.replace("#endif", _filled(_template("filter"), of_filter) + "#endif") if of_filter else tail
    models = settings.firmware.models({unit.unit: _symbol(unit) for unit in units}, _literal(exact), _braces)
    tail = tail.replace("#endif", _filled(_template("bias"), models) + "#endif") if models else tail
    names |= {"LOW": "low_mC", "HIGH": "high_mC"} if fixed else {"LOW": "low_C", "HIGH": "high_C"}
    return _filled(head, names) + "\n".join(blocks) + _filled(tail, names)


def _template(name: str) -> str:
    return files("pipelines.export").joinpath(f"templates/{name}.h").read_text("utf-8")


def _filled(text: str, names: dict[str, str]) -> str:
    for name, value in names.items():
        text = text.replace(f"@{name}@", value)
    return text


def _real_unit(unit: UnitCalibration, kind: str) -> str:
    exact = np.float32 if kind == "float" else np.float64
    full = unit.with_every_axis
    bias, response = full.bias.astype(exact), full.response.astype(exact)
    limits = np.array(unit.temperatures, dtype=exact)
    literal = _literal(exact)
    crc = checksum(unit.unit, _PACKED[kind], [*limits, *bias.ravel(), *response.ravel()])
    low, high = (literal(value) for value in limits)
    return (
        f"/* {comment(unit.unit)}: {comment(unit.certified)}{_of_fewer_axes(unit)} */\n"
        f"static const tumbleline_calibration tumbleline_{_symbol(unit)} = {{\n"
        f'    "{unit.unit}", {low}, {high},\n    {_braces(bias, literal)},\n    {_braces(response, literal)},\n'
        f"    0x{crc:08X}u\n}};\n"
    )


def _of_fewer_axes(unit: UnitCalibration, times: str = "") -> str:
    """What a caller gives for the axes without an output, in g or so many times that; empty where there are none."""
    places = " and ".join(f"output[{k}]" for k in range(len(AXES)) if k not in unit.axes)
    text = f"\n * axes {', '.join(unit.letters)}; {places}: force along that axis in g{times}, 0 where it is not known"
    return text if places else ""


def _literal(exact: type[np.float32 | np.float64]) -> Callable[[Any], str]:
    """Writes a number so that a compiler reads it back bit for bit."""
    suffix = "f" if exact is np.float32 else ""

    def literal(value: Any) -> str:
        text = str(exact(value))
        return (text if any(mark in text for mark in ".en") else text + ".0") + suffix

    return literal


def _fixed_unit(unit: UnitCalibration) -> str:
    fixed, full_unit = fixed_point(unit), unit.with_every_axis
    errors = f"at 1 g: {largest_error_ug(full_unit, fixed.correct):.3g} ug"
    if unit.full_scale is not None:
        full = unit.full_scale / fixed.scale
        errors += f", at full scale ({full:.3g} g): {largest_error_ug(full_unit, fixed.correct, full):.3g} ug"
    factor = round(2.0**_COUNTS_BITS / fixed.scale) if unit.out_unit == "LSB" else 0
    low, high = fixed.range_mC
    crc = checksum(unit.unit, "i", [low, high, *fixed.bias.ravel(), *fixed.inverse.ravel()])
    plain = f"output[] = value in {unit.out_unit} / {fixed.scale!r} * {ONE}, rounded"
    counts = f"{factor} counts factor" if factor else plain
    return (
        f"/* {comment(unit.unit)}: {comment(unit.certified)}\n"
        f" * largest error against the full calibration from {low / 1000:g} to {high / 1000:g} degrees Celsius, {errors};\n"
        f" * beyond these temperatures the coefficients of the nearest one hold; {counts}{_of_fewer_axes(unit, f' * {ONE}')} */\n"
        f"static const tumbleline_calibration tumbleline_{_symbol(unit)} = {{\n"
        f'    "{unit.unit}", {low}, {high}, INT64_C({factor}),\n'
        f"    {_braces(fixed.bias, str)},\n    {_braces(fixed.inverse, str)},\n"
        f"    0x{crc:08X}u\n}};\n"
    )


def checksum(unit: str, packing: str, values: Sequence[Any]) -> int:
    """CRC-32 (ISO-HDLC, as zlib's) of the unit's name and the numbers, each with its lowest byte first."""
    return zlib.crc32(unit.encode() + struct.pack(f"<{len(values)}{packing}", *values))


def _symbol(unit: UnitCalibration) -> str:
    return re.sub(r"\W", "_", unit.unit, flags=re.ASCII) + "_" * (unit.unit in _TAKEN)


def _braces(values: Any, literal: Any) -> str:
    if np.ndim(values) == 0:
        return literal(values)
    return "{" + ", ".join(_braces(value, literal) for value in values) + "}"
