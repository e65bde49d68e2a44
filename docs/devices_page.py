"""``python -m docs.devices_page``: the reference of devices, written from their profiles; ``--check`` only compares."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

from pydantic import TypeAdapter

from docs.generated_page import cell, write_or_check
from pipelines.commissioning.conformance import FORMAT
from pipelines.commissioning.documents import ConformanceDocument
from schemas.errors import DataRejected
from schemas.foreign import foreign
from schemas.profile import Command, Profile, Register
from stations.devices.adapters import adapters
from stations.devices.equipment import Equipment
from stations.devices.table import TableAxis
from stations.profile_files import load_profile, profile_names

PAGE = Path(__file__).resolve().parent.parent / "docs" / "reference" / "devices.md"
KINDS = {
    "axis": "Drives of the table",
    "chamber": "Chambers",
    "reader": "Readers",
    "slot": "Slots of a reader",
    "exciter": "Exciters",
    "shock_machine": "Shock machines",
    "centrifuge": "Centrifuges",
    "power_supply": "Power supplies",
    "step_generator": "Generators of steps",
    "climate": "Climate units",
}
MOST_NAMES = 16
SPACES = {"holding": "", "input": "input register", "coil": "coil", "discrete": "discrete input"}
HEAD = """\
# Devices

Written by `python -m docs.devices_page` from the profiles in `stations/profiles/`; change a profile, not this page. A
station's file names a device by its profile (`profile = "…"`) and its link (`link = "…"`, the usual link first
below). **Verified on** says where a bring-up has compared the profile: every one has a simulated device; hardware and replays
are named with who did it, when, and the file in `stations/conformance/`. **Disputed** counts the values on which sources
disagree. Addresses are those on the wire, from 0. [Your device in an hour](../how-to/your-device-in-an-hour.md) compares a
profile with your device.
"""
CONFORMANCE = PAGE.parents[2] / "stations" / "conformance"


def read_conformance(path: Path) -> ConformanceDocument:
    """A conformance document from its file.

    Raises DataRejected: the file is not of the format.
    """
    with foreign(f"conformance: {path}", "a file that 'tumbleline station bring-up' wrote is needed"):
        document = TypeAdapter(ConformanceDocument).validate_json(path.read_bytes())
    if document["format"] != FORMAT:
        raise DataRejected(
            f"conformance: {path} has format '{document['format'][:40]}', '{FORMAT}' is needed; update the product"
        )
    return document


def page() -> str:
    """The whole page as Markdown."""
    profiles = sorted(
        (load_profile(name) for name in profile_names()), key=lambda p: (list(KINDS).index(p.kind), p.name)
    )
    parts = [HEAD, _table(profiles), _families(), _disputes(profiles)]
    for kind, title in KINDS.items():
        parts.append(f"## {title}\n")
        parts += [_section(profile) for profile in profiles if profile.kind == kind]
    return "\n".join(parts)


def _table(profiles: list[Profile]) -> str:
    rows = [
        f"| [`{p.name}`](#{p.name}) | {cell(f'{p.maker} {p.model}')} | {p.kind} | `{p.adapter}` | {', '.join(p.links)} | "
        f"{_verified(p)} | {sum(bool(entry.disputed) for entry in _entries(p)) or ''} |"
        for p in profiles
    ]
    head = "| profile | device | kind | adapter | links | verified on | disputed |"
    return "\n".join([head, "|---|---|---|---|---|---|---|", *rows, ""])


def _verified(profile: Profile) -> str:
    """Where a profile has been compared: the simulator, and the conformance files of others."""
    seen = ["simulator"]
    for path in sorted(CONFORMANCE.glob("*.json")):
        found = read_conformance(path)
        if found["profile"] == profile.name and found["verified_on"] in {"hardware", "replay"}:
            who = f"{found['by'] or 'not named'}, {found['made'][:10]}"
            seen.append(f"{found['verified_on']} ({who}, [{path.name}](../../stations/conformance/{path.name}))")
    return ", ".join(seen)


def _families() -> str:
    """What a profile of each family must have."""
    rows = [
        f"| `{name}` | {_kind(name, adapter)} | {', '.join(f'`{n}`' for n in adapter.needs)} |"
        for name, adapter in sorted(adapters().items(), key=lambda item: (not issubclass(item[1], TableAxis), item[0]))
    ]
    head = [
        "## Families\n",
        "The `adapter` of a profile is the family of its controller. A profile must have these registers, commands or groups:\n",
        "| family | kind | needs |",
        "|---|---|---|",
    ]
    return "\n".join([*head, *rows, ""])


def _kind(name: str, adapter: type) -> str:
    """The kind of the devices of a family: that of its profiles for test equipment, whose adapters share one base."""
    if not issubclass(adapter, Equipment):
        return "axis" if issubclass(adapter, TableAxis) else "chamber"
    return next(p.kind for p in map(load_profile, profile_names()) if p.adapter == name)


def _disputes(profiles: list[Profile]) -> str:
    """What to check first at the device."""
    rows = [
        f"| `{p.name}` | `{entry.name}` | {entry.manual} | {cell(entry.disputed)} |"
        for p in profiles
        for entry in _entries(p)
        if entry.disputed
    ]
    head = [
        "## To be settled at the device\n",
        "| profile | value | manual | what sources disagree about |",
        "|---|---|---|---|",
    ]
    return "\n".join([*head, *rows, ""])


def _section(profile: Profile) -> str:
    lines = [f"### {profile.name}\n", f"{profile.maker} {profile.model}. Source: {profile.source}.\n"]
    if profile.commands:
        lines += ["| value | asked by | set by | unit | limits |", "|---|---|---|---|---|"]
        lines += [_command(command) for command in profile.commands]
    else:
        lines += [
            "| value | address | manual | type | order | unit | limits | access |",
            "|---|---|---|---|---|---|---|---|",
        ]
        lines += [_register(profile, register) for register in profile.registers]
    return "\n".join([*lines, ""])


def _command(command: Command) -> str:
    field = f", part {command.field + 1}" if command.field else ""
    setter = f"`{command.tell}`" if command.tell else ""
    limits = ", ".join(command.values) or _limits(command)
    return f"| `{command.name}` | `{command.ask}`{field} | {setter} | {command.unit} | {limits} |"


def _register(profile: Profile, register: Register) -> str:
    count = f" × {register.count}" if register.count > 1 else ""
    scale = f", in {register.scale:g}" if register.scale != 1.0 else ""
    scale += f", decimals by `{register.scaled_by}`" if register.scaled_by else ""
    space = SPACES[register.space]
    order = (
        profile.order(register).replace("_", " ")
        if register.words > register.count and register.type != "string"
        else ""
    )
    names = register.enumeration or register.bits
    limits = (
        ", ".join(f"{name} {value}" for name, value in names.items())
        if len(names) <= MOST_NAMES
        else f"{len(names)} names"
    )
    where = f"0x{register.address:04X} ({register.address})"
    where += f", {space}" if space else ""
    return (
        f"| `{register.name}` | {where} | {cell(register.manual)} | {register.type}{count}{scale} | {order} | "
        f"{register.unit} | {limits or _limits(register)} | {register.access.replace('_', ', ')} |"
    )


def _limits(entry: Register | Command) -> str:
    if entry.minimum is None and entry.maximum is None:
        return ""
    low, high = ("" if bound is None else f"{bound:g}" for bound in (entry.minimum, entry.maximum))
    return f"{low} to {high}"


def _entries(profile: Profile) -> Iterator[Register | Command]:
    yield from profile.registers
    yield from profile.commands


if __name__ == "__main__":
    sys.exit(write_or_check(PAGE, page(), "docs.devices_page"))
