"""Which kind of device, with which calibration, reaches an error that an application asks for: an uncertainty budget of each.

The figures are those of the presets. A term is a standard uncertainty at the end of the range, over temperatures that are all as
frequent; what a calibration takes out is what it determines: zero and gain at one temperature, both over temperature, and the
nonlinearity in a centrifuge. What it leaves is the change from switch-on to switch-on and a share of each term in temperature.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

from inertial.state import T_REFERENCE
from inertial.uncertainty.rounding import short
from pipelines.planning.documents import ChoiceDocument, ChoiceRow
from schemas.errors import WrongUse, did_you_mean
from schemas.units import MICRO
from stations.plant.preset import Preset, load_preset, preset_names

COVERAGE = 2.0
LEFT_OF_TEMPERATURE = 0.05
"""Share of a term in temperature that a calibration over temperature leaves: curvature and hysteresis. An assumption."""
ASSUMED = "a calibration over temperature leaves {:g} % of the terms in temperature (curvature, hysteresis); a run measures it"
_POLE = 0.5 * math.pi  # noise bandwidth over −3 dB frequency of one pole
MILLI = 1e3


@dataclass(frozen=True)
class Need:
    """The requirement of an application: range, g; temperatures, °C; error (k = 2), µg; bandwidth, Hz."""

    range_g: float
    low_C: float
    high_C: float
    error_ug: float
    bandwidth_hz: float

    @property
    def away(self) -> float:
        """Root mean square of the temperature's distance from that of a calibration at one temperature."""
        low, high = self.low_C - T_REFERENCE, self.high_C - T_REFERENCE
        return math.sqrt((high**3 - low**3) / (3.0 * (high - low))) if high > low else abs(high)


def _root(values: float | tuple[float, float, float]) -> float:
    """The root mean square of a figure of one axis or three."""
    by_axis = values if isinstance(values, tuple) else (values,)
    return math.sqrt(sum(v * v for v in by_axis) / len(by_axis))


@dataclass(frozen=True)
class Term:
    """A term of the budget, its value before a calibration, µg, and the first calibration that takes it out.

    left : share that this calibration leaves
    """

    name: str
    of: Callable[[Preset, Need], float]
    taken_out: str = ""
    left: float = 0.0


CALIBRATIONS = {
    "none": "as the maker delivers it",
    "one temperature": "six or twelve poses: 'tumbleline run deploy/recipes/line-six.toml'",
    "temperature": "poses at several temperatures: 'tumbleline run'",
    "temperature and centrifuge": "and the procedure centrifuge to the range",
}
TERMS = (
    Term("zero as built", lambda p, _: math.hypot(_root(p.bias_mean_g), _root(p.bias_sd_g)) * MICRO, "one temperature"),
    Term("gain as built", lambda p, n: p.scale_sd_ppm * n.range_g, "one temperature"),
    Term("axes as built", lambda p, n: MILLI * p.misalignment_sd_mrad * n.range_g, "one temperature"),
    Term("zero over temperature", lambda p, n: p.bias_tempco_ug_per_K * n.away, "temperature", LEFT_OF_TEMPERATURE),
    Term(
        "gain over temperature",
        lambda p, n: p.scale_tempco_ppm_per_K * n.away * n.range_g,
        "temperature",
        LEFT_OF_TEMPERATURE,
    ),
    Term(
        "nonlinearity",
        lambda p, n: (
            0.01 * p.linearity_pct_fs * p.range_g * min(n.range_g / p.range_g, 1.0) ** 2 * MICRO / math.sqrt(3.0)
        ),
        "temperature and centrifuge",
        0.1,
    ),
    Term(
        "switch-on to switch-on", lambda p, _: p.bias_stability_ug if p.stability is None else p.stability.switch_on_ug
    ),
    Term("bias instability", lambda p, _: p.bias_instability_ug),
    Term("noise in the bandwidth", lambda p, n: p.noise_density_ug * math.sqrt(_POLE * n.bandwidth_hz)),
    Term("quantisation", lambda p, _: p.lsb / p.scale * MICRO / math.sqrt(12.0)),
)


def need_of(range_text: str, temperature: str, error: str, bandwidth_hz: float) -> Need:
    """The requirement from texts such as ``4g``, ``-40..85`` and ``2mg``.

    Raises WrongUse: a text is of another form, or a value is not positive.
    """
    size = _quantity(range_text, "range", {"g": 1.0, "mg": 1e-3})
    allowed = _quantity(error, "error", {"ug": 1.0, "µg": 1.0, "mg": MILLI, "g": MICRO})
    low, dots, high = temperature.partition("..")
    try:
        ends = (float(low), float(high if dots else low))
    except ValueError:
        ends = (1.0, 0.0)
    if not -273.0 < ends[0] <= ends[1] < 1000.0:
        raise WrongUse(f"temperature: found '{temperature}', LOW..HIGH in °C is needed, such as -40..85; correct it")
    if not (math.isfinite(bandwidth_hz) and bandwidth_hz > 0.0):
        raise WrongUse(f"bandwidth: found {bandwidth_hz:g}, a frequency above 0 Hz is needed; correct it")
    return Need(size, *ends, allowed, bandwidth_hz)


def _quantity(text: str, option: str, units: dict[str, float]) -> float:
    number = text.strip().rstrip("gmuµ")
    unit = text.strip()[len(number) :]
    try:
        value = float(number) * units[unit]
    except (ValueError, KeyError):
        value = math.nan
    if not (math.isfinite(value) and value > 0.0):
        raise WrongUse(f"{option}: found '{text}', a positive number with {' or '.join(units)} is needed; correct it")
    return value


def choice(need: Need, devices: list[str]) -> ChoiceDocument:
    """The budget of every device with every calibration, those that reach the error first, with the least calibration first.

    devices : presets; empty for all
    """
    known = preset_names()
    for name in devices:
        if name.lower() not in {preset.lower() for preset in known}:
            raise WrongUse(f"--device: no preset '{name}'; {did_you_mean(name, known)}")
    rows = [_row(load_preset(name), need, calibration) for name in devices or known for calibration in CALIBRATIONS]
    order = list(CALIBRATIONS)
    rows.sort(
        key=lambda row: (not row["reaches"], bool(row["cannot"]), order.index(row["calibration"]), row["error_ug"])
    )
    return {
        "range_g": need.range_g,
        "temperatures_C": [need.low_C, need.high_C],
        "bandwidth_hz": need.bandwidth_hz,
        "error_ug": need.error_ug,
        "coverage_factor": COVERAGE,
        "calibrations": dict(CALIBRATIONS),
        "assumptions": [
            ASSUMED.format(100.0 * LEFT_OF_TEMPERATURE),
            "the centrifuge leaves a tenth of the nonlinearity; references of the calibration are not counted",
            "the figures are typical ones of the presets, not those of one unit",
        ],
        "candidates": rows,
    }


def _row(preset: Preset, need: Need, calibration: str) -> ChoiceRow:
    level = list(CALIBRATIONS).index(calibration)
    terms = {term.name: term.of(preset, need) * _share(term, level) for term in TERMS}
    error = COVERAGE * math.sqrt(sum(value * value for value in terms.values()))
    cannot = _cannot(preset, need)
    largest = max(terms, key=lambda name: terms[name])
    reaches = not cannot and error <= need.error_ug
    noise = terms["noise in the bandwidth"]
    return {
        "device": preset.name,
        "calibration": calibration,
        "reaches": reaches,
        "error_ug": error,
        "terms_ug": terms,
        "range_over_noise_dB": 20.0 * math.log10(MICRO * need.range_g / noise) if noise > 0.0 else None,
        "cannot": cannot,
        "why": cannot or ([] if reaches else [f"{largest}: {short(COVERAGE * terms[largest])} µg"]),
    }


def _share(term: Term, level: int) -> float:
    taken = list(CALIBRATIONS).index(term.taken_out) if term.taken_out else len(CALIBRATIONS)
    return term.left if level >= taken else 1.0


def _cannot(preset: Preset, need: Need) -> list[str]:
    """Properties of a preset that rule it out and that no calibration improves."""
    low, high = preset.temperature_low_C, preset.temperature_high_C
    beyond = {
        f"saturates at {preset.range_g:g} g": need.range_g > preset.range_g,
        f"passes {preset.passband_hz:.4g} Hz": need.bandwidth_hz > preset.passband_hz,
        f"specified from {low:g} to {high:g} °C": need.low_C < low or need.high_C > high,
    }
    return [what for what, holds in beyond.items() if holds]
