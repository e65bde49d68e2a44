"""The judgement of a lot, once in a process: tests ask for the same one as text, as a document and as a page, of many copies."""

import pickle
from collections import OrderedDict
from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import Any

import pytest

from inertial import effects

KEPT = 3
"""Diagnoses that are kept: one has the arrays of its search. A verdict is a few numbers."""


@contextmanager
def judged_once() -> Generator[None]:
    """Within it a verdict and a diagnosis are made once for the same dwells and the same model of the catalogue."""
    from pipelines.diagnosis import diagnose
    from pipelines.stages import judge

    diagnoses: OrderedDict[bytes, Any] = OrderedDict()
    proposals: dict[int, Any] = {}
    verdicts: dict[bytes, Any] = {}
    of_lot, of_run, next_of = diagnose.diagnose_lot, judge.verdict_on, diagnose.proposed

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
        key = pickle.dumps((dwells, history, list(model)))
        return dict(_kept(verdicts, key, lambda: of_run(dwells, history, model)))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(diagnose, "diagnose_lot", diagnosis)
        patch.setattr(diagnose, "proposed", proposed)
        patch.setattr(judge, "verdict_on", verdict)
        yield


def _kept(things: dict[Any, Any], key: Any, make: Callable[[], Any]) -> Any:
    if key not in things:
        things[key] = make()
    return things[key]
