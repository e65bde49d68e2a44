"""Coefficients of units with their uncertainty, and what can be done with them."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from pipelines.archive import Archive, Run, files
from schemas.errors import DataRejected, WrongUse, did_you_mean
from schemas.units import AXES
from tumbleline.pictures import Picture, as_html, as_text, rounded_table
from tumbleline.recordings import Recording, Source, listed, read

K = 2.0  # coverage factor of U


@dataclass(frozen=True)
class Calibration:
    """A model that was fitted to a recording.

    run : the run of the archive that holds it
    """

    run: Run = field(repr=False)

    @property
    def effects(self) -> list[str]:
        """Ids of the effects of the model."""
        return list(self.run.about["recipe"]["effects"])

    @property
    def coefficients(self) -> pd.DataFrame:
        """One row per coefficient: ``unit, axis, effect, name, value, standard_error, U, unit_text``; U with k = 2."""
        table = self.run.table("coefficients")
        table = table.assign(U=K * table["standard_error"].astype(float))
        return table[["unit", "axis", "effect", "name", "value", "standard_error", "U", "unit_text"]]

    @property
    def residuals(self) -> pd.DataFrame:
        """One row per dwell and axis, in µg."""
        return self.run.table("residuals")

    @property
    def rms_ug(self) -> float:
        """Residual of the fit over all units and axes, µg."""
        return float(np.sqrt(np.nanmean(self.residuals["residual_ug"].to_numpy(dtype=float) ** 2)))

    @property
    def recording(self) -> Recording:
        """The dwells that were fitted."""
        return Recording(self.run)

    def correct(
        self,
        samples: pd.DataFrame | NDArray[np.float64],
        *,
        unit: str = "",
        temperature: float | NDArray[np.float64] | None = None,
        rate_hz: float | None = None,
    ) -> pd.DataFrame:
        """Specific force of raw samples, with its uncertainty by the calibration.

        Parameters
        ----------
        samples : (n, axes) in output unit, (axes,) of one sample, or a table with x, y, z (or out_x, …) and the quantities of the
            model, e.g. ``unit_C``; ``supply_V`` where the output follows the supply
        unit : serial number; needed where there are several
        temperature : °C, one or (n,); for an array of samples
        rate_hz : where the samples have no column ``time_s``; it only decides ``time_s``

        Returns
        -------
        pandas.DataFrame
            ``time_s``, ``force_x_g`` …, ``u_x_ug`` … (standard uncertainties) and covariances.
        """
        from inertial.errors import MissingInput
        from inertial.quantities import column_of
        from pipelines.export.corrected import corrected, fit_of_unit, table_of
        from pipelines.export.recording import at_calibrated_supply, recording_of
        from pipelines.jobs.model_files import use_formulas_of

        use_formulas_of(self.run)
        fit = fit_of_unit(self.run, str(unit), failed=True, revoked=False)
        axes = fit.exported.axes
        if isinstance(samples, pd.DataFrame):
            table = samples
        else:
            values = np.asarray(samples)
            values = values[:, None] if values.ndim == len(axes) == 1 else np.atleast_2d(values)
            names = [AXES[axis] for axis in axes]
            if values.ndim != 2 or values.shape[1] != len(names):
                raise WrongUse(
                    f"correct: samples of shape {np.shape(samples)}, (n, {len(names)}) with the outputs "
                    f"{', '.join(names)} is needed; turn or cut the array"
                )
            table = pd.DataFrame(values, columns=names)
        if temperature is not None:
            if np.shape(temperature) not in {(), (len(table),)}:
                raise WrongUse(
                    f"correct: temperature of shape {np.shape(temperature)} beside {len(table)} samples, a number or one "
                    "for each sample is needed"
                )
            table = table.assign(unit_C=np.broadcast_to(temperature, len(table)))
        if rate_hz is not None and not rate_hz > 0.0:
            raise WrongUse(f"correct: rate_hz={rate_hz:g}, more than 0 is needed; leave it out, or correct it")
        rate = 1.0 if rate_hz is None and "time_s" not in table else rate_hz
        recording = at_calibrated_supply(recording_of(table, "samples", rate_hz=rate, axes=axes, least=1), self.run)
        try:
            return table_of(recording, corrected(recording, fit, None))
        except MissingInput as lack:
            raise DataRejected(f"correct: no {column_of(lack.quantity)}, {lack.effect} needs it; add it") from None

    def export(self, form: str = "json", output: str | Path | None = None, **settings: Any) -> str | bytes:
        """The coefficients for firmware, autopilots and spreadsheets.

        Parameters
        ----------
        form : a format of ``tumbleline export``: json, csv, c, ardupilot, px4, …
        output : file to write; None: none is written
        settings : of :class:`pipelines.export.settings.ExportSettings`: ``nominal``, ``arithmetic``, ``rate_hz`` …

        Returns
        -------
        str or bytes
            The content of the file; bytes for a binary format.
        """
        from pipelines.export import FORMATS, ExportSettings, export_files, unit_calibrations

        if form not in FORMATS:
            raise WrongUse(f"export: no format is called '{form}'; {did_you_mean(form, FORMATS)}")
        if unknown := sorted(set(settings) - ExportSettings.__dataclass_fields__.keys()):
            raise WrongUse(
                f"export: {unknown[0]} is no setting; {did_you_mean(unknown[0], ExportSettings.__dataclass_fields__)}"
            )
        chosen = unit_calibrations(self.run, (), failed=True)
        made = export_files(form, chosen, self.run.id, ExportSettings(**settings))
        if len(made) > 1:
            raise WrongUse(
                f"export: {form} has a file for each of {len(made)} units; fit one unit, or use 'tumbleline export'"
            )
        content = next(iter(made.values()))
        if output is not None:
            files.publish(Path(output), content, "export", files.ELSEWHERE)
        try:
            return content.decode()
        except UnicodeDecodeError:
            return content

    def plot(self) -> Picture:
        """Residuals by dwell, of the first unit."""
        from pipelines.drawing.chart import SEVERAL, Chart, Plot, PlotAxis, Trace

        rows = self.residuals
        rows = rows[rows["unit"] == rows["unit"].iloc[0]]
        traces = tuple(
            Trace(
                str(axis),
                of_axis["dwell"].to_numpy(dtype=float),
                of_axis["residual_ug"].to_numpy(dtype=float),
                role=role,
            )
            for role, (axis, of_axis) in zip(SEVERAL, rows.groupby("axis", sort=True), strict=False)
        )
        title = f"Residuals of {rows['unit'].iloc[0]}"
        return Picture(Chart(title, (Plot(title, PlotAxis("dwell"), PlotAxis("residual / µg"), traces),)))

    def _lines(self) -> list[str]:
        from pipelines.tables.dwells import lacking

        about = f"{', '.join(self.effects)}; residual {self.rms_ug:.3g} µg rms; U with k = 2; run {self.run.id}"
        return [about, *filter(None, [lacking(self.recording.dwells)])]

    def _repr_html_(self) -> str:
        return as_html("Calibration", self._lines(), rounded_table(self.coefficients))

    def __str__(self) -> str:
        return as_text("Calibration", self._lines(), rounded_table(self.coefficients))


def fit(
    recording: Recording | Source | Sequence[str | Path],
    effects: Sequence[str] | str | None = None,
    *,
    leave_out: Sequence[str] = (),
) -> Calibration:
    """Coefficients of a model by generalised least squares with the noise that the dwells show, as ``tumbleline fit``.

    Parameters
    ----------
    recording : from :func:`tumbleline.read`, or what it reads
    effects : ids of :func:`tumbleline.effects`; None: those of the run; of a recording bias, scale, misalignment, and terms in
        the temperature where it varies
    leave_out : dwells as ``UNIT:DWELL``

    Raises
    ------
    DataRejected
        The dwells do not determine the model.
    """
    from pipelines.jobs.model_change import change_from_options
    from pipelines.rerun.rerun import again
    from pipelines.tables.leave_out import named_dwells

    given = recording if isinstance(recording, Recording) else read(recording)
    archive = Archive(given.run.archive.root)
    change = change_from_options(",".join(listed(effects, "fit") or ()), where="fit")
    done = again(archive, given.run.id, change, left_out=named_dwells(",".join(leave_out)))
    return Calibration(archive.run(done.new))
