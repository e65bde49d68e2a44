"""The chart of a transfer function: magnitude and phase with their uncertainty, Nyquist plot, residual and coherence."""

from dataclasses import replace

import numpy as np

from inertial.arrays import Array, Complex
from inertial.dynamics.transfer_diagnosis import TransferDiagnosis
from inertial.dynamics.transfer_model import Points, TransferFit
from pipelines.drawing.chart import Chart, Plot, PlotAxis, Role, Trace, level

COVERAGE = 2.0
FINE = 300
NYQUIST_SHAPE = 1.2  # of its rectangle, width over height: circles stay circles
FREQUENCY = PlotAxis("frequency / Hz", log=True)


def bode_chart(points: Points, diagnosis: TransferDiagnosis, coherence: Array) -> Chart:
    """Magnitude, phase and Nyquist plot above, residual and coherence below."""
    c = points.conditions
    order = np.argsort(c.frequency)
    f = c.frequency[order]
    unit = np.sign(diagnosis.fit.sensitivity) / abs(diagnosis.extended.sensitivity)
    value = points.value[order] * unit
    size_error, phase_error = (COVERAGE * error[order] for error in (points.magnitude_error, points.phase_error))
    fine = np.geomspace(f[0], f[-1], FINE)
    plan = c.along(fine)
    name = "measured, U (k = 2)"
    size = [Trace(name, f, np.abs(value), size=4.0, error=size_error * np.abs(value))]
    phase = [Trace(name, f, _degrees(value), size=4.0, error=np.degrees(phase_error))]
    plane = [Trace(name, value.real, value.imag, size=4.0)]
    left = [Trace("U (k = 2)", f, 100.0 * np.hypot(size_error, phase_error), "line", "muted")]
    fits: list[tuple[str, TransferFit, Role]] = [("model", diagnosis.fit, "before")]
    if diagnosis.classes:
        fits.append(("with the missing effects", diagnosis.extended, "z"))
    for name, fit, role in fits:
        y = fit.response(plan) * unit
        curve = Trace(name, fine, np.abs(y), "line", role, dashed=role == "before")
        size.append(curve)
        phase.append(replace(curve, y=_degrees(y)))
        plane.append(replace(curve, x=y.real, y=y.imag))
        residual = 100.0 * np.abs(points.value[order] / fit.response(c)[order] - 1.0)
        left += [
            replace(curve, x=f, y=residual),
            Trace(f"residual, {name}", f, residual, role=role, size=3.0, legend=False),
        ]
    size.append(level(f, np.sqrt(0.5)))
    bond = [Trace("", f, 1.0 - coherence[order], "line", legend=False)]
    plots = (
        Plot("", FREQUENCY, PlotAxis("|H| over its value at rest"), tuple(size)),
        Plot("", FREQUENCY, PlotAxis("phase / °"), tuple(phase)),
        _nyquist(plane),
        Plot("", FREQUENCY, PlotAxis("residual, % of |H|", log=True), tuple(left)),
        Plot("", FREQUENCY, PlotAxis("1 − coherence", log=True), tuple(bond)),
    )
    return Chart("Transfer function", plots, 3)


def _degrees(value: Complex) -> Array:
    return np.degrees(np.unwrap(np.angle(value)))


def _nyquist(traces: list[Trace]) -> Plot:
    """Real and imaginary part on the same scale."""
    low, high = (
        np.array([edge([edge(getattr(t, side)) for t in traces]) for side in "xy"]) for edge in (np.min, np.max)
    )
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    tall = 1.1 * max(half[0] / NYQUIST_SHAPE, half[1])
    across, along = (
        PlotAxis(label, low=float(at - reach), high=float(at + reach))
        for label, at, reach in zip(("real part", "imaginary part"), middle, (NYQUIST_SHAPE * tall, tall), strict=True)
    )
    return Plot("", across, along, tuple(traces))
