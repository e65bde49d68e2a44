"""Figures and findings that follow from the diagnosis of a transfer function."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.optimize import brentq

from inertial.arrays import Array
from inertial.counts import degrees_of_freedom
from inertial.dynamics.spectra import folded_share
from inertial.dynamics.transfer_diagnosis import TransferDiagnosis, diagnose_transfer
from inertial.dynamics.transfer_effects import EFFECTS, Conditions
from inertial.dynamics.transfer_effects.base import AMBIENT_C
from inertial.dynamics.transfer_model import IDENTIFIED_SHARE, PLAIN, Points, TransferFit, factor
from pipelines.procedures.figures import FigureValue, probability, with_uncertainty

MOST_KEPT = 64
_REACH = 20.0  # of the highest frequency of the points: what a model does above it is not measured
_last_judged: dict[str, TransferDiagnosis] = {}
"""Diagnoses of the last transfer functions: the report draws what the stage has judged in the same process."""


def judged_points(points: Points, effects: Sequence[str], highest_hz: float) -> TransferDiagnosis:
    """The diagnosis of a model on the points of one unit."""
    arrays = (*points.conditions.columns, points.value, points.magnitude_error, points.phase_error)
    key = f"{' '.join(effects)} {highest_hz} {hash(b''.join(array.tobytes() for array in arrays))}"
    if key not in _last_judged:
        if len(_last_judged) >= MOST_KEPT:
            _last_judged.clear()
        _last_judged[key] = diagnose_transfer(points, effects, highest_hz=highest_hz)
    return _last_judged[key]


WORD = {"delay_s": "delay", "natural_hz": "natural frequency", "damping": "damping ratio"}


def figures_of_transfer(
    part: Any, diagnosis: TransferDiagnosis, points: Points, static: Array | None
) -> list[FigureValue]:
    """Figures of one unit.

    Parameters
    ----------
    part : of the recipe: axis, flat_to_hz, nominal_scale, reference_percent
    static : (3,), scale of the multi-position test, output per g; None without that test
    """
    model = figures_of_model(part.axis, diagnosis, points, "sweep")
    return [*model, _flatness(part, points), _sensitivity(part, diagnosis.extended, static)]


def figures_of_model(axis: str, diagnosis: TransferDiagnosis, points: Points, test: str) -> list[FigureValue]:
    """Bandwidth, natural frequency and damping; ``test``: how the names of its figures begin."""
    names = [f"{test}_{figure}" for figure in ("bandwidth_hz", "natural_hz", "damping")]
    if diagnosis.adequate is None or diagnosis.unexplained:
        why = (
            diagnosis.reason
            or alone_text(diagnosis)
            or "the model, also with the effects found, does not describe the points"
        )
        return [FigureValue.not_determined(name, axis, why) for name in names]
    top = float(points.conditions.frequency.max())
    return [
        replace(_bandwidth(axis, diagnosis, top), figure=names[0]),
        _parameter(names[1], "natural_hz", axis, diagnosis),
        _parameter(names[2], "damping", axis, diagnosis),
    ]


def _parameter(figure: str, name: str, axis: str, diagnosis: TransferDiagnosis) -> FigureValue:
    if not diagnosis.extended.has(name):
        return FigureValue.not_determined(figure, axis, f"the model has no {WORD.get(name, name)}")
    parameter = diagnosis.parameter(name)
    if parameter.identified:
        return FigureValue(figure, axis, parameter.value, parameter.uncertainty, parameter.low, parameter.high)
    note = f"not identified by these points: {_interval(parameter.low, parameter.high)}"
    if parameter.rival is not None:
        model, of_rival = " + ".join(parameter.rival.effects), parameter.rival.of(name)[0]
        note += f"; {model}, with {of_rival:.4g}, describes the points as well"
    where = ", ".join(f"{f:.4g} Hz" for f in diagnosis.next_hz)
    note += f"; measure at {where}" if where else "; sweep to higher frequencies"
    return FigureValue.not_determined(figure, axis, note, parameter.low, parameter.high)


def _interval(low: float, high: float, unit: str = "") -> str:
    """A 95 % interval in words; NaN is an end that the points leave open."""
    if np.isnan(low) and np.isnan(high):
        return "no limit on either side"
    if np.isnan(low) or np.isnan(high):
        return f"at most {high:.4g}{unit}, with 95 %" if np.isnan(low) else f"at least {low:.4g}{unit}, with 95 %"
    return f"95 % interval {low:.4g} … {high:.4g}{unit}"


def bandwidth_of(fit: TransferFit, values: Array, top: float) -> float:
    """Frequency in Hz of the first crossing of 1/√2, up to ``_REACH`` times ``top``; NaN where there is none."""
    grid = np.geomspace(1e-3 * top, _REACH * top, 2000)

    def over(f: Any) -> Any:
        at = np.atleast_1d(np.asarray(f, dtype=np.float64))
        plain = Conditions(at, np.full(at.size, 1e-9), np.full(at.size, AMBIENT_C), np.full(at.size, np.nan))
        names = [name for name in fit.effects if name not in {"temperature", "hum", "own_clock", "amplitude"}]
        owner = np.repeat(fit.effects, [len(EFFECTS[name].parameters(PLAIN)) for name in fit.effects])
        return np.abs(factor(names, plain, values[np.isin(owner, names)])) - np.sqrt(0.5)

    below = np.flatnonzero(over(grid) < 0.0)
    if below.size == 0 or below[0] == 0:
        return float("nan")
    k = int(below[0])
    crossing: Any = brentq(lambda f: float(over(f)[0]), grid[k - 1], grid[k])
    return float(crossing)


def _bandwidth(axis: str, diagnosis: TransferDiagnosis, top: float) -> FigureValue:
    """The −3 dB frequency of the model, and its interval over every model that the points do not exclude."""
    value, error = _bandwidth_with_error(diagnosis.extended, top)
    if not np.isfinite(value):
        note = "the model does not fall by 3 dB; sweep to higher frequencies"
        return FigureValue.not_determined("sweep_bandwidth_hz", axis, note)
    found = [(value, error), *(_bandwidth_with_error(rival, top) for rival in diagnosis.rivals)]
    ends = [(v * np.exp(-1.96 * e / v), v * np.exp(1.96 * min(e / v, 10.0))) for v, e in found if np.isfinite(v)]
    low, high = float(min(end[0] for end in ends)), float(max(end[1] for end in ends))
    error = max(error, (value - low) / 1.96, (high - value) / 1.96)
    if error > IDENTIFIED_SHARE * value or value > 2.5 * top or len(ends) < len(found):
        high = high if high < _REACH * top else float("nan")
        note = f"not identified by these points to {top:.4g} Hz: {_interval(low, high)}; sweep higher"
        return FigureValue.not_determined("sweep_bandwidth_hz", axis, note, low, high)
    return FigureValue("sweep_bandwidth_hz", axis, value, error, low, high)


def _bandwidth_with_error(fit: TransferFit, top: float) -> tuple[float, float]:
    """The −3 dB frequency of a fit, and its standard uncertainty by the covariance of the parameters."""
    value = bandwidth_of(fit, fit.values, top)
    gradient = np.zeros(len(fit.values))
    for k, parameter in enumerate(fit.parameters):
        step = 1e-4 if parameter.log else 1e-4 * max(abs(fit.values[k]), float(fit.errors[k]), 1e-12)
        moved = fit.values.copy()
        moved[k] = moved[k] * np.exp(step) if parameter.log else moved[k] + step
        gradient[k] = (bandwidth_of(fit, moved, top) - value) / step
    slope = np.nan_to_num(gradient)
    return value, float(np.sqrt(max(0.0, slope @ fit.covariance[1:, 1:] @ slope)))


def _flatness(part: Any, points: Points) -> FigureValue:
    """Largest departure of the measured magnitude from that of the lowest fifth of the points."""
    if part.flat_to_hz is None:
        note = "a flatness belongs to a band; set flat_to_hz"
        return FigureValue.not_measured("sweep_flatness_percent", part.axis, note)
    f, size = points.conditions.frequency, np.abs(points.value)
    low = np.argsort(f)[: max(3, len(f) // 5)]
    rest = float(np.median(size[low]))
    inside = f <= part.flat_to_hz
    departure = 100.0 * (size[inside] / rest - 1.0)
    k = int(np.argmax(np.abs(departure)))
    # variance of the median of n normal values over that of one: π/(2n + π − 2), within 2 % for an odd n
    of_median = float(np.pi / (2.0 * len(low) + np.pi - 2.0))
    scatter = np.median(points.magnitude_error[low]) * np.sqrt(of_median)
    error = 100.0 * float(np.hypot(points.magnitude_error[inside][k], scatter))
    return FigureValue("sweep_flatness_percent", part.axis, float(departure[k]), error)


def _sensitivity(part: Any, fit: TransferFit, static: Array | None) -> FigureValue:
    """Departure of the fitted sensitivity from the static scale, with the reference's uncertainty."""
    nominal = part.nominal_scale if static is None else float(static["xyz".index(part.axis)])
    if nominal is None:
        note = "no static scale and no nominal_scale to compare with; set nominal_scale"
        return FigureValue.not_measured("sweep_sensitivity_percent", part.axis, note)
    value = 100.0 * (abs(fit.sensitivity) / nominal - 1.0)
    error = float(np.hypot(100.0 * fit.sensitivity_error, part.reference_percent))
    return FigureValue("sweep_sensitivity_percent", part.axis, value, error)


def alone_text(diagnosis: TransferDiagnosis) -> str:
    """A sentence on single points that depart unlike any effect; empty without such points."""
    where = ", ".join(f"{f:.4g} Hz" for f in diagnosis.alone_hz)
    return f"a point departs alone, and not as any effect would, at {where}; measure there again" if where else ""


def _remains(diagnosis: TransferDiagnosis) -> list[tuple[str, str]]:
    """Findings on what no effect explains: single points, or a deviation of many."""
    if diagnosis.alone_hz:
        return [("bad point", alone_text(diagnosis))]
    text = "a significant deviation remains that no effect of the catalogue describes"
    return [("unexplained", text)] if diagnosis.unexplained else []


def diagnosis_text(diagnosis: TransferDiagnosis) -> list[tuple[str, str]]:
    """Subject and text of the findings of the diagnosis on one unit."""
    fit = diagnosis.fit
    model = " + ".join(("sensitivity", *fit.effects))
    out: list[tuple[str, str]] = []
    if diagnosis.adequate is None:
        return [("model", f"{model}: cannot be judged: {diagnosis.reason}")]
    verdict = "adequate" if diagnosis.adequate else "not adequate"
    text = (
        f"{model} is {verdict}: χ² {fit.chi_square:.1f} for {degrees_of_freedom(fit.dof)}, "
        f"{probability(fit.p_value)}, rms residual {diagnosis.error_percent:.2g} %"
    )
    out.append(("model", text))
    if diagnosis.where:
        places = [
            f"{w.part} from {w.low_hz:.4g} to {w.high_hz:.4g} Hz ({100.0 * w.share:.0f} % of χ²)"
            for w in diagnosis.where[:3]
        ]
        out.append(("range of misfit", ", ".join(places)))
    for missed in diagnosis.classes:
        first, *others = missed.effects
        alike = f"; not separated from {', '.join(others)}" if others else ""
        out.append(("missing effect", f"{first} ({probability(missed.p_value)}){alike}"))
    if diagnosis.classes:
        before, after = diagnosis.left_out
        text = (
            f"rms residual {diagnosis.error_percent:.2g} % → {diagnosis.extended_percent:.2g} % with "
            f"{', '.join(diagnosis.recommended)}; of points "
            f"left out, in standard uncertainties: {before:.2g} → {after:.2g}"
        )
        out.append(("after extension", text))
    out += _remains(diagnosis)
    fit_effects = set(diagnosis.extended.effects)
    for p in diagnosis.extended.parameters:
        parameter = diagnosis.parameter(p.name)
        if p.log and not parameter.identified:
            known = _interval(parameter.low, parameter.high, "" if p.unit == "1" else f" {p.unit}")
            out.append(("not identified", f"{p.name}: {known}"))
        elif p.name == "delay_s" and not diagnosis.unexplained:
            text = f"{1e6 * parameter.value:.2f} µs, 95 % interval {1e6 * parameter.low:.2f} … {1e6 * parameter.high:.2f} µs"
            if parameter.rival is not None:
                *_, low, high = diagnosis.extended.of(p.name)
                others = dict.fromkeys(
                    name for fit in diagnosis.rivals for name in fit.effects if name not in fit_effects
                )
                text += (
                    f" ({1e6 * low:.2f} … {1e6 * high:.2f} µs without {', '.join(others)}, which may make a part of it)"
                )
            out.append(("delay", text))
    if diagnosis.next_hz:
        out.append(("next frequencies to measure", ", ".join(f"{f:.4g} Hz" for f in diagnosis.next_hz)))
    return out


TOO_GOOD_P = 1e-3
"""Probability of so small a χ² below which the stated uncertainties are told to be too large."""


def model_texts(diagnosis: TransferDiagnosis, points: Points, output: str = "") -> list[tuple[str, str]]:
    """Subject and text of the figures of a model with U (k = 2), of its polarity, and of uncertainties too large or small.

    output : unit of the output, where it is stated
    """
    fit, out = diagnosis.extended, list[tuple[str, str]]()
    if diagnosis.adequate is None:
        return out
    values = figures_of_model("z", diagnosis, points, "sweep")
    names, units = ("bandwidth", WORD["natural_hz"], WORD["damping"]), (" Hz", " Hz", "")
    known = [
        f"{name} {with_uncertainty(figure.value, 2.0 * figure.uncertainty)}{unit}"
        for name, unit, figure in zip(names, units, values, strict=True)
        if figure.identified
    ]
    if known:
        size = with_uncertainty(fit.sensitivity, 2.0 * abs(fit.sensitivity) * fit.sensitivity_error)
        out.append(("figures", f"sensitivity {size}{f' {output}' if output else ''} per g, {', '.join(known)} (k = 2)"))
    if diagnosis.unexplained:
        delay = ", delay" if fit.has("delay_s") else ""
        out.append(("not determined", f"{', '.join(names)}{delay}: {values[0].note}"))
    elif not values[0].identified:  # of the parameters the diagnosis says it
        out.append(("not determined", f"{names[0]}: {values[0].note}"))
    turned = (
        "the output is turned over: its phase at low frequency is π; exchange the wires, or give it a negative sign"
    )
    agreement = np.cos(fit.residual.reshape(2, -1)[1] * points.phase_error)  # of drawn phases 0 with variance 1/2
    if not diagnosis.unexplained or np.mean(agreement) > 3.0 / np.sqrt(2.0 * agreement.size):
        out.append(("polarity", turned if fit.sensitivity < 0.0 else "positive, the phase at low frequency is 0"))
    share = float(np.sqrt(fit.chi_square / max(fit.dof, 1)))
    if fit.dof > 0 and fit.p_value > 1.0 - TOO_GOOD_P:
        text = (
            f"the scatter is {share:.2g} of the stated uncertainties: they are too large for single points, or hold what all "
            "points share; U of the figures is too large by as much"
        )
        out.append(("uncertainties", text))
    elif diagnosis.unexplained and not diagnosis.alone_hz:
        left = fit.residual.reshape(2, -1)[:, np.argsort(points.conditions.frequency)]  # magnitudes and phases
        # of independent errors the correlation of neighbours is below two of its standard deviations, 2/√n
        if np.sum(np.diff(left) ** 2) > 2.0 * (1.0 - 2.0 / np.sqrt(left.size)) * np.sum(left**2):
            text = (
                f"the points scatter by {share:.2g} times the stated uncertainties, in no order: these may be too small"
            )
            out.append(("uncertainties", text))
    return out


def sampling_text(rate_hz: float, bandwidth_hz: float, order: int) -> str:
    """Whether the rate is five times the bandwidth, and the part that a filter of this order aliases onto the band's edge."""
    times = rate_hz / bandwidth_hz
    share = 100.0 * folded_share(rate_hz, bandwidth_hz, order)
    rule = "at least 5" if times >= 5.0 else "less than the 5 of the rule"
    return (
        f"{rate_hz:.5g} Hz is {times:.3g} times the bandwidth, {rule}; a filter of order {order} "
        f"leaves {share:.2g} % aliased onto the band's edge"
    )
