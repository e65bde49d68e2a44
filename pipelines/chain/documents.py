"""The JSON documents of noise: Allan deviation and spectrum."""

from typing import Annotated, Literal, NotRequired

from typing_extensions import TypedDict


class AllanChannel(TypedDict):
    """The overlapping Allan deviation, or another statistic, of a channel."""

    channel: str
    tau_s: list[float]
    deviation: Annotated[list[float], "in `deviation_unit`"]
    low: Annotated[list[float | None], "null: no interval"]
    high: Annotated[list[float | None], "null: no interval"]
    fitted: Annotated[
        list[float] | None,
        "Allan deviation of the fitted terms; null: no mixture explains the curve, or another statistic",
    ]


class NoiseTermRow(TypedDict):
    """A noise term of a channel."""

    channel: str
    term: Literal["Q", "N", "B", "K", "R"]
    name: str
    value: Annotated[float | None, "null: not identified"]
    low: float
    high: Annotated[float, "upper end of the interval, or the upper limit"]
    identified: bool
    unit: str


class NavigationRow(TypedDict):
    """What the identified terms of a channel do to velocity and position without aiding."""

    channel: str
    velocity_random_walk_m_s_rth: Annotated[float | None, "60·N; null: N is not identified"]
    q_n_m2_s4_Hz: Annotated[float | None, "N², (m/s²)²/Hz"]
    q_b_m2_s4: Annotated[float | None, "B², (m/s²)²; null: B is not identified"]
    not_identified: Annotated[list[str], "terms that count as zero"]
    time_s: list[float]
    velocity_m_s: Annotated[list[float], "standard deviation after each time"]
    position_m: Annotated[list[float], "likewise"]


class DisturbanceRow(TypedDict):
    """What no noise explains in a channel of a record."""

    channel: str
    kind: Literal["spikes", "loud", "bursts", "stuck", "jump", "settling"]
    start_s: float
    stop_s: Annotated[float, "behind the last sample; of a jump where it is"]
    count: Annotated[int, "spikes, bursts, or samples"]
    size: Annotated[
        float,
        "largest spike or sample of a burst, change of the mean or standard deviation, in `unit`; 0 of a stuck output",
    ]


class AllanDocument(TypedDict):
    """``noise allan --json``: the overlapping Allan deviation of a record, or another statistic, and the noise terms."""

    source: str
    unit: Annotated[str, "of the output; empty if not given"]
    rate_hz: float
    samples: int
    statistic: Literal["allan", "modified", "hadamard", "total", "time", "tie", "mtie"]
    statistic_name: str
    deviation_unit: Annotated[str, "m/s, or `unit`·s, for `time`, `tie` and `mtie`; `unit` for the others"]
    confidence: Annotated[float, "of the intervals of the curve"]
    term_confidence: Annotated[float, "of the intervals and limits of the terms"]
    curves: list[AllanChannel]
    terms: Annotated[list[NoiseTermRow], "of the overlapping Allan deviation"]
    navigation: Annotated[list[NavigationRow], "empty where the unit is none of acceleration"]
    disturbances: NotRequired[
        Annotated[
            list[DisturbanceRow],
            "their channels have limits alone (with bursts where N changes by 2.5 %); of a captured run in `notes`",
        ]
    ]
    notes: list[str]


class SpectrumChannel(TypedDict):
    """The spectrum of a channel, and the Allan deviation that follows from it."""

    channel: str
    density: Annotated[list[float], "one-sided, unit²/Hz"]
    median_amplitude: Annotated[float, "median noise density, unit/√Hz"]
    tau_s: list[float]
    deviation_from_density: list[float]
    deviation: Annotated[list[float], "of the samples"]


class PsdDocument(TypedDict):
    """``noise psd --json``: the one-sided power spectral density of a record."""

    source: str
    unit: str
    rate_hz: float
    samples: int
    segment: Annotated[int, "samples of a segment"]
    frequency_hz: list[float]
    spectra: list[SpectrumChannel]
    notes: list[str]
