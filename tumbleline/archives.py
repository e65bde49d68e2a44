"""An archive as tables: its runs, their tables, SQL over all of them, and the calibration of a unit on a date."""

from dataclasses import asdict, dataclass, field
from datetime import date
from pathlib import Path

import pandas as pd

from pipelines.archive import Archive
from schemas.errors import WrongUse, did_you_mean
from tumbleline.calibrations import Calibration, K
from tumbleline.pictures import Picture
from tumbleline.recordings import Recording

_OF_ALL_RUNS = "SELECT r.measured, c.* FROM coefficients c JOIN runs r USING (run) ORDER BY r.measured, c.run"


@dataclass(frozen=True)
class ArchiveView:
    """An archive that is read."""

    store: Archive = field(repr=False)

    @property
    def runs(self) -> pd.DataFrame:
        """One row per run, oldest first."""
        return pd.DataFrame([asdict(info) for info in self.store.runs()])

    def read(self, run: str = "latest") -> Recording:
        """The dwells of a run, by its name, the beginning of it, or ``latest``."""
        return Recording(self.store.run(run))

    def calibration(self, run: str = "latest") -> Calibration:
        """The coefficients of a run."""
        return Calibration(self.store.run(run))

    def table(self, name: str, run: str = "latest") -> pd.DataFrame:
        """A table of a run: ``figures``, ``grades``, ``residuals``, ``noise``, and others."""
        return self.store.run(run).table(name)

    def coefficients(self, unit: str = "", *, at: str | date = "", known: str | date = "") -> pd.DataFrame:
        """Coefficients of a unit's certified calibration that is valid on a day; without a day those of every run, oldest first.

        Parameters
        ----------
        unit : serial number; empty: of all units, without a day only
        at : day as ``YYYY-MM-DD`` or date · known : as the archive was on this day

        Raises
        ------
        WrongUse
            No run has the unit, no calibration of it is valid on that day, or a day is given without a unit.
        """
        if not at:
            rows = self.query(_OF_ALL_RUNS)
            rows = rows.assign(U=K * rows["standard_error"].astype(float))
            if unit and not (rows["unit"] == unit).any():
                raise WrongUse(f"coefficients: no run has any of unit {unit}; {did_you_mean(unit, rows['unit'])}")
            return rows[rows["unit"] == unit].reset_index(drop=True) if unit else rows
        if not unit:
            raise WrongUse("coefficients: a day is given and no unit, both are needed; give unit='…'")
        from pipelines.certificates import Ledger
        from pipelines.certificates.coefficient_remarks import coefficients_of
        from pipelines.certificates.days import day_of

        day = day_of(str(at), "at")
        history = Ledger(self.store).calibrations(unit, day_of(str(known), "known") if known else "")
        valid = next((calibration for calibration in history if calibration.holds(day)), None)
        if valid is None:
            there = "; ".join(
                f"{calibration.certificate} from {calibration.start} until {calibration.until}, {calibration.state}"
                for calibration in history
            )
            raise WrongUse(f"coefficients: no calibration of unit {unit} is valid on {day} ({there or 'it has none'})")
        rows = pd.DataFrame(coefficients_of(self.store.run(valid.run), valid))
        return rows.assign(U=K * rows["standard_error"].astype(float), certificate=valid.certificate, run=valid.run)

    def discoveries(self, device: str = "") -> pd.DataFrame:
        """What the lots of the archive show together, one row per discovery: as ``tumbleline discover`` of the same archive.

        What no effect of the catalogue is like has no effects and no size.

        Parameters
        ----------
        device : kind of device; that of most runs if empty
        """
        from pipelines.discovery.discover import Look, discovered

        document = discovered(self.store, Look(device=device)).document
        rows = [*document["discoveries"], *document["unexplained"]]
        columns = ["id", "since", "recommended", "driver", "size_ug", "size_floors", "log_e", "scope", "confirmed",
                   "effects", "drivers"]  # fmt: skip
        return pd.DataFrame([{name: row.get(name) for name in columns} for row in rows], columns=columns)

    def plot(self, unit: str, effect: str = "bias") -> Picture:
        """Change of a unit's coefficients of an effect since they were measured first, with U (k = 2) as bars, by day."""
        from pipelines.drawing.chart import SEVERAL, Chart, Plot, PlotAxis, Trace

        rows = self.coefficients(unit)
        rows = rows[rows["effect"] == effect]
        if not len(rows):
            raise WrongUse(f"plot: no run has coefficients of {effect} of unit {unit}; see .coefficients()")
        days = (
            pd.to_datetime(rows["measured"], utc=True, format="ISO8601").dt.tz_localize(None).to_numpy("datetime64[s]")
        )
        rows = rows.assign(day=days.astype(float) / 86400.0)
        traces = tuple(
            Trace(f"{axis} {name}", of_term["day"].to_numpy(dtype=float),
                  (of_term["value"] - of_term["value"].iloc[0]).to_numpy(dtype=float),
                  role=role, error=of_term["U"].to_numpy(dtype=float))
            for role, ((axis, name), of_term) in zip(SEVERAL, rows.groupby(["axis", "name"]), strict=False)
        )  # fmt: skip
        title, value = f"{effect} of {unit}", f"change since the first / {rows['unit_text'].iloc[0]}"
        return Picture(Chart(title, (Plot(title, PlotAxis("measured", dates=True), PlotAxis(value), traces),)))

    def query(self, sql: str) -> pd.DataFrame:
        """The answer to one SELECT over all runs; the views are those of ``tumbleline archive query``."""
        from pipelines.audit.sql import ask

        answer = ask(self.store, sql)
        return pd.DataFrame(answer.rows, columns=list(answer.columns))

    def _repr_html_(self) -> str:
        return self.runs.to_html(index=False, border=0)


def archive(folder: str | Path | None = None) -> ArchiveView:
    """An archive; the folder of TUMBLELINE_ARCHIVE, else ``./archive``, by default.

    Raises
    ------
    ArchiveUnusable
        The folder holds no archive.
    """
    store = Archive(None if folder is None else str(folder))
    store.refuse_none()
    return ArchiveView(store)
