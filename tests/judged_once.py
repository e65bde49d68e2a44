"""The judgement of a lot, once: tests ask for the same one as text, as a document and as a page, of many copies."""

import pickle
from collections import OrderedDict
from collections.abc import Callable, Generator
from contextlib import contextmanager
from hashlib import sha256
from typing import Any

import pytest
from once import once

from inertial import effects

KEPT = 3
"""Diagnoses that are kept: one has the arrays of its search. A verdict is a few numbers."""


@contextmanager
def judged_once() -> Generator[None]:
    """Within it a verdict is made once in a session, and a diagnosis once in a process, for the same dwells and model."""
    from pipelines.diagnosis import diagnose
    from pipelines.stages import judge

    diagnoses: OrderedDict[bytes, Any] = OrderedDict()
    proposals: dict[int, Any] = {}
    of_lot, next_of = diagnose.diagnose_lot, diagnose.proposed
    # where two packages are within it a verdict would wait for itself
    of_run = getattr(judge._judged, "plain", judge._judged)

    def diagnosis(lot: Any, model: Any, rng: Any) -> Any:
        if effects._extra:  # a formula or a class of the test decides
            return of_lot(lot, model, rng)
        key = pickle.dumps((lot, list(model)))
        if key not in diagnoses:
            diagnoses[key] = of_lot(lot, model, rng)
            while len(diagnoses) > KEPT:
                proposals.pop(id(diagnoses.popitem(last=False)[1]), None)
        diagnoses.move_to_end(key)
        return diagnoses[key]

    def proposed(found: Any) -> Any:
        if all(found is not one for one in diagnoses.values()):
            return next_of(found)
        return _kept(proposals, id(found), lambda: next_of(found))

    def verdict(dwells: Any, history: Any, model: Any) -> Any:
        if effects._extra:
            return of_run(dwells, history, model)
        key = sha256(pickle.dumps((dwells, history, list(model)))).hexdigest()
        return once(f"verdict-{key}", lambda _: of_run(dwells, history, model))

    verdict.plain = of_run  # pyright: ignore[reportFunctionMemberAccess]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(diagnose, "diagnose_lot", diagnosis)
        patch.setattr(diagnose, "proposed", proposed)
        patch.setattr(judge, "_judged", verdict)
        yield


def _kept(things: dict[Any, Any], key: Any, make: Callable[[], Any]) -> Any:
    if key not in things:
        things[key] = make()
    return things[key]
