"""Diagnosis and comparison of a table of dwells against a model, as documents with the keys that other programs read."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from inertial import effects as catalogue
from inertial.criticism.diagnosis import Diagnosis
from inertial.criticism.diagnosis import diagnose as diagnose_lot
from inertial.data_errors.faults import Fault
from inertial.errors import InertialError
from inertial.planning.reasons import reason
from pipelines.diagnosis import result_rows
from pipelines.diagnosis.compare import without_history
from pipelines.diagnosis.documents import BlockingFault, DiagnosisDocument
from pipelines.diagnosis.next_measurement import Proposed, proposed
from pipelines.diagnosis.suggested_formula import offer, what_follows
from pipelines.parallel import keep_memory
from pipelines.tables.condense import reduction
from pipelines.tables.dwells import Measured, shows_misalignment, undetermined_responses
from pipelines.tables.sound_lot import error_of, every_unit_faulty, gaps, generator, probability, sound_lot, told
from schemas.errors import DataRejected

DEFAULT = ("bias", "scale", "misalignment")
THERMAL = ("bias_temperature", "scale_temperature")
_WARM = 5.0
_SAME_G, _SAME_DEG = 0.02, 1.0


def default_model(dwells: pd.DataFrame) -> list[str]:
    """Ids of the model that is judged by default: with temperature terms if the temperature varies by more than 5 °C.

    Dwells in one pose determine a bias and its drivers, but neither scale nor misalignment.
    """
    if _one_pose(dwells):
        return ["bias", *(THERMAL[:1] if "bias_temperature" in _of_temperature(dwells) else ())]
    model = _of_temperature(dwells)
    return model if shows_misalignment(dwells) else [name for name in model if name != "misalignment"]


def _one_pose(dwells: pd.DataFrame) -> bool:
    """Whether the reference force, or the pair of table angles, is the same in all dwells."""
    for columns, least in ((("force_x", "force_y", "force_z"), _SAME_G), (("outer_deg", "inner_deg"), _SAME_DEG)):
        if all(name in dwells.columns and dwells[name].notna().all() for name in columns):
            return all(float(np.ptp(dwells[name])) < least for name in columns)
    return False


def _of_temperature(dwells: pd.DataFrame) -> list[str]:
    """The default model for several poses, with temperature terms if the temperature varies enough."""
    for column in ("unit_C", "chamber_C"):
        if column in dwells.columns and dwells[column].notna().any():
            return [*DEFAULT, *THERMAL] if float(np.ptp(dwells[column].dropna())) > _WARM else list(DEFAULT)
    return list(DEFAULT)


def diagnose(
    dwells: pd.DataFrame, history: pd.DataFrame | None = None, effects: Sequence[str] | None = None
) -> DiagnosisDocument:
    """The diagnosis of a lot as a JSON document.

    Parameters
    ----------
    dwells : table in the exchange format
    history : temperatures against time, for lag and hysteresis; None if not recorded
    effects : ids of the model to judge; :func:`default_model` if None

    Raises
    ------
    DataRejected
        Nothing is left to diagnose, or the dwells lack a quantity of the model.
    """
    return examination(dwells, history, effects).document


def examined(
    dwells: pd.DataFrame,
    history: pd.DataFrame | None,
    effects: Sequence[str] | None,
    left_out: Collection[str] = (),
) -> tuple[Measured, list[Fault], Diagnosis | None]:
    """Readings, data faults, and the diagnosis of the units without a fault (None if every unit has one).

    Parameters
    ----------
    left_out : ``UNIT:DWELL`` of dwells removed from ``dwells`` on purpose: their absence is not a fault
    """
    model = list(effects) if effects else default_model(dwells)
    catalogue.get_all(model)
    measurement, faults, lot = sound_lot(dwells, history, model, left_out)
    if lot is None:
        return measurement, faults, None
    try:
        # threads on small matrices wait for each other: on a busy machine two of them take sixty times as long as one
        with threadpool_limits(1):
            return measurement, faults, diagnose_lot(lot, model, generator())
    except InertialError as problem:
        raise DataRejected(str(problem)) from None


def document(
    measurement: Measured,
    faults: list[Fault],
    diagnosis: Diagnosis | None,
    effects: Sequence[str],
    following: Proposed | None = None,
    left_out: Collection[str] = (),
) -> DiagnosisDocument:
    """The document of a diagnosis; if every unit has a data fault, no effect is judged.

    Parameters
    ----------
    effects : ids of the judged model
    following : the next measurements; None: those for a station with the capabilities that the run implies
    left_out : ``UNIT:DWELL`` of dwells removed on purpose, without a notice that they are missing
    """
    blocked = [_fault(measurement, f) for f in faults]
    if diagnosis is None:
        return {
            "adequate": None,
            "reason": every_unit_faulty(faults),
            "blocked_by": blocked,
            "evidence": None,
            "leave_out": None,
            "error": {"rms_ug": None, "floor_ug": None, "p_value": None},
            "where": [],
            "classes": [],
            "influence": [],
            "without_influence": None,
            "removed": None,
            "recommended": [],
            "unexplained": None,
            "suspected": None,
            "unseen": [],
            "unseen_in_part": [],
            "smallest_named": [],
            "next_measurements": [],
            "warnings": [],
            "effects": list(effects),
            "units": list(measurement.units),
            "breakers": {},
            "reasons": {},
            "offer": None,
        }
    faulty = {f.unit for f in faults}
    units = tuple(u for k, u in enumerate(measurement.units) if k not in faulty)
    names = result_rows.Names(units, tuple(int(d) for d in measurement.dwells))
    terms = [*diagnosis.base.terms, *(m.term for n in diagnosis.named for m in n.effects.physics)]
    warnings = [
        *undetermined_responses(measurement.state),
        *gaps(measurement, faults, left_out),
        *without_history(measurement, terms),
        *result_rows.noise_along(diagnosis.run),
        *result_rows.noise_of_the_lot(diagnosis.final, len(units)),
        *result_rows.less_than_samples(diagnosis.final),
    ]
    error = error_of(diagnosis.rms, diagnosis.floor, diagnosis.log_p)
    adequate, why, error = told(diagnosis.base, diagnosis.adequate, diagnosis.unjudged, error)
    return {
        "adequate": adequate,
        "reason": why or None,
        "blocked_by": blocked,
        "evidence": result_rows.evidence_of(diagnosis, names),
        "error": {
            "rms_ug": error["rms_ug"],
            "floor_ug": error["floor_ug"],
            "p_value": error["p_value"],
            "white_noise_ug": result_rows.white_noise_of(diagnosis.base),
            **result_rows.noise_of(diagnosis.final),
        },
        "where": [
            {"driver": p.driver, "axes": list(p.axes), "share": round(p.share, 4), "p_value": probability(p.log_p)}
            for p in diagnosis.where
        ],
        "classes": result_rows.classes_of(diagnosis, names),
        "influence": result_rows.influence_of(diagnosis, names),
        "without_influence": result_rows.without_influence(diagnosis.carried),
        "removed": result_rows.removed_of(diagnosis, names),
        "recommended": [n.effects.proposed.effect.id for n in diagnosis.named if not n.effects.of_data and n.predicts],
        "leave_out": result_rows.leave_out_of(diagnosis, names),
        "warnings": warnings,
        "unexplained": None
        if diagnosis.unexplained is None
        else {
            "driver": diagnosis.unexplained.driver,
            "shape": diagnosis.unexplained.shape,
            "part": diagnosis.unexplained.part,
            "text": what_follows(diagnosis.unexplained),
            "period_s": diagnosis.unexplained.period,
            "p_value": probability(diagnosis.unexplained.log_p),
        },
        "suspected": result_rows.suspected_of(diagnosis),
        "unseen": list(diagnosis.unseen),
        "unseen_in_part": result_rows.in_part_of(diagnosis),
        "smallest_named": result_rows.smallest_of(diagnosis),
        "next_measurements": (proposed(diagnosis) if following is None else following).rows(),
        "effects": list(effects),
        "units": list(measurement.units),
        "breakers": {name: catalogue.get(name).breaker for name in diagnosis.unseen},
        "reasons": {name: reason(diagnosis.problem.lot.state, name, effects) for name in diagnosis.unseen},
        "offer": None if diagnosis.unexplained is None else offer(diagnosis.unexplained, diagnosis.problem.lot.state),
    }


def _fault(measurement: Measured, fault: Fault) -> BlockingFault:
    return {
        "fault": fault.name,
        "units": [measurement.units[fault.unit]],
        "dwells": [int(measurement.dwells[k]) for k in fault.dwells],
        "evidence": fault.evidence,
    }


@dataclass(frozen=True)
class Examination:
    """A diagnosis of dwells.

    document : the JSON document
    measured, diagnosis : the readings, and their diagnosis, None if every unit has a data fault
    """

    document: DiagnosisDocument
    measured: Measured
    diagnosis: Diagnosis | None

    @property
    def sound(self) -> tuple[str, ...]:
        """The units without a data fault, in the order of the diagnosis."""
        faulty = {unit for fault in self.document["blocked_by"] for unit in fault["units"]}
        return tuple(unit for unit in self.measured.units if unit not in faulty)


def examination(
    table: pd.DataFrame,
    history: pd.DataFrame | None,
    judged: Sequence[str] | None,
    left_out: Collection[str] = (),
) -> Examination:
    """The diagnosis of dwells against a model, on one thread, because the matrices are small.

    Parameters
    ----------
    judged : ids of the model; the default model if None
    left_out : ``UNIT:DWELL`` of dwells removed from ``table`` on purpose
    """
    effects = list(judged) if judged else default_model(table)
    keep_memory()
    with threadpool_limits(1):
        measurement, faults, diagnosis = examined(table, history, effects, left_out)
        content = document(measurement, faults, diagnosis, effects, left_out=left_out)
        content["warnings"] += reduction(table)
    return Examination(content, measurement, diagnosis)
