"""Judges the cases of one family of beds with the product of one checkout; started by ``python -m benchmarks.scoreboard``.

``python judge.py FAMILY PRODUCT LOTS CASES ANSWERS``: CASES is a file with a case [bed, world, seed] in each line, ANSWERS gets
an object in each line. The truth is made by this checkout's generators, kept in LOTS, never by the product that is judged.
"""

from __future__ import annotations

import hashlib
import importlib.util
import json
import pickle
import sys
import time
import traceback
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
THERMAL = {"bias_temperature", "scale_temperature"}
"""What every device of the second generator has; a plan at one temperature leaves it out of the model that is judged."""
ROOT = HERE.parents[1]
Outcome = Mapping[str, bool | None]


def _loaded(path: Path, name: str) -> Any:
    """A module by its path: several folders of beds have modules of the same names."""
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = sys.modules[name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def kept(folder: Path, key: str, make: Callable[[], Any]) -> Any:
    """What was made once under a key; both products get the same bytes."""
    path = folder / f"{hashlib.sha256(key.encode()).hexdigest()[:24]}.pickle"
    if path.is_file():
        return pickle.loads(path.read_bytes())
    made = make()
    folder.mkdir(parents=True, exist_ok=True)
    part = path.with_suffix(f".{time.time_ns()}")
    part.write_bytes(pickle.dumps(made))
    part.replace(path)
    return made


def worlds(product: Path, lots: Path) -> Callable[[str, str, int], Outcome]:
    """Worlds of ``benchmarks/worlds``: tables of verdicts, scenes, and the loop of adding an effect."""
    sys.path[:0] = [str(product), str(ROOT / "benchmarks" / "worlds")]
    import part  # type: ignore[import-not-found]
    import verdict  # type: ignore[import-not-found]
    from world import make  # type: ignore[import-not-found]

    def making(world: Any, seed: int) -> Any:
        return kept(lots, f"{world!r} {seed}", lambda: make(world, seed))

    def looped(name: str, seed: int) -> Outcome:
        _, said = verdict.looped(("loop", name, seed), making)
        return {f"{kind}: {effect}": confirmed is True for kind, each in said.items() for effect, confirmed in each}

    def scene(name: str, seed: int) -> Outcome:
        _, row = part.first_looks(("scenes", name, seed))
        return {"in class": row["held"], "another effect named": bool(row["beside"])}

    def judged(bed: str, name: str, seed: int) -> Outcome:
        if bed == "loop":
            return looped(name, seed)
        if bed == "scenes":
            return scene(name, seed)
        _, row = verdict.diagnosed((bed, name, seed), making)
        if "broken" in row:
            return {"broken": True}
        outcome = {
            "broken": False,
            "not adequate": row["adequate"] is False if bed in {"nulls", "noises", "ramp_nulls"} else None,
            "physics beside the truth": bool(row["stray"]),
            "fault told": row["found"],
            "in class": row["held"],
            "exact": None if row["held"] is None else row["held"] and row["alone"],
            "unexplained said": row["unexplained"] if row["outside"] else None,
        }
        return {key: value for key, value in outcome.items() if value is not None}

    return judged


def blind(product: Path, lots: Path) -> Callable[[str, str, int], Outcome]:
    """Blind lots of ``benchmarks/truth``."""
    module = _loaded(ROOT / "benchmarks" / "blind.py", "blind")
    sys.path.insert(0, str(product))
    make = module.case
    module.case = lambda *key: kept(lots, repr(key), lambda: make(*key))

    def judged(bed: str, name: str, seed: int) -> Outcome:
        _, score, document, sealed = module.one(module.Job(name, seed % 1000, seed // 1000, "tumbleline"))
        one, faulty = score.exact is not None, bool(sealed["faults"])
        outcome = {
            "in class": score.in_class if one else None,
            "exact": score.exact,
            "recommended": sorted(document["recommended"]) == sorted(score.truth) if one and not faulty else None,
            "fresh run ≤ 1.05 of the true model's": None if score.oracle_ratio is None else score.oracle_ratio <= 1.05,
            "named something": score.named_something if name.startswith("null") else None,
            "not adequate": score.called_inadequate if name.startswith("null") else None,
            "driver right": score.driver_right,
            "none of the catalogue said": score.none_of_catalogue,
            "invisible listed": score.invisible_listed,
            "fault told": score.fault_named,
            "false fault": score.false_fault,
        }
        return {key: value for key, value in outcome.items() if value is not None}

    return judged


def recordings(product: Path, lots: Path) -> Callable[[str, str, int], Outcome]:
    """Single units in positions that are not known."""
    module = _loaded(ROOT / "benchmarks" / "recordings.py", "recordings")
    sys.path.insert(0, str(product))
    kinds = {"nulls": module.nulls, "bad": module.bad, "hidden": module.hidden}
    make = module.make
    module.make = lambda what, seed: kept(lots, f"{what!r} {seed}", lambda: make(what, seed))

    def judged(bed: str, name: str, seed: int) -> Outcome:
        what = kinds[name](seed % 1000 + 1)[seed % 1000]
        row = module.judged(what, seed)
        if name == "nulls":
            return {"named": bool(row["physics"] or row["named"]), "not adequate": row["adequate"] is False}
        if name == "bad":
            return {
                "all that can be told are told": row["searched"] <= row["named"] | (row["searched"] - row["spoilt"]),
                "physics named": bool(row["physics"]),
            }
        own = {"third_order"} if what.cubic else {"warm_up", "aging_log", "aging_linear"}
        named = [set(effects) for effects in row["physics"]]
        return {"in class": any(own & each for each in named), "another effect named": any(not own & e for e in named)}

    return judged


def hand(product: Path, lots: Path) -> Callable[[str, str, int], Outcome]:
    """One unit turned by hand, with an effect of ten times the noise."""
    module = _loaded(ROOT / "benchmarks" / "hand_turned.py", "hand_turned")
    sys.path.insert(0, str(product))

    def judged(bed: str, name: str, seed: int) -> Outcome:
        outcome = module.judged(name, kept(lots, f"{name} {seed}", lambda: module.make(name, seed)))
        return {what: hit for what, hit in outcome.items() if what != "suspected"}  # neither a hit nor a mistake

    return judged


def dynamic(product: Path, lots: Path) -> Callable[[str, str, int], Outcome]:
    """Shocks and centrifuges with a hidden effect, and without."""
    sys.path.insert(0, str(product))
    module = _loaded(ROOT / "benchmarks" / "shock_and_spin.py", "shock_and_spin")

    def judged(bed: str, name: str, seed: int) -> Outcome:
        classes = getattr(module, f"{bed}_classes")(seed % 1000, seed // 1000, None if name == "nothing" else name)
        if name == "nothing":
            return {"named something": bool(classes)}
        return {"in class": any(name in one for one in classes), "exact": classes == [(name,)]}

    return judged


def strangers(product: Path, lots: Path) -> Callable[[str, str, int], Outcome]:
    """Lots of a generator that knows nothing of the judge."""
    sys.path[:0] = [str(product)]
    sys.path.append(str(ROOT))
    from benchmarks.strangers import make  # type: ignore[import-not-found]
    from pipelines.diagnosis.diagnose import diagnose

    def judged(bed: str, name: str, seed: int) -> Outcome:
        size = 20.0 if bed == "faults" else 2.0  # handling shifts by microradians at twice the noise of a dwell
        lot = kept(lots, f"{name} {seed} {size}", lambda: make(name, seed, size=size))
        document = diagnose(lot.dwells, lot.history)
        groups = [set(g["effects"]) for g in document["classes"] if g.get("scope") != "data"]
        physics = [each for each in groups if not each & THERMAL]
        named, inadequate = bool(physics), document["adequate"] is False and len(physics) == len(groups)
        if bed in {"nulls", "noises"}:
            return {"physics named": named, "not adequate": inadequate}
        if bed == "faults":
            return {
                "physics named": named,
                "a fault told": len(groups) < len(document["classes"]) or bool(document["blocked_by"]),
            }
        if bed == "outside":
            return {"not adequate said": inadequate or document["unexplained"] is not None}
        held = any(set(lot.truth["catalogue"]) & each for each in physics)
        return {"in class": held, "exact": held and len(physics) == 1 and len(groups) == len(document["classes"])}

    return judged


FAMILIES = {each.__name__: each for each in (worlds, blind, recordings, hand, dynamic, strangers)}


def main() -> None:
    """Answer the cases, each flushed as it is made."""
    family, product, lots, cases, answers = sys.argv[1:]
    judged = FAMILIES[family](Path(product).resolve(), Path(lots))
    with Path(answers).open("w", encoding="utf-8") as file:
        for line in Path(cases).read_text("utf-8").splitlines():
            bed, name, seed = json.loads(line)
            begin = time.process_time()
            try:
                outcome = dict(judged(bed, name, seed))
            except Exception:  # noqa: BLE001  # a case that breaks the product is a result
                sys.stderr.write(f"{family} {bed} {name} {seed}: {traceback.format_exc()}")
                outcome = {"broken": True}
            taken = time.process_time() - begin
            told = {"case": [family, bed, name, seed], "outcome": outcome, "seconds": taken}
            file.write(json.dumps(told) + "\n")
            file.flush()


if __name__ == "__main__":
    main()
