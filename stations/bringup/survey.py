"""Every register of a profile read once: which answer, which do not, which lie outside their limits."""

import math
import statistics
import time
from dataclasses import dataclass, field

from schemas.errors import LinkLost, RecipeInvalid, StationError, StationRefused, StationTimeout
from schemas.profile import Command, Register, limits_of
from stations.bringup.person import Findings, Person, judged
from stations.bringup.plausible import plausible
from stations.bringup.target import Target, value_of
from stations.codec import Value
from stations.devices.commands import Values
from stations.devices.registers import Registers
from stations.recordings.decoding import told

PANEL = ("temperature", "set_point", "feedback_position", "humidity")  # what panels show, by the names of the profiles
FACTORS = (1000.0, 100.0, 60.0, 57.29577951308232, 10.0, 2.0)
NEAR = 0.02
ON_PANEL = " on the panel"


@dataclass
class Survey:
    """Values of the registers, and times of the answers, s."""

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
    """Reads every register or command of the profile, each in a separate request."""
    found, values = Survey(), target.values()
    for entry in (*target.profile.registers, *target.profile.commands):
        if isinstance(entry, Register) and entry.access == "write":
            findings.add("register", entry.name, "not tried", "write only")
            continue
        values = _read(target, values, entry, found, findings)
    if isinstance(values, Registers):
        _groups(values, findings)
    _own_limits(target, found, findings)
    points = [point for point in findings.points if point.part == "register"]
    differ = [f"{point.what} ({point.found})" for point in points if point.verdict == "differs"]
    person.tell(
        f"{len(found.values)} values read; "
        + (f"differ: {', '.join(differ)}" if differ else "none differs from its profile")
    )
    return found


def _read(target: Target, values: Values, entry: Register | Command, found: Survey, findings: Findings) -> Values:
    """Reads one value; the values on a new connection where the old connection was lost."""
    name = entry.name
    begun = time.monotonic()
    try:
        value = value_of(values, name)
    except StationTimeout:
        remedy = "check whether this model has it; else remove it"
        findings.add("register", name, "differs", "no answer", "an answer", remedy)
        return values
    except LinkLost as problem:
        findings.add("register", name, "differs", f"the connection was lost ({_short(problem)})", "an answer")
        return target.values()
    except (StationRefused, RecipeInvalid) as problem:
        remedy = "check address, function and model; remove the register if this model has none"
        findings.add("register", name, "differs", _short(problem), "an answer", remedy)
        return values
    found.seconds.append(time.monotonic() - begun)
    found.values[name] = value
    _judge(findings, entry, value)
    return values


def _judge(findings: Findings, entry: Register | Command, value: Value) -> None:
    """Findings on the value of a register: whether it is inside its limits, named, possible."""
    shown, unit, (low, high) = told(entry, value), entry.unit, limits_of(entry)
    numbers = value if isinstance(value, list) else [] if isinstance(value, str) else [value]
    if numbers and not all(low <= number <= high for number in numbers):
        limits = f"{low:g} to {high:g} {unit}".strip()
        remedy = "correct minimum and maximum of the profile, or its scale"
        findings.add("register", entry.name, "differs", f"{shown}, outside its limits", limits, remedy)
    elif isinstance(entry, Register) and plausible(entry, value) is False:
        known = ", ".join(f"{name} = {number}" for name, number in entry.enumeration.items())
        remedy = "compare with the manual" + (f"; sources disagree: {entry.disputed}" if entry.disputed else "")
        expected = known or f"a possible value in {unit or 'its range'}"
        findings.add("register", entry.name, "differs", shown, expected, remedy)
    else:
        findings.add("register", entry.name, "held", shown)


def _groups(registers: Registers, findings: Findings) -> None:
    """Groups of registers must be readable in one request, where all of them can be read."""
    for group, names in registers.profile.groups.items():
        if any(registers.profile.register(name).access == "write" for name in names):
            findings.add("register", f"group {group}", "not tried", "it has registers that are write only")
            continue
        try:
            registers.read_group(group)
        except StationError as problem:
            remedy = "the device does not take so many registers in one request"
            findings.add("register", f"group {group}", "differs", _short(problem), "one answer for all", remedy)
        else:
            findings.add("register", f"group {group}", "held", f"{len(names)} registers in one request")


def _own_limits(target: Target, found: Survey, findings: Findings) -> None:
    """Limits that the controller itself holds, against those of the profile for the same order."""
    if not target.profile.has("set_point"):
        return
    entry = target.profile.entry("set_point")
    for name, stated, side, sign in (
        ("set_point_low", entry.minimum, "minimum", 1.0),
        ("set_point_high", entry.maximum, "maximum", -1.0),
    ):
        limit = found.values.get(name)
        if stated is None or not isinstance(limit, int | float) or not math.isfinite(limit):
            continue
        what = f"{side} of set_point"
        if sign * stated < sign * limit:
            text = f"the controller allows {limit:g} {entry.unit}"
            remedy = "narrow the profile's limit to the controller's, or widen that at its panel"
            findings.add("register", what, "differs", text, f"{stated:g} {entry.unit} of the profile", remedy)
            findings.change("set_point", side, float(limit))
        else:
            findings.add("register", what, "held", f"{stated:g} {entry.unit}", f"inside {limit:g}")


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
            findings.add("panel", name + ON_PANEL, "not tried", _short(problem))
            values = target.values()
            continue
        try:
            shown = float(typed.replace(",", "."))
        except ValueError:
            findings.add("panel", name + ON_PANEL, "not tried", f"read {read:.6g} {entry.unit}", "the panel's value")
            continue
        _compare(findings, entry, read, shown)


def _compare(findings: Findings, entry: Register | Command, read: float, shown: float) -> None:
    """A value that was read against that of the panel."""
    unit = entry.unit
    text, remedy = f"read {read:.6g} {unit}", "compare address, type and scale with the manual"
    step = entry.scale if isinstance(entry, Register) and entry.type != "float32" else 0.0
    near = NEAR if abs(shown) < 5.0 else 0.005
    tolerance = max(step, 0.5 if unit == "degC" else 0.02, near * abs(shown))
    ratio = shown / read if read else math.inf
    factor = next((f for f in (*FACTORS, *(1.0 / f for f in FACTORS)) if abs(ratio / f - 1.0) <= NEAR), 1.0)
    held = abs(read - shown) <= tolerance
    if unit == "degC" and not held and abs((read - 32.0) / 1.8 - shown) <= tolerance:
        text, remedy = f"{text}: degrees Fahrenheit", "set the controller to °C"
    elif not held and factor != 1.0:
        text, remedy = f"{text}: the scale is wrong by {factor:g}", "compare with the manual"
        if isinstance(entry, Register):
            findings.change(entry.name, "scale", entry.scale * factor)
            remedy = f"multiply its scale by {factor:g}"
    findings.add("panel", entry.name + ON_PANEL, judged(good=held), text, f"{shown:g} {unit} on the panel", remedy)


def _short(problem: Exception) -> str:
    """The reason of an error, without the address that begins it and the remedy that ends it."""
    return str(problem).split("; ")[0].split(": ", 1)[-1]
