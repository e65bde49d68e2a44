"""Ticks of an axis at round values, with their labels."""

import numpy as np

STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)
DAYS = (1, 2, 7, 14, 31, 61, 91, 182, 365, 730, 1826)
FAR, NEAR = 1e6, 1e-3  # numbers beyond them have an exponent
_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")

Ticks = list[tuple[float, str]]


def linear_ticks(low: float, high: float, most: int, step: float | None = None) -> Ticks:
    """Places in [low, high] and their labels: at the distance ``step``, else at a round one, at most ``most`` + 1 of them."""
    step = step or _step((high - low) / max(most, 1))
    first = int(np.ceil(low / step - 1e-9))
    values = [step * k for k in range(first, int(np.floor(high / step + 1e-9)) + 1)]
    return [(value, _label(value, step, max(abs(low), abs(high)))) for value in values]


def log_ticks(low: float, high: float) -> Ticks:
    """Places on a logarithmic axis: decades, with 2 and 5 between them where there are few."""
    first, last = int(np.floor(np.log10(low))), int(np.ceil(np.log10(high)))
    between = (1.0, 2.0, 5.0) if np.log10(high / low) <= 3.0 else (1.0,)
    values = [digit * 10.0**power for power in range(first, last + 1) for digit in between]
    return [
        (value, power_label(value)) for value in values if low <= value * (1.0 + 1e-9) and value <= high * (1.0 + 1e-9)
    ]


def date_ticks(low: float, high: float, most: int) -> Ticks:
    """Dates on an axis in days since 1970."""
    step = next((days for days in DAYS if (high - low) / days <= most), DAYS[-1])
    values = np.arange(np.ceil(low / step) * step, high + 1e-9, step)
    return [(float(day), str(np.datetime64(int(day), "D"))) for day in values]


def power_label(value: float) -> str:
    """A value of a logarithmic axis."""
    if 1e-3 <= value < 1e5:
        return f"{value:g}"
    power = int(np.floor(np.log10(value) + 1e-9))
    digit = value / 10.0**power
    return ("" if abs(digit - 1.0) < 1e-6 else f"{digit:.0f}·") + "10" + str(power).translate(_SUPERSCRIPT)


def _step(least: float) -> float:
    if least <= 0.0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(least))
    return float(next(step * power for step in STEPS if step * power >= least * (1.0 - 1e-9)))


def _label(value: float, step: float, largest: float) -> str:
    if abs(value) < 1e-9 * step:
        return "0"
    if largest >= FAR or largest < NEAR:
        power = int(np.floor(np.log10(largest)))
        return f"{value / 10.0**power:.3g}·10{str(power).translate(_SUPERSCRIPT)}".replace("-", "−")
    decimals = max(0, -int(np.floor(np.log10(step) + 1e-9)))
    decimals += abs(step * 10.0**decimals - round(step * 10.0**decimals)) > 1e-6
    return f"{value:,.{decimals}f}".replace(",", "\u202f").replace("-", "−")
