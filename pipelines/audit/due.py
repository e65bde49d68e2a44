"""Units that are due for re-calibration, and when: the state of their certificates in the ledger, and the rules."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from inertial.arrays import Array, Flags, Index, Texts
from pipelines.archive.store import Place
from pipelines.audit.calibrations import Calibrations, date_of, day_of
from pipelines.audit.drifts import MONTH_D, KindDrift
from pipelines.audit.pairs import last_of_each
from pipelines.audit.rules import Rules
from pipelines.audit.unit_drifts import UnitDrift
from pipelines.certificates.ledger_index import histories_of
from pipelines.certificates.validity import Calibration, calibrations_of


class CertificateState(NamedTuple):
    """The state of a unit in the ledger on a day.

    certificate : the valid certificate, else the last, even if it ended; state : its state on that day: ``valid``,
        ``ended``, ``revoked`` or ``later`` (it begins later)
    until : day since 1970 with which it ends or ended
    entered : whether the last measurement is certified, in any state
    """

    certificate: str
    state: str
    until: float
    entered: bool


@dataclass(frozen=True)
class Certificates:
    """The ledger at the end of a day.

    of : calibrations by kind of device and serial, in the order of certification
    captures : of runs; a re-run of a capture certifies the same measurement
    problems : units with a fault in the ledger, by their folder
    """

    day: str
    of: Mapping[tuple[str, str], Sequence[Calibration]]
    captures: Mapping[str, str]
    problems: Mapping[str, str]

    def __len__(self) -> int:
        return sum(len(calibrations) for calibrations in self.of.values())

    def standing(self, device: str, serial: str, run: str) -> CertificateState | None:
        """The state of a unit; None for a unit that was never certified.

        Parameters
        ----------
        run : the last run of the unit
        """
        known = self.of.get((device, serial), ())
        if not known:
            return None
        entered = any(self._measured(calibration.run) == self._measured(run) for calibration in known)
        held, last = self._deciding(known)
        if held is None and last.state == "revoked":
            return CertificateState(last.certificate, "revoked", _end(last), entered)
        state = "valid" if held else "later" if last.start > self.day else "ended"
        return CertificateState(last.certificate, state, day_of(last.until), entered)

    def _deciding(self, known: Sequence[Calibration]) -> tuple[Calibration | None, Calibration]:
        """The calibration that is due first: of a subject without a valid one the last, else the valid one that ends first."""
        subjects = dict.fromkeys(subject for entry in known for subject in entry.event.covers.split())
        groups = ([entry for entry in known if subject in entry.event.covers.split()] for subject in subjects)
        pairs = [
            (held := next((entry for entry in group if entry.holds(self.day)), None), held or group[-1])
            for group in groups
        ]
        return next((pair for pair in pairs if pair[0] is None), min(pairs, key=lambda pair: pair[1].until))

    def _measured(self, run: str) -> str:
        """The capture of a run, or the run itself where it has none."""
        return self.captures.get(run) or run


def certificates_of(root: Place, until: float, captures: Mapping[str, str]) -> Certificates:
    """The ledger of an archive.

    Parameters
    ----------
    until : end of the last day whose events count
    captures : of runs, by their names
    """
    day = date_of(until - 1.0)
    histories = histories_of(root)
    by_unit: dict[tuple[str, str], list[Calibration]] = {}
    for events in histories.units:
        for calibration in calibrations_of(event for event in events if event.when[:10] <= day):
            by_unit.setdefault((calibration.event.device.upper(), calibration.serial), []).append(calibration)
    return Certificates(day, by_unit, captures, histories.problems)


def _end(revoked: Calibration) -> float:
    """Day on which a revoked calibration ended; for one revoked from its first day the day of the revocation."""
    if revoked.until > revoked.start or revoked.ended_by is None:
        return day_of(revoked.until)
    return day_of(revoked.ended_by.when[:10])


@dataclass(frozen=True)
class Due:
    """The last calibrations of the units, in order of unit: row among the calibrations, day when each is due, and the reason.

    months : the interval of the rules
    because : ``fixed`` or ``drift`` (the interval after the last pass), ``certificate`` (it ends, or has ended), ``revoked``, or
        ``did not pass``
    certificate : the certificate valid on the day of the audit, else the last; empty without a certificate
    valid : whether a certificate is valid; entered : whether the last measurement is certified, in any state
    """

    row: Index
    day: Array
    months: Array
    because: Texts
    certificate: Texts
    valid: Flags
    entered: Flags


def due(
    calibrations: Calibrations,
    good: Flags,
    rules: Rules,
    kinds: list[KindDrift],
    units: Mapping[str, list[UnitDrift]],
    certificates: Certificates | None = None,
) -> Due:
    """Day when every unit is due: the end of its certificate; at once where it was revoked or the unit did not pass.

    Without a certificate for its last measurement a unit is due after the fixed interval of its kind. With the rule ``drift``
    it is due when its probability of being in tolerance falls to the target (by the forecast of the unit if it has a history,
    else of its kind, inside the bounds of the rules), unless its certificate ends before.
    """
    rows = np.flatnonzero(good)
    last = rows[last_of_each(calibrations.histories[rows])]
    fixed = {device: float(rules.months(device)) for device in np.unique(calibrations.device.astype(str))}
    months = np.array([fixed[str(device)] for device in calibrations.device[last]])
    because = np.full(last.size, "fixed", dtype=object)
    if rules.interval == "drift":
        _by_drift(calibrations, last, (months, because), rules, kinds, units)
    day, no_certificate = _months_after(calibrations.day[last], months), np.full(last.size, "", dtype=object)
    due_units = Due(last, day, months, because, no_certificate, *np.zeros((2, last.size), dtype=bool))
    if certificates is not None:
        _by_certificate(calibrations, due_units, certificates)
    # imported results have no decision; they count
    failed = (calibrations.outcome[last] != "pass") & (calibrations.outcome[last] != "")
    due_units.day[failed], due_units.because[failed] = calibrations.day[last][failed], "did not pass"
    return due_units


def last_measured(calibrations: Calibrations, due_units: Due, station: str) -> Due:
    """The units whose last measurement was on a station; all without a station. Earlier measurements count as history."""
    if not station:
        return due_units
    on_station = calibrations.station[due_units.row] == station
    return Due(*(getattr(due_units, name)[on_station] for name in Due.__dataclass_fields__))


def uncertified(calibrations: Calibrations, due_units: Due, certificates: Certificates) -> Index:
    """Units that passed last without a certificate for it, as indices into ``due``; none without a ledger."""
    if not len(certificates):
        return np.zeros(0, dtype=np.int64)
    return np.flatnonzero((calibrations.outcome[due_units.row] == "pass") & ~due_units.entered)


def _by_certificate(calibrations: Calibrations, due_units: Due, certificates: Certificates) -> None:
    """Replace the interval of every unit by the state of its certificate."""
    for k, row in enumerate(due_units.row):
        names = (str(column[row]) for column in (calibrations.device, calibrations.unit, calibrations.run))
        standing = certificates.standing(*names)
        if standing is None:
            continue
        due_units.certificate[k], due_units.entered[k] = standing.certificate, standing.entered
        due_units.valid[k] = standing.state == "valid"
        # measured again after its end: the interval counts from the measurement
        if not due_units.valid[k] and not standing.entered:
            continue
        if due_units.because[k] == "drift" and standing.state != "revoked" and due_units.day[k] < standing.until:
            continue
        due_units.day[k] = standing.until
        due_units.because[k] = "revoked" if standing.state == "revoked" else "certificate"


def _by_drift(
    calibrations: Calibrations,
    last: Index,
    interval: tuple[Array, Texts],
    rules: Rules,
    kinds: list[KindDrift],
    units: Mapping[str, list[UnitDrift]],
) -> None:
    """Replace months and reason of every unit by those of its forecast, where there is one."""
    months, because = interval
    of_kind: dict[str, float] = {}
    for kind in kinds:
        if np.isfinite(kind.reliable_months):
            of_kind[kind.device] = min(of_kind.get(kind.device, np.inf), kind.reliable_months)
    for k, row in enumerate(last):
        device = str(calibrations.device[row])
        forecasts = [(d.reliable_day - d.day) / MONTH_D for d in units.get(f"{device} {calibrations.unit[row]}", ())]
        reliable = min(forecasts, default=of_kind.get(device, np.nan))
        if np.isfinite(reliable):
            months[k] = np.clip(np.floor(reliable), rules.shortest_months, rules.longest_months)
            because[k] = "drift"


def _months_after(day: Array, months: Array) -> Array:
    """The same day of the month some months later, or the last day of a shorter month; days since 1970."""
    date = np.floor(day).astype("datetime64[D]")
    month = date.astype("datetime64[M]")
    of_month = (date - month.astype("datetime64[D]")).astype(int)
    target = month + months.astype(int).astype("timedelta64[M]")
    length = ((target + np.timedelta64(1, "M")).astype("datetime64[D]") - target.astype("datetime64[D]")).astype(int)
    return (target.astype("datetime64[D]") + np.minimum(of_month, length - 1).astype("timedelta64[D]")).astype(float)
