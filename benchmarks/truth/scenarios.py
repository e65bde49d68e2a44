"""The rows of the figures: which runs each one is scored on."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from .device import KINDS
from .faults import FAULTS, GAIN
from .poses import PLANS, SOAKS
from .run import Run, make_run
from .scene import COVARIATES
from .spec import STATIC_BASE, Spec

GENERIC = ("fibonacci24", "twenty_six")
EDGES = (*GENERIC, "eighteen")
ANY = (*EDGES, "orthogonal24", "six")
WARM = ("five", "nine", "shuffled")
LOOPS = ("nine", "shuffled")
ROUNDS = (*WARM, "three", "one")
MOST_DWELLS = 240
LEAST_DWELLS = 72
STRIDE = 11  # shares no factor with the lengths of the lists, so that few runs already span them
SEPARATE = 0.3  # below this share two effects of one run are the same thing to any method

Home = tuple[tuple[str, ...], tuple[str, ...]]
HOMES: dict[str, Home] = {
    "second_order": (ANY, ROUNDS), "scale_asymmetry": (ANY, ROUNDS), "fourth_order": (EDGES, ROUNDS),
    "third_order": (EDGES, ROUNDS), "odd_quadratic": (GENERIC, ROUNDS), "bias_asymmetry": (("fibonacci24", "tilt_scan"), ROUNDS),
    "fifth_order": (EDGES, ROUNDS), "cross_coupling": (EDGES, ROUNDS), "cross_axis_quadratic": (EDGES, ROUNDS),
    "adc_nonlinearity": (("fibonacci24", "tilt_scan"), ROUNDS), "dead_zone": (("tilt_scan",), ("one", "three", "five")),
    "clipping": (("fibonacci24", "eighteen"), ROUNDS),
    "bias_temperature_quadratic": (ANY, WARM), "bias_temperature_cubic": (ANY, WARM), "scale_temperature_quadratic": (ANY, WARM),
    "misalignment_temperature": (ANY, WARM), "second_order_temperature": (ANY, WARM), "thermal_rate": (ANY, ("ramps",)),
    "thermal_lag": (ANY, ("ramps",)), "thermal_hysteresis": (ANY, LOOPS), "thermal_kink": (ANY, ("steps",)),
    "warm_up": (ANY, ("one", "three")), "aging_linear": (ANY, (*LOOPS, "one")), "scale_aging": (ANY, (*LOOPS, "one")),
    "aging_log": (ANY, (*LOOPS, "one")), "step_change": (ANY, (*LOOPS, "one")), "creep_after_move": (ANY, ROUNDS),
    "pose_hysteresis": (GENERIC, ROUNDS), "vibration_rectification": (ANY, ROUNDS), "supply_sensitivity": (ANY, ROUNDS),
    "magnetic": (GENERIC, ROUNDS), "level_error": (GENERIC, ROUNDS), "outer_encoder_offset": (GENERIC, ROUNDS),
    "encoder_harmonic": (GENERIC, ROUNDS), "axis_nonorthogonality": (EDGES, ROUNDS), "backlash": (GENERIC, ROUNDS),
}  # fmt: skip
STATION = ("level_error", "outer_encoder_offset", "encoder_harmonic", "axis_nonorthogonality", "backlash")
ENTANGLED = (  # pairs of which one spans the other, whatever their amplitudes
    {"backlash", "pose_hysteresis"},
    {"magnetic", "level_error"},
    {"magnetic", "outer_encoder_offset"},
    {"level_error", "outer_encoder_offset"},
)
REMEMBERED = ("thermal_lag", "thermal_rate", "thermal_hysteresis")  # need the temperature between the dwells
WITHHELD: dict[str, Home] = {
    "withheld:tide": (GENERIC, ("one", "nine")),
    "withheld:touch": (("fibonacci24",), ("one", "three")),
    "withheld:frost": (GENERIC, ("steps",)),
    "withheld:ringing": (GENERIC, ("one", "three")),
    "withheld:brownout": (GENERIC, ("one", "nine")),
    "withheld:rattle": (GENERIC, ("one", "nine")),
    "withheld:bearing": (GENERIC, ("one", "three")),
}
INVISIBLE: dict[str, Home] = {
    "cross_coupling": (("six", "orthogonal24"), ROUNDS), "third_order": (("six", "orthogonal24"), ROUNDS),
    "odd_quadratic": (("six", "orthogonal24"), ROUNDS), "fifth_order": (("six", "orthogonal24"), ROUNDS),
    "gravity_value": (ANY, ROUNDS), "slot_rotation": (ANY, ROUNDS),
}  # fmt: skip
FAULT_NAMES = (*FAULTS, "units_swapped")


def _home(rng: np.random.Generator, homes: list[Home]) -> tuple[str, str] | None:
    plans = [plan for plan in homes[0][0] if all(plan in home[0] for home in homes)]
    soaks = [soak for soak in homes[0][1] if all(soak in home[1] for home in homes)]
    if not plans or not soaks:
        return None
    return str(rng.choice(plans)), str(rng.choice(soaks))


def _repeats(rng: np.random.Generator, plan: str, soaks: str) -> int:
    if soaks == "ramps":
        return 1 if len(PLANS[plan]) > 10 else 4
    once = len(PLANS[plan]) * len(SOAKS[soaks])
    least = max(1, -(-LEAST_DWELLS // once), 2 if once * 2 <= MOST_DWELLS else 1)
    return int(rng.integers(least, max(least, MOST_DWELLS // once) + 1))


def _plan(rng: np.random.Generator, plan: str, soaks: str, **extra: object) -> Spec:
    decoys = tuple(sorted(rng.choice(COVARIATES, int(rng.integers(0, 4)), replace=False).tolist()))
    spec = Spec(
        plan=plan, soaks=soaks, repeats=_repeats(rng, plan, soaks), decoys=decoys,
        device=str(rng.choice(list(KINDS))), shuffled_poses=bool(rng.random() < 0.7),
        reference="angles" if rng.random() < 0.85 else "force",
        flicker=float(rng.choice([0.0, 0.3, 1.0])), power_cycles=False,
    )  # fmt: skip
    return replace(spec, **extra)  # type: ignore[arg-type]


def _fits(run: Run, *, visible: bool) -> bool:
    effects = run.sealed.effects
    return (
        all(e.visible == visible and (e.plausible or not visible) for e in effects)
        and run.sealed.separation >= SEPARATE
    )


def _settings(effects: tuple[str, ...]) -> dict[str, object]:
    """What a plan needs for these effects to be themselves: power cycles, uneven waits, shuffled poses, angles given."""
    extra: dict[str, object] = {}
    if "warm_up" in effects:
        extra["power_cycles"] = True
    if set(REMEMBERED) & set(effects):
        extra["history"] = True
    if {"backlash", "pose_hysteresis"} & set(effects):
        extra["shuffled_poses"] = True
    if set(STATION) & set(effects) or "magnetic" in effects or "withheld:bearing" in effects:
        extra["reference"] = "angles"
    return extra


def _search(rng: np.random.Generator, build: Callable[[], Spec | None], *, visible: bool = True) -> Run:
    """The first run of many tries that shows what its row is about."""
    for _ in range(400):
        spec = build()
        if spec is None:
            continue
        run = make_run(spec, int(rng.integers(2**31)))
        if not spec.effects or _fits(run, visible=visible):
            return run
    raise RuntimeError("scenarios: 400 tries gave no run that fits its row; loosen the row's homes")


def _hidden(rng: np.random.Generator, count: int, size: float, first: str | None = None, **extra: object) -> Run:
    names = list(HOMES)

    def build() -> Spec | None:
        picked = [first] if first else [str(rng.choice(names))]
        while len(picked) < count:
            other = str(rng.choice(names))
            if other not in picked:
                picked.append(other)
        home = _home(rng, [HOMES[name] for name in picked])
        if home is None or any(pair <= set(picked) for pair in ENTANGLED):
            return None
        chosen = tuple(picked)
        return _plan(rng, *home, effects=chosen, sizes=(size,) * count, **(_settings(chosen) | extra))

    return _search(rng, build)


def _null(rng: np.random.Generator, **extra: object) -> Run:
    def build() -> Spec:
        soaks = str(rng.choice([*ROUNDS, "ramps"]))
        plan = str(rng.choice(ANY))
        return _plan(rng, plan, soaks, power_cycles=bool(rng.random() < 0.2) and soaks != "ramps", **extra)

    return _search(rng, build)


def _from(homes: dict[str, Home], rng: np.random.Generator, index: int, size: float, *, visible: bool) -> Run:
    name = list(homes)[index % len(homes)]

    def build() -> Spec | None:
        home = _home(rng, [homes[name]])
        return None if home is None else _plan(rng, *home, effects=(name,), sizes=(size,), **_settings((name,)))

    return _search(rng, build, visible=visible)


def _covariate(rng: np.random.Generator, shape: str) -> Run:
    def build() -> Spec:
        column = str(rng.choice([name for name in COVARIATES if name != "pressure_hPa" or shape == "line"]))
        return _plan(
            rng, str(rng.choice(ANY)), str(rng.choice(["one", "nine", "shuffled"])),
            effects=(f"covariate:{column}",), sizes=(2.0,), covariate_shape=shape,
        )  # fmt: skip

    return _search(rng, build)


def _faulty(rng: np.random.Generator, index: int) -> Run:
    name = FAULT_NAMES[index % len(FAULT_NAMES)]
    thermal = name == "stale_temperature"
    alone = name != "units_swapped" and rng.random() < 0.2
    extra: dict[str, object] = {"units": 1} if alone else {}
    if name == "torn_words":
        extra["device"] = "counts"
    elif alone and name in GAIN:
        extra["device"] = "mems"  # nobody can tell the units of one device whose sensitivity is unknown
    if index % 3 == 0 and not alone:
        extra |= {"effects": ("second_order",), "sizes": (2.0,)}

    def build() -> Spec:
        soaks = str(rng.choice(["five", "nine"] if thermal else ["one", "five", "nine"]))
        return _plan(rng, str(rng.choice(EDGES)), soaks, faults=(name,), **extra)

    return _search(rng, build)


def _bare(rng: np.random.Generator, index: int) -> Run:
    """A starting model without temperature, judged on a run over temperature."""
    name = ("bias_temperature", "scale_temperature")[index % 2]

    def build() -> Spec:
        soaks = str(rng.choice(["three", *WARM]))
        return _plan(rng, str(rng.choice(ANY)), soaks, effects=(name,), sizes=(2.0,), base=STATIC_BASE)

    return _search(rng, build)


SCENARIOS: dict[str, Callable[[np.random.Generator, int], Run]] = {
    "lot8_size2": lambda rng, k: _hidden(rng, 1, 2.0, list(HOMES)[k % len(HOMES)]),
    "lot8_size1": lambda rng, k: _hidden(rng, 1, 1.0, list(HOMES)[k % len(HOMES)]),
    "lot8_size05": lambda rng, k: _hidden(rng, 1, 0.5, list(HOMES)[k % len(HOMES)]),
    "lot8_size4": lambda rng, k: _hidden(rng, 1, 4.0, list(HOMES)[k % len(HOMES)]),
    "single_size2": lambda rng, k: _hidden(
        rng, 1, 2.0, [n for n in HOMES if n not in STATION][k % (len(HOMES) - 5)], units=1
    ),
    "lot4_size2": lambda rng, k: _hidden(rng, 1, 2.0, list(HOMES)[k % len(HOMES)], units=4),
    "lot16_size2": lambda rng, k: _hidden(rng, 1, 2.0, list(HOMES)[k % len(HOMES)], units=16),
    "station_size2": lambda rng, k: _hidden(rng, 1, 2.0, STATION[k % len(STATION)]),
    "null_white": lambda rng, _k: _null(rng, flicker=0.0),
    "null_flicker": lambda rng, _k: _null(rng, flicker=float(rng.uniform(1.0, 2.5))),
    "null_walk": lambda rng, _k: _null(rng, flicker=0.5, walk=0.7),
    "null_single": lambda rng, k: _null(rng, units=1, flicker=0.0 if k % 2 else 1.5),
    "pairs": lambda rng, _k: _hidden(rng, 2, 2.0),
    "triples": lambda rng, _k: _hidden(rng, 3, 2.0),
    "covariate_line": lambda rng, _k: _covariate(rng, "line"),
    "covariate_curve": lambda rng, _k: _covariate(rng, "curve"),
    "withheld": lambda rng, k: _from(WITHHELD, rng, k, 2.0, visible=True),
    "invisible": lambda rng, k: _from(INVISIBLE, rng, k, 4.0, visible=False),
    "faults": _faulty,
    "bare_model": _bare,
}


def case(scenario: str, index: int, seed: int) -> Run:
    """The `index`-th run of a scenario; the same seed gives the same run whatever else is made."""
    if scenario not in SCENARIOS:
        raise ValueError(f"scenarios: no scenario named {scenario!r}; needs one of {', '.join(SCENARIOS)}")
    entropy = np.random.SeedSequence([seed, zlib.crc32(scenario.encode()), index])
    return SCENARIOS[scenario](np.random.default_rng(entropy), STRIDE * index + seed)
