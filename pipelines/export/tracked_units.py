"""Models of the bias of units, for a filter that runs without a recording: those that ``correct`` tracks with."""

from __future__ import annotations

from collections.abc import Sequence

from inertial.noise.gauss_markov import BiasModel, bias_model
from pipelines.archive import Run
from pipelines.export.corrected import fit_of_unit, steps_flicker, terms_of_unit
from pipelines.stages.uncertainty.budget_terms import archived_terms
from schemas.errors import WrongUse
from schemas.units import MICRO


def bias_models(run: Run, serials: Sequence[str], step_s: float, turn_on_ug: float | None) -> dict[str, BiasModel]:
    """The model of each unit, by the noise of its static record.

    Parameters
    ----------
    turn_on_ug : change of the bias from one switch-on to the next; None: that of the run

    Raises
    ------
    WrongUse
        Neither is known, or the run has no static record.
    """
    terms = archived_terms(run.about)
    if turn_on_ug is None and terms is not None and terms.stability is not None:
        turn_on_ug = terms.stability.switch_on_ug
    if turn_on_ug is None:
        raise WrongUse(
            f"export: run {run.id} states no change of the bias from switch-on to switch-on, --track needs it; add --turn-on UG"
        )
    models: dict[str, BiasModel] = {}
    for serial in serials:
        noise = terms_of_unit(fit_of_unit(run, serial, failed=True, revoked=True))[0]
        flicker = steps_flicker(step_s, 0.0)
        models[serial] = bias_model(noise.white, noise.instability, noise.walk, turn_on_ug / MICRO, flicker)
    return models
