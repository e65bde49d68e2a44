"""The JSON documents of a corrected recording and of a simulated one: keys that other programs read."""

from typing import Annotated, Any, Literal

from typing_extensions import TypedDict


class FilterDocument(TypedDict):
    """A low-pass filter behind a correction: y = Σ b·x − Σ a·y."""

    kind: Literal["butterworth", "fir", "moving-average"]
    rate_hz: float
    cutoff_hz: Annotated[float, "where the power has fallen to a half"]
    cutoff_from: Annotated[str, "`given`, or the run that measured the bandwidth"]
    delay_s: Annotated[float, "group delay at 0 Hz"]
    noise_bandwidth_hz: float
    numerator: list[float]
    denominator: list[float]


class TrackedBiasDocument(TypedDict):
    """The bias that was tracked along a recording."""

    force_from: Annotated[list[str], "where the true force is known from"]
    last_ug: Annotated[dict[str, float], "bias at the end, by axis"]
    u_last_ug: Annotated[dict[str, float], "its standard uncertainty, by axis"]
    u_last_at_limits_ug: Annotated[
        dict[str, float] | None,
        "the same with the upper limits (95 %) of the noise terms that the static record does not identify",
    ]
    updates: Annotated[int, "steps in which the force was known"]
    steps: int
    rejected: Annotated[int, "innovations beyond 5 standard deviations"]
    nis: Annotated[float | None, "mean of the squared normalised innovations; null: too few updates"]
    nis_bounds: Annotated[list[float | None], "its 95 % bounds"]
    lag_1: Annotated[float | None, "correlation of successive innovations"]
    lag_1_bound: Annotated[float | None, "white below this magnitude"]
    stated_uncertainty: Annotated[
        Literal["consistent", "too small", "too large"] | None, "by the innovations; null: too few updates"
    ]
    processes_s: Annotated[list[float], "correlation times of the Gauss–Markov processes of the bias instability, s"]
    processes_flat: Annotated[float, "largest relative deviation of their Allan deviation from a flat one"]


class CorrectDocument(TypedDict):
    """``correct --json``: a corrected recording, and the bias where it was tracked."""

    file: str
    run: str
    unit: str
    certificate: Annotated[dict[str, Any] | None, "that of the coefficients, as in `show UNIT`; null: not certified"]
    samples: int
    outside_temperature: Annotated[int, "samples outside the measured temperatures"]
    temperatures_C: Annotated[list[float], "lowest and highest measured temperature"]
    u_ug: Annotated[dict[str, float], "standard uncertainty of a sample, RMS, by axis"]
    u_contains: Annotated[list[str], "what the uncertainty includes"]
    output: Annotated[str | None, "the file that was written; null: none"]
    filter: Annotated[FilterDocument | None, "null: none was asked for"]
    state: Annotated[str | None, "the file with which the next recording goes on; null: none"]
    bias: Annotated[TrackedBiasDocument | None, "null: the force is known nowhere, nothing was tracked"]


class SimulateDocument(TypedDict):
    """``simulate --json``: a trajectory through a calibrated unit."""

    file: str
    run: str
    unit: str
    out_unit: str
    samples: int
    bandwidth_hz: Annotated[float | None, "of the sensor; null: it follows at once"]
    seed: Annotated[int | None, "of the noise; null: none was added"]
    noise: Annotated[dict[str, list[float]], "terms of the static record by axis; empty: none was added"]
    clipped: Annotated[int, "samples at the end of the range"]
    error_at_25_C_ug: Annotated[dict[str, float], "RMS, by axis, that bias and response at 25 °C leave"]
    told: Annotated[list[str], "what was assumed"]
    output: str
