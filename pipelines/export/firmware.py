"""What firmware does behind a correction, as C: the low-pass, and the filter of the bias with the noise of each unit."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from inertial.dynamics.output_filter import OutputFilter
from inertial.noise.bias_filter import first_covariances, transitions_by_axis
from inertial.noise.gauss_markov import BiasModel, bias_model
from pipelines.archive import Run
from pipelines.export.corrected import fit_of_unit, steps_flicker, terms_of_unit
from pipelines.stages.uncertainty.budget_terms import archived_terms
from schemas.errors import WrongUse
from schemas.units import MICRO


@dataclass(frozen=True)
class Firmware:
    """A low-pass behind the correction, and models of the bias by unit with the length of their steps, s; None, empty: none."""

    low_pass: OutputFilter | None = None
    bias: dict[str, BiasModel] | None = None
    step_s: float = 1.0

    def names(
        self, literal: Callable[[Any], str], braces: Callable[[Any, Callable[[Any], str]], str]
    ) -> dict[str, str]:
        """What stands in the template of the low-pass."""
        one = self.low_pass
        if one is None:
            return {}
        steady = np.concatenate([one.steady(np.ones(1))[:, 0], [0.0]])
        return {
            "FILTER": f"{one.kind}, {one.numerator.size} coefficients",
            "CUTOFF": f"{one.cutoff_hz:.6g}",
            "RATE": f"{one.rate_hz:.9g}",
            "DELAY": f"{1e3 * one.delay_s:.4g}",
            "TAPS": str(one.numerator.size),
            "B": braces(one.numerator, literal),
            "A": braces(one.denominator, literal),
            "STEADY": braces(steady, literal),
        }

    def models(
        self, symbols: dict[str, str], literal: Callable[[Any], str], braces: Callable[[Any, Callable[[Any], str]], str]
    ) -> dict[str, str]:
        """What stands in the template of the bias: ``symbols`` are the C names of the units."""
        if not self.bias:
            return {}
        texts: list[str] = []
        parts = 0
        for unit, model in self.bias.items():
            keep, grown = transitions_by_axis(model, self.step_s, mean=True)
            tables = (keep[0], grown, first_covariances(model), model.white**2 / self.step_s)
            inner = ",\n    ".join(braces(table, literal) for table in tables)
            texts.append(f"static const tumbleline_bias_model tumbleline_bias_{symbols[unit]} = {{\n    {inner}\n}};\n")
            parts = keep.shape[-1]
        return {
            "STEP": f"{self.step_s:g}",
            "PARTS": str(parts),
            "PROCESSES": str(parts - 2),
            "MODELS": "\n".join(texts),
        }


def bias_models(run: Run, serials: Sequence[str], step_s: float, turn_on_ug: float | None) -> dict[str, BiasModel]:
    """The models of the bias that ``correct`` tracks with, by unit, from the noise of its static record.

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
        noise = terms_of_unit(fit_of_unit(run, serial, "export", failed=True, revoked=True))[0]
        flicker = steps_flicker(step_s, 0.0)
        models[serial] = bias_model(noise.white, noise.instability, noise.walk, turn_on_ug / MICRO, flicker)
    return models
