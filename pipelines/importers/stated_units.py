"""Units stated by files, in the names of the mapping: used if none is given; contradictions are reported."""

from collections.abc import Iterable
from collections.abc import Mapping as Columns
from typing import Any

from inertial.quantities import SPREAD_COLUMNS
from pipelines.importers.content import Content
from pipelines.importers.mapping import Mapping
from schemas.errors import WrongUse
from schemas.foreign import shown

OUTPUT = {
    **dict.fromkeys(("g", "gn", "g0", "g_n", "grav"), "g"),
    "mg": "mg",
    **dict.fromkeys(("m/s^2", "m/s²", "m/s2", "m/s/s", "m/s**2", "m s^-2", "m*s^-2", "m·s⁻²", "ms-2", "mps2"), "m/s^2"),
    **dict.fromkeys(("v", "volt", "volts"), "V"),
    "mv": "mV",
    **dict.fromkeys(("lsb", "count", "counts", "digit", "digits", "raw", "adc", "codes"), "LSB"),
}
TEMPERATURE = {
    **dict.fromkeys(("c", "°c", "degc", "deg c", "celsius", "ºc"), "degC"),
    **dict.fromkeys(("k", "kelvin"), "K"),
    **dict.fromkeys(("f", "°f", "degf", "fahrenheit"), "degF"),
}


def output_unit(text: str) -> str:
    """A unit of the output in the name of the mapping; empty if unknown. Both G and g are gravity."""
    return OUTPUT.get(text.strip().lower(), "")


def column_name(columns: list[str], name_or_number: str) -> str:
    """A column by its name, or by its number from 1; empty if there is neither."""
    if name_or_number in columns:
        return name_or_number
    numbered = name_or_number.isdecimal() and 1 <= int(name_or_number[:9]) <= len(columns)
    return columns[int(name_or_number) - 1] if numbered else ""


def completed(given: dict[str, Any], content: Content) -> dict[str, Any]:
    """The content of a mapping with the unit of the output that the file states, if none is given."""
    units, columns = dict(given.get("units", {})), given.get("columns", {})
    axes = given.get("axes", "xyz")
    if "output" in units or not all(axis in columns for axis in axes):
        return given
    stated = _of_axes(columns, content, axes)
    return given if len(stated) != 1 or "" in stated else given | {"units": {"output": stated.pop(), **units}}


def refuse_contradiction(mapping: Mapping, content: Content, where: str) -> None:
    """Refuse units that contradict those stated by the file."""
    stated = _of_axes(mapping.columns, content) - {"", mapping.units.output}
    if stated:
        raise WrongUse(
            f"{where}: the file states {' and '.join(sorted(stated))} for its output, but --unit-of "
            f"output={mapping.units.output} was given; leave it out, or correct it"
        )
    _refuse_other_spreads(mapping, content, where)
    heat = column_name(list(content.table.columns), mapping.columns.get("temperature", ""))
    unit = TEMPERATURE.get(content.units.get(heat, "").strip().lower(), "")
    if unit and unit != mapping.units.temperature:
        raise WrongUse(
            f"{where}: column '{shown(heat)}' states {unit}, {mapping.units.temperature} is used; add --unit-of "
            f"temperature={unit}"
        )


def _refuse_other_spreads(mapping: Mapping, content: Content, where: str) -> None:
    """Refuse standard deviations in another unit than the outputs: one factor converts both."""
    for meaning in SPREAD_COLUMNS:
        column = column_name(list(content.table.columns), mapping.columns.get(meaning, ""))
        text = content.units.get(column, "").strip()
        known = output_unit(text) or (text if output_unit(text[1:]) else "")  # with a prefix, as µV
        if known and known != mapping.units.output:
            raise WrongUse(
                f"{where}: column '{shown(column)}' (for {meaning}) states {shown(text)}, {mapping.units.output} is the unit of "
                "the output, and needed for its standard deviation; convert the column"
            )


def _of_axes(columns: Columns[str, str], content: Content, axes: Iterable[str] = "xyz") -> set[str]:
    names = list(content.table.columns)
    return {output_unit(content.units.get(column_name(names, columns.get(axis, "")), "")) for axis in axes}
