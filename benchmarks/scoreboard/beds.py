"""The beds of the scoreboard: which cases each has, and which of their outcomes are the better the rarer."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from benchmarks.hand_turned import EFFECTS as HAND
from benchmarks.strangers import KINDS

HERE = Path(__file__).resolve().parents[1]
Case = tuple[str, str, int]

RARER = {
    *("broken", "not adequate", "physics beside the truth", "another effect named", "named something", "named"),
    *("physics named", "false fault"),
}
"""Outcomes that are mistakes; the others are to be frequent."""


class Bed(NamedTuple):
    """Cases of one kind.

    family : who judges them, a function of ``judge.py``
    names : worlds, scenarios or hidden effects
    runs : of each name, in the whole scoreboard
    """

    family: str
    bed: str
    names: tuple[str, ...]
    runs: int

    def cases(self, seed: int, share: float) -> Iterator[Case]:
        """Bed, name and seed of each case; the seeds of different names are apart."""
        for place, name in enumerate(self.names):
            for run in range(max(1, round(share * self.runs))):
                yield self.bed, name, 1000 * (seed + 100 * place) + run


BLIND = {
    "lot8_size2": 90, "lot8_size1": 90, "single_size2": 60, "station_size2": 20, "null_white": 40, "null_flicker": 40,
    "null_walk": 20, "null_single": 30, "pairs": 20, "withheld": 20, "invisible": 20, "covariate_line": 15,
    "covariate_curve": 15, "faults": 30,
}  # fmt: skip
DYNAMIC = {
    "shock": ("filter_of_unit", "filter_of_reference", "ac_coupled_reference", "zero_shift", "second_order",
              "third_order", "mounting_resonance", "own_clock", "delay", "nothing"),
    "spin": ("arm_stretch", "odd_quadratic", "mass_offset", "asymmetry", "scale_drift", "bias_drift", "hysteresis",
             "second_order", "third_order", "nothing"),
}  # fmt: skip


def beds() -> list[Bed]:
    """Every bed."""
    found = [
        *(Bed("worlds", bed, names, runs) for bed, (names, runs) in _worlds().items()),
        *(Bed("blind", name, (name,), runs) for name, runs in BLIND.items()),
        *(Bed("recordings", name, (name,), runs) for name, runs in {"nulls": 60, "bad": 40, "hidden": 40}.items()),
        *(Bed("hand", f"hand_{name}", (name,), 40) for name in HAND),
        *(Bed("dynamic", test, names, 6) for test, names in DYNAMIC.items()),
    ]
    strange: dict[str, list[str]] = {}
    for kind in KINDS.values():
        outside = kind.world == "effect" and not kind.catalogue
        strange.setdefault("outside" if outside else f"{kind.world}s", []).append(kind.name)
    found += [Bed("strangers", bed, tuple(names), 24 if bed == "nulls" else 4) for bed, names in strange.items()]
    return found


def _worlds() -> dict[str, tuple[tuple[str, ...], int]]:
    """Tables of worlds, with the number of runs of each world."""
    import sys

    sys.path.insert(0, str(HERE / "worlds"))
    from part import SCENES  # type: ignore[import-not-found]
    from tables import LOOP, TABLES  # type: ignore[import-not-found]

    runs = {"nulls": 6, "noises": 6, "faults": 5, "hidden": 4, "outside": 3, "ramp_nulls": 10, "ramp_hidden": 10}
    tables = {name: (tuple(TABLES[name]), count) for name, count in runs.items()}
    return tables | {"scenes": (tuple(SCENES), 2), "loop": (tuple(LOOP), 2)}


def generators() -> list[Path]:
    """Files that make the truths: where one changes, lots are made anew."""
    folders = (HERE / "worlds", HERE / "strangers", HERE / "truth")
    files = [path for folder in folders for path in sorted(folder.glob("*.py")) if not path.name.startswith("test_")]
    files += [HERE / name for name in ("score.py", "made_recordings.py", "hand_turned.py", "shock_and_spin.py")]
    for path in files:
        ast.parse(path.read_text("utf-8"))  # a generator that is being edited is no truth
    return files
