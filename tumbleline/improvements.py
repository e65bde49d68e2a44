"""The loop: diagnose a model, add what is missing, and judge the change on what was left out or on a fresh run."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from getpass import getuser
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from pipelines.improvement.documents import ImproveDocument
from pipelines.improvement.improvement import Attendant, ImprovedTables, Improvement
from tumbleline.calibrations import Calibration, fit
from tumbleline.diagnoses import JudgedModel, ModelDiagnosis
from tumbleline.pictures import as_html, as_text
from tumbleline.recordings import Recording, Source, listed, read, session_folder


@dataclass(frozen=True)
class ImprovedModel(JudgedModel):
    """A model with what was missing in it.

    calibration : the fit of the resulting model
    """

    document: ImproveDocument = field(repr=False)
    calibration: Calibration = field(repr=False)

    @property
    def added(self) -> list[str]:
        """Effects that were added."""
        return list(self.document["added"])

    @property
    def undecided(self) -> list[list[str]]:
        """Classes of effects that these data do not separate: none was added; name one with ``effect=``."""
        open_ = [choice for choice in self.document["choices"] if choice["decided_by"] == "undecided"]
        return [[choice["effect"], *choice["not_separated_from"]] for choice in open_]

    @property
    def ladder(self) -> pd.DataFrame:
        """The errors of each version of the model, µg, and whether data that were not fitted confirm the change."""
        columns = ["version", "added", "fitted_ug", "heldout_ug", "fresh_ug", "noise_ug", "confirmed", "text"]
        rows = pd.DataFrame(self.document["ladder"], columns=columns)
        return rows.assign(added=[", ".join(names) for names in rows["added"]])

    @property
    def before(self) -> ModelDiagnosis:
        """The diagnosis of the model to begin with."""
        return ModelDiagnosis(self.document["diagnosis"])

    @property
    def after(self) -> ModelDiagnosis:
        """The diagnosis of the resulting model."""
        return ModelDiagnosis(self.document["after"] or self.document["diagnosis"])

    def correct(self, samples: pd.DataFrame | NDArray[np.float64], **options: Any) -> pd.DataFrame:
        """Specific force of raw samples: :meth:`Calibration.correct` of the resulting model."""
        return self.calibration.correct(samples, **options)

    def export(self, form: str = "json", output: str | Path | None = None, **settings: Any) -> str | bytes:
        """The coefficients in a format: :meth:`Calibration.export` of the resulting model."""
        return self.calibration.export(form, output, **settings)

    def _lines(self) -> list[str]:
        said = f"added: {', '.join(self.added)}" if self.added else "nothing was added"
        open_ = [f"not separated by these data: {', '.join(names)}; name one with effect=" for names in self.undecided]
        return [self.before.verdict, said, *open_, self.after.verdict]

    def _repr_html_(self) -> str:
        return as_html("Improved model", self._lines(), self.ladder.drop(columns="confirmed"))

    def __str__(self) -> str:
        return as_text("Improved model", self._lines(), self.ladder.drop(columns="confirmed"))


def improve(
    recording: Recording | Source | Sequence[str | Path],
    effects: Sequence[str] | str | None = None,
    *,
    effect: Sequence[str] | str = (),
    fresh: Recording | Source | Sequence[str | Path] | None = None,
    model_file: str | Path | None = None,
) -> ImprovedModel:
    """Diagnose a model, add the effects that are missing, and judge the change, as ``tumbleline improve``.

    Parameters
    ----------
    recording : from :func:`tumbleline.read`, or what it reads
    effects : the model to begin with; None: that of the run, or the default model where it has none
    effect : effects to add, one per class of the diagnosis; none: each that is alone in its class
    fresh : the same units measured again; it judges the change
    model_file : file to write, with the history of the model; None: no file is written
    """
    given = recording if isinstance(recording, Recording) else read(recording)
    again = None if fresh is None else fresh if isinstance(fresh, Recording) else read(fresh)
    tables = ImprovedTables(
        given.dwells, given.history, None if again is None else again.dwells, None if again is None else again.history
    )
    target = session_folder() / f"model-{given.run.id}.toml" if model_file is None else Path(model_file)
    if model_file is None:
        target.unlink(missing_ok=True)
    elif target.exists():
        from schemas.errors import WrongUse

        raise WrongUse(
            f"improve: {target} exists; name another model_file, or extend it with 'tumbleline improve --model'"
        )
    fresh_name = "" if again is None else again.run.id
    loop = Improvement(given.run.id, tables, None, target, "", getuser(), fresh_name, Attendant())
    named = [effect] if isinstance(effect, str) and effect else list(effect)
    document = loop.run(listed(effects, "improve", given.run), named, yes=not named)
    return ImprovedModel(document, fit(given, document["effects"]))
