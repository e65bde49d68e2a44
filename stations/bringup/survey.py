"""Every register of a profile read once: which answer, which do not, which lie outside their limits."""

import math
import statistics
import time
from dataclasses import dataclass, field

from schemas.errors import LinkLost, RecipeInvalid, StationError, StationRefused, StationTimeout
from schemas.profile import Command, Register
from stations.bringup.person import Findings, Person, Point
from stations.bringup.plausible import plausible
from stations.bringup.target import Target
from stations.codec import Value
from stations.devices.commands import Values
from stations.devices.registers import Registers
from stations.recordings.decoding import told

PANEL = ("temperature", "set_point", "feedback_position", "humidity")
"""What panels show, by the names of the profiles."""
FACTORS = (1000.0, 100.0, 60.0, 57.29577951308232, 10.0, 2.0)
NEAR = 0.02
ON_PANEL = " on the panel"


@dataclass
class Survey:
    """What the registers hold, and how long answers took, s."""

    values: dict[str, Value] = field(default_factory=dict[str, Value])
    seconds: list[float] = field(default_factory=list[float])

    @property
    def slowest(self) -> float:
        """The longest answer, s."""
        return max(self.seconds, default=0.0)

    @property
    def usual(self) -> float:
        """The median answer, s."""
        return statistics.median(self.seconds) if self.seconds else 0.0


def survey(target: Target, findings: Findings, person: Person) -> Survey:
    """Reads every register or command of the profile, each in a request of its own."""
    found, values = Survey(), target.values()
    for entry in (*target.profile.registers, *target.profile.commands):
        if isinstance(entry, Register) and entry.access == "write":
            findings.add(Point("register", entry.name, "not tried", "write only"))
            continue
        values = _one(target, values, entry, found, findings)
    if isinstance(values, Registers):
        _groups(values, findings)
    _own_limits(target, found, findings)
    own = [point for point in findings.points if point.part == "register"]
    differ = [f"{point.what} ({point.found})" for point in own if point.verdict == "differs"]
    person.tell(
        f"{len(found.values)} values read; "
        + (f"differ: {', '.join(differ)}" if differ else "none differs from its profile")
    )
    return found


def _one(target: Target, values: Values, entry: Register | Command, found: Survey, findings: Findings) -> Values:
    """Reads one value; the values on a new connection where the old one was lost."""
    name = entry.name
    begun = time.monotonic()
    try:
        value: Value = values.read(name) if isinstance(values, Registers) else _spoken(values, entry)
    except StationTimeout:
        findings.add(
            Point(
                "register", name, "differs", "no answer", "an answer", "check whether this model has it; else remove it"
            )
        )
        return values
    except LinkLost as problem:
        findings.add(Point("register", name, "differs", f"the connection was lost ({_short(problem)})", "an answer"))
        return target.values()
    except (StationRefused, RecipeInvalid) as problem:
        remedy = "check address, function and model; remove the register if this model has none"
        findings.add(Point("register", name, "differs", _short(problem), "an answer", remedy))
        return values
    found.seconds.append(time.monotonic() - begun)
    found.values[name] = value
    findings.add(_judged(entry, value))
    return values


def _spoken(values: Values, entry: Register | Command) -> Value:
    return values.text(entry.name) if entry.type == "text" else values.number(entry.name)


def _judged(entry: Register | Command, value: Value) -> Point:
    """What the value says of its register: inside its limits, named, possible."""
    shown = told(entry, value)
    unit = entry.unit
    numbers = value if isinstance(value, list) else [] if isinstance(value, str) else [value]
    low = -math.inf if entry.minimum is None else entry.minimum
    high = math.inf if entry.maximum is None else entry.maximum
    if numbers and not all(low <= number <= high for number in numbers):
        limits = f"{low:g} to {high:g} {unit}".strip()
        remedy = "correct minimum and maximum of the profile, or its scale"
        return Point("register", entry.name, "differs", f"{shown}, outside its limits", limits, remedy)
    if isinstance(entry, Command):
        return Point("register", entry.name, "held", shown)
    if plausible(entry, value) is False:
        known = ", ".join(f"{name} = {number}" for name, number in entry.enumeration.items())
        remedy = "compare with the manual" + (f"; sources disagree: {entry.disputed}" if entry.disputed else "")
        return Point(
            "register", entry.name, "differs", shown, known or f"a possible value in {unit or 'its range'}", remedy
        )
    return Point("register", entry.name, "held", shown)


def _groups(registers: Registers, findings: Findings) -> None:
    """Groups of registers must be readable in one request, where all of them can be read."""
    for group, names in registers.profile.groups.items():
        if any(registers.profile.register(name).access == "write" for name in names):
            findings.add(Point("register", f"group {group}", "not tried", "it has registers that are write only"))
            continue
        try:
            registers.read_group(group)
        except StationError as problem:
            remedy = "the device does not take so many registers in one request"
            findings.add(Point("register", f"group {group}", "differs", _short(problem), "one answer for all", remedy))
        else:
            findings.add(Point("register", f"group {group}", "held", f"{len(names)} registers in one request"))


def _own_limits(target: Target, found: Survey, findings: Findings) -> None:
    """Limits that the controller itself holds, against those of the profile for the same order."""
    if not target.profile.has("set_point"):
        return
    entry = target.profile.entry("set_point")
    for name, own, side, beyond in (
        ("set_point_low", entry.minimum, "minimum", lambda own, limit: own < limit),
        ("set_point_high", entry.maximum, "maximum", lambda own, limit: own > limit),
    ):
        limit = found.values.get(name)
        if own is None or not isinstance(limit, int | float) or not math.isfinite(limit):
            continue
        if beyond(own, limit):
            what = f"{side} of set_point"
            text = f"the controller allows {limit:g} {entry.unit}"
            remedy = "narrow the profile's limit to the controller's, or widen that at its panel"
            findings.add(Point("register", what, "differs", text, f"{own:g} {entry.unit} of the profile", remedy))
            findings.change("set_point", side, float(limit))
        else:
            findings.add(
                Point("register", f"{side} of set_point", "held", f"{own:g} {entry.unit}", f"inside {limit:g}")
            )


def panel(target: Target, findings: Findings, person: Person) -> None:
    """Compares scales with what the panel shows; a person reads it, or skips the question."""
    values = target.values()
    for name in PANEL:
        if not target.profile.has(name):
            continue
        entry = target.profile.entry(name)
        typed = person.ask(
            f"What does the panel show as {name.replace('_', ' ')}, in {entry.unit or 'its unit'}? (Enter: skip)"
        ).strip()
        try:
            read = values.number(name)
        except StationError as problem:
            findings.add(Point("panel", name + ON_PANEL, "not tried", _short(problem)))
            values = target.values()
            continue
        try:
            shown = float(typed.replace(",", "."))
        except ValueError:
            findings.add(
                Point("panel", name + ON_PANEL, "not tried", f"read {read:.6g} {entry.unit}", "the panel's value")
            )
            continue
        findings.add(_against_panel(findings, entry, read, shown))


def _against_panel(findings: Findings, entry: Register | Command, read: float, shown: float) -> Point:
    unit = entry.unit
    text, expected = f"read {read:.6g} {unit}", f"{shown:g} {unit} on the panel"
    step = entry.scale if isinstance(entry, Register) and entry.type != "float32" else 0.0
    tolerance = max(
        step, 0.5 if unit == "degC" else 0.02, NEAR * abs(shown) if abs(shown) < 5.0 else 0.005 * abs(shown)
    )
    if abs(read - shown) <= tolerance:
        return Point("panel", entry.name + ON_PANEL, "held", text, expected)
    if unit == "degC" and abs((read - 32.0) / 1.8 - shown) <= tolerance:
        return Point(
            "panel",
            entry.name + ON_PANEL,
            "differs",
            f"{text}: degrees Fahrenheit",
            expected,
            "set the controller to °C",
        )
    ratio = shown / read if read else math.inf
    for factor in (*FACTORS, *(1.0 / f for f in FACTORS)):
        if abs(ratio / factor - 1.0) <= NEAR:
            if isinstance(entry, Register):
                findings.change(entry.name, "scale", entry.scale * factor)
            remedy = f"multiply its scale by {factor:g}" if isinstance(entry, Register) else "compare with the manual"
            return Point(
                "panel", entry.name + ON_PANEL, "differs", f"{text}: the scale is wrong by {factor:g}", expected, remedy
            )
    return Point(
        "panel", entry.name + ON_PANEL, "differs", text, expected, "compare address, type and scale with the manual"
    )


def _short(problem: Exception) -> str:
    """The reason of an error, without the address that begins it and the remedy that ends it."""
    return str(problem).split("; ")[0].split(": ", 1)[-1]
