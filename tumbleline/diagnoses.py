"""Whether a model is adequate, where it fails, and which physical effect is missing."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from schemas.errors import WrongUse
from tumbleline.calibrations import Calibration
from tumbleline.pictures import Picture, as_html, as_text
from tumbleline.recordings import Recording, Source, listed, read

if TYPE_CHECKING:
    from pipelines.diagnosis.diagnose import Examination
    from pipelines.diagnosis.documents import DiagnosisDocument
    from pipelines.improvement.documents import ImproveDocument

_FIGURES = ("size_ug", "p_value", "rms_after_ug", "heldout_after_ug")


@dataclass(frozen=True)
class JudgedModel:
    """A model that was judged.

    document : with the keys of ``--json`` of the command of the same name
    """

    document: "DiagnosisDocument | ImproveDocument" = field(repr=False)

    @property
    def adequate(self) -> bool | None:
        """Whether nothing but noise is left by the model; None where these data cannot tell."""
        return self.document["adequate"]

    @property
    def effects(self) -> list[str]:
        """The effects of the model."""
        return list(self.document["effects"])


@dataclass(frozen=True)
class ModelDiagnosis(JudgedModel):
    """The diagnosis of a model."""

    document: "DiagnosisDocument" = field(repr=False)
    source: str = ""
    _made: "Examination | None" = field(default=None, repr=False)

    @property
    def verdict(self) -> str:
        """The verdict in one sentence with its numbers."""
        from pipelines.diagnosis.sentences import verdict

        return verdict(self.document)

    @property
    def missing(self) -> pd.DataFrame:
        """One row per class of effects that these data cannot separate: what is missing, the proposed effect first.

        ``size_ug``: of the effect; ``p_value``: of noise alone; ``rms_after_ug``, ``heldout_after_ug``: residual with it, of the
        dwells that are fitted and of dwells left out.
        """
        from pipelines.diagnosis.sections import parameters_of

        rows = [
            {
                "effect": next(
                    (name for name in self.document["recommended"] if name in group["effects"]), group["effects"][0]
                ),
                "class": ", ".join(group["effects"]),
                "scope": group["scope"],
                **{key: group[key] for key in _FIGURES},
                "parameters": group.get("evidence") or parameters_of(group),
            }
            for group in self.document["classes"]
        ]
        return pd.DataFrame(rows, columns=["effect", "class", "scope", *_FIGURES, "parameters"])

    @property
    def next_measurements(self) -> pd.DataFrame:
        """What to measure next, to separate what these data do not."""
        return pd.DataFrame(self.document["next_measurements"])

    def plot(self) -> Picture:
        """Residuals against the recorded quantities that they follow, before and after what was found.

        Raises
        ------
        WrongUse
            No unit could be judged, or no recorded quantity varies.
        """
        from pipelines.report.diagnosis_pictures import driver_chart
        from pipelines.report.residuals import drivers_shown, lot_residuals

        made = self._made
        drivers = [] if made is None or made.diagnosis is None else drivers_shown(made.diagnosis)
        if made is None or made.diagnosis is None or not drivers:
            raise WrongUse("plot: no residual to be shown against a recorded quantity; see .document")
        left = lot_residuals(made.diagnosis, made.sound)
        return Picture(driver_chart(left, drivers, made.diagnosis.problem.lot.state.temperature))

    def report(self, path: str | Path) -> Path:
        """Write the diagnosis with its pictures as one HTML file."""
        from pipelines.archive import files
        from pipelines.report.diagnosis import render_diagnosis

        if self._made is None:
            raise WrongUse("report: this diagnosis was kept as a document alone; diagnose the recording again")
        text = render_diagnosis(self._made, self.source)
        files.publish(Path(path), text.encode(), "report", files.ELSEWHERE)
        return Path(path)

    def _repr_html_(self) -> str:
        try:
            picture = self.plot()
        except WrongUse:
            picture = None
        return as_html("Diagnosis", [self.verdict], self.missing, picture=picture)

    def __str__(self) -> str:
        return as_text("Diagnosis", [self.verdict], self.missing)


def diagnose(
    recording: Recording | Source | Sequence[str | Path],
    model: Calibration | Sequence[str] | str | None = None,
    *,
    leave_out: Sequence[str] = (),
) -> ModelDiagnosis:
    """Whether a model is adequate for a recording, where it fails, and which effect is missing, as ``tumbleline diagnose``.

    Parameters
    ----------
    recording : from :func:`tumbleline.read`, or what it reads
    model : a fit, or ids of effects; None: that of the run, or the default model where it has none
    leave_out : dwells as ``UNIT:DWELL``
    """
    from pipelines.diagnosis.diagnose import examination
    from pipelines.tables.leave_out import leave_out as without
    from pipelines.tables.leave_out import named_dwells

    given = recording if isinstance(recording, Recording) else read(recording)
    of_fit = isinstance(model, Calibration)
    judged = listed(None if of_fit else model, "diagnose", model.run if of_fit else given.run)
    named = named_dwells(",".join(leave_out))
    dwells = without(given.dwells, named) if named else given.dwells
    made = examination(dwells, given.history, judged, [f"{unit}:{dwell}" for unit, dwell in named])
    return ModelDiagnosis(made.document, given.run.id, made)


def effects() -> pd.DataFrame:
    """One row per effect: id, symbol, equation, scope (sensor or station), and what to measure so that it shows."""
    from inertial.effects import catalogue

    columns = ("symbol", "equation", "scope", "breaker")
    rows = [
        {"id": name, **{column: getattr(effect, column) for column in columns}} for name, effect in catalogue().items()
    ]
    return pd.DataFrame(rows)
