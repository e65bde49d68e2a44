"""Pictures of a transfer function: Bode plot with uncertainty and coherence, residual, Nyquist plot."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from inertial.dynamics.transfer_effects import Conditions
from pipelines.procedures.wording import with_uncertainty

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Drawing
    from numpy.typing import NDArray

    from inertial.dynamics.transfer_diagnosis import TransferDiagnosis
    from inertial.dynamics.transfer_model import Points

    Array = NDArray[np.float64]

MEASURED, MODEL, EXTENDED = "#0072b2", "#d55e00", "#009e73"


def draw_bode(drawing: Drawing, points: Points, diagnosis: TransferDiagnosis, coherence: Array) -> None:
    """Magnitude, phase, residual and coherence over frequency, and the Nyquist plot, in two rows."""
    places = drawing.subplots(2, 3)
    c = points.conditions
    order = np.argsort(c.frequency)
    f = c.frequency[order]
    sign, rest = np.sign(diagnosis.fit.sensitivity), abs(diagnosis.extended.sensitivity)
    value = points.value[order] * sign / rest
    k = 2.0
    fine = np.geomspace(f[0], f[-1], 300)
    plan = Conditions(fine, *(np.full(300, np.median(one)) for one in (c.level, c.temperature, c.record_s)))
    curves = [("model", diagnosis.fit, MODEL, "--")]
    if diagnosis.classes:
        curves.append(("with the missing effects", diagnosis.extended, EXTENDED, "-"))
    size, phase, left, bond, plane, empty = places.ravel()
    size.errorbar(
        f,
        np.abs(value),
        k * points.magnitude_error[order] * np.abs(value),
        fmt="o",
        ms=2.8,
        lw=0.8,
        c=MEASURED,
        label="measured, U (k = 2)",
    )
    phase.errorbar(
        f,
        np.degrees(np.unwrap(np.angle(value))),
        np.degrees(k * points.phase_error[order]),
        fmt="o",
        ms=2.8,
        lw=0.8,
        c=MEASURED,
    )
    plane.plot(value.real, value.imag, "o", ms=2.8, c=MEASURED)
    for name, fit, colour, style in curves:
        y = fit.response(plan) * sign / rest
        size.plot(fine, np.abs(y), style, lw=1.1, c=colour, label=name)
        phase.plot(fine, np.degrees(np.unwrap(np.angle(y))), style, lw=1.1, c=colour)
        plane.plot(y.real, y.imag, style, lw=1.1, c=colour)
        ratio = points.value[order] / fit.response(c)[order] - 1.0
        left.plot(f, 100.0 * np.abs(ratio), "o" + style, ms=2.2, lw=0.8, c=colour, label=name)
    left.plot(
        f,
        100.0 * k * np.hypot(points.magnitude_error, points.phase_error)[order],
        c="#999999",
        lw=0.8,
        label="U (k = 2)",
    )
    size.axhline(np.sqrt(0.5), c="#999999", lw=0.8, ls=":")
    bond.plot(f, 1.0 - coherence[order], "o-", ms=2.2, lw=0.8, c=MEASURED)
    size.set(xscale="log", ylabel="|H| over its value at rest", xlabel="frequency / Hz")
    phase.set(xscale="log", ylabel="phase / °", xlabel="frequency / Hz")
    left.set(xscale="log", yscale="log", ylabel="residual, % of |H|", xlabel="frequency / Hz")
    bond.set(xscale="log", yscale="log", ylabel="1 − coherence", xlabel="frequency / Hz")
    plane.set(xlabel="real part", ylabel="imaginary part")
    plane.set_aspect("equal", adjustable="datalim")
    size.legend(frameon=False, loc="lower left", fontsize=8)
    left.legend(frameon=False, loc="upper left", fontsize=8)
    for one in (size, phase, left, bond):
        one.minorticks_off()
        one.xaxis.set_major_formatter(_plain)
    for one in (left, bond):
        one.yaxis.set_major_formatter(_plain)
    empty.axis("off")
    added = [f"missing: {name}" for name in diagnosis.recommended]
    lines = [*added, *(_text(diagnosis, p.name, p.unit) for p in diagnosis.extended.parameters)]
    verdict = {True: "model adequate", False: "model not adequate", None: "model cannot be judged"}[diagnosis.adequate]
    empty.text(0.0, 0.95, "\n".join([verdict, *lines]), va="top", fontsize=8.5, linespacing=1.4)


def _plain(value: float, _: int) -> str:
    """A tick as a plain number."""
    return f"{value:g}"


def _text(diagnosis: TransferDiagnosis, name: str, unit: str) -> str:
    """A parameter with U (k = 2); times in µs."""
    value, error, low, high = diagnosis.extended.of(name)
    if unit == "s":
        value, error, low, high, unit = 1e6 * value, 1e6 * error, 1e6 * low, 1e6 * high, "µs"
    unit = "" if unit == "1" else f" {unit}"
    own = name.removesuffix("_hz").removesuffix("_s").replace("_", " ")
    word = {"natural": "natural frequency", "two pole": "two-pole low-pass", "one pole": "one-pole low-pass"}.get(
        own, own
    )
    if not diagnosis.extended.identified(name):
        return f"{word}: not identified, {low:.3g} … {high:.3g}{unit}"
    return f"{word}: {with_uncertainty(value, 2.0 * error)}{unit}"
