"""The prior of a job: the family of its devices, from the calibrations of an archive."""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from datetime import UTC, datetime
from itertools import pairwise
from typing import Any

import numpy as np

from inertial.arrays import Array, Index
from inertial.errors import NotIdentified
from inertial.fits.prior import combined
from inertial.population.family import PAIRS, Family, change_of, family_of
from inertial.population.groups import groups_of
from pipelines.archive import Archive, Run
from pipelines.archive.attributes import known_attributes
from pipelines.tables.calibration import read_calibration
from schemas.bounds import DAY_S
from schemas.errors import RecipeInvalid, did_you_mean
from schemas.prior import StoredFamily
from schemas.recipe import Recipe

READ = ("coefficients", "covariance")


@dataclass(frozen=True)
class _Calibrated:
    """One calibration of one unit: number of its run, when, value of the attribute, coefficients with their covariance."""

    run: int
    day: float
    group: str
    values: Array
    covariance: Array


class _Archived:
    """The calibrations of a kind of device by one model, without a prior, by unit in order of time."""

    def __init__(self, recipe: Recipe, archive: Archive, since: str, kind: str) -> None:
        self.device = recipe.device
        self.attribute = "" if recipe.prior is None else recipe.prior.attribute
        self.attributes = known_attributes(archive)
        self.groups: dict[str, str] = {}
        self.runs: list[str] = []
        self.effects: list[str] = []
        self.units: dict[str, list[_Calibrated]] = {}
        for info in sorted(archive.runs(), key=lambda info: (info.started, info.id)):
            other = info.device.lower() != recipe.device.lower() or info.rerun_of or info.started < since
            if other or "fit" not in info.stages:
                continue
            run = archive.run(info.id)
            about = run.about
            known = (about.get("recipe") or {}).get("effects") == recipe.effects and not about.get("prior")
            if known and (about.get("station") or {}).get("kind") == kind:
                self._add(info.id, datetime.fromisoformat(info.started).timestamp() / DAY_S, run, recipe.sensor_axes)

    def _add(self, name: str, day: float, run: Run, axes: int) -> None:
        calibration = read_calibration(*(run.table(table) for table in READ))
        if len(calibration.axes) != axes or not calibration.units:
            return
        self.effects = [effect for effect, _ in calibration.names[0]]
        for unit, *numbers in zip(calibration.units, calibration.coefficients, calibration.covariance, strict=True):
            group = self.attributes.of(unit, name, self.attribute)
            self.units.setdefault(unit, []).append(_Calibrated(len(self.runs), day, group, *numbers))
        self.runs.append(name)

    def family(self, lot: set[str]) -> Family:
        """The family of the units, each by its first calibration, and what units of the lot say of themselves.

        The lot's own units are none of the family.
        """
        first = [many[0] for unit, many in self.units.items() if unit not in lot]
        if not first:
            raise NotIdentified(
                f"prior: no calibration of {self.device} with this model; leave [prior] out until there are some"
            )
        number = np.unique([calibration.run for calibration in first], return_inverse=True)[1].astype(np.int64)
        known = (
            np.stack([calibration.values for calibration in first]),
            np.stack([calibration.covariance for calibration in first]),
            number,
        )
        found = family_of(*known)
        of_groups = self._of_groups(found, known, [calibration.group for calibration in first], lot)
        pairs = [pair for many in self.units.values() for pair in pairwise(many)]
        if len(pairs) < PAIRS:
            return replace(found, own=of_groups)
        days = np.array([b.day - a.day for a, b in pairs])
        both = np.stack([a.covariance + b.covariance for a, b in pairs])
        change = change_of(np.stack([b.values - a.values for a, b in pairs]), both)
        again = [unit for unit in self.units if unit in lot]
        self.groups = {unit: group for unit, group in self.groups.items() if unit not in again}
        of_units = {unit: self._by_last_calibration(found, self.units[unit][-1], change, days.mean()) for unit in again}
        return replace(found, own={**of_groups, **of_units})

    def _of_groups(
        self, found: Family, known: tuple[Array, Array, Index], group: list[str], lot: set[str]
    ) -> dict[str, tuple[Array, Array]]:
        """Priors of the units of the lot by what earlier units with the same value of the attribute were."""
        if not self.attribute:
            return {}
        if self.attribute not in (names := self.attributes.names()):
            raise NotIdentified(
                f"prior: the archive knows no attribute '{self.attribute}'; add it with 'tumbleline attributes add', or correct "
                f"the name: {did_you_mean(self.attribute, names)}"
            )
        groups = groups_of(found, *known, group)
        named = {unit: self.attributes.of(unit, "", self.attribute) for unit in sorted(lot)}
        self.groups = {unit: f"{self.attribute} {name}" for unit, name in named.items() if name in groups.shift}
        return {unit: groups.of(named[unit]) for unit in self.groups}

    @staticmethod
    def _by_last_calibration(found: Family, last: _Calibrated, change: Array, days: float) -> tuple[Array, Array]:
        """Mean and covariance of a unit by its last calibration: its change grows with time, as a walk does."""
        past = max(1.0, (datetime.now(UTC).timestamp() / DAY_S - last.day) / max(days, 1.0 / DAY_S))
        both = combined(last.values, last.covariance, found.mean, found.precision)
        return both.coefficients, both.covariance + past * change[..., None] * np.eye(change.shape[-1])


def stored_family(recipe: Recipe, default: Archive, units: set[str], kind: str) -> StoredFamily | None:
    """The family of a recipe's device in the archive that its ``[prior]`` names; None where it has none.

    Every other unit counts once, with its first calibration by the same model; calibrations with a prior say nothing new of the
    family. Units of the lot with earlier calibrations have a prior of their own, where the archive has pairs of calibrations
    that show how a unit changes; the others that of their wafer, or other attribute, where ``[prior]`` names one.

    Parameters
    ----------
    default : the archive where none is named
    units : those of the lot
    kind : of the station: simulated units say nothing of real units

    Raises
    ------
    RecipeInvalid
        There are too few calibrations.
    """
    if recipe.prior is None:
        return None
    archive = Archive(recipe.prior.archive) if recipe.prior.archive else default
    archive.refuse_none()
    since = "" if recipe.prior.since is None else recipe.prior.since.isoformat()
    archived = _Archived(recipe, archive, since, kind)
    try:
        found = archived.family(units)
    except NotIdentified as problem:
        raise RecipeInvalid(f"recipe {recipe.name}: {problem} (archive {archive.address})", key="prior") from None
    numbers = {
        field.name: value.tolist() if isinstance(value := getattr(found, field.name), np.ndarray) else value
        for field in fields(found)
        if field.name != "own"
    }
    alone = {unit: {"mean": m.tolist(), "covariance": c.tolist()} for unit, (m, c) in found.own.items()}
    return StoredFamily.model_validate(
        {**numbers, "effects": archived.effects, "runs": archived.runs, "own": alone, "groups": archived.groups}
    )


def planned_precision(recipe: Recipe, archive: str | None, kind: str) -> Array | None:
    """Precision (m, p, p) of the prior of a recipe that is planned, 1/g²; None without a prior.

    Where all units that the recipe names have earlier calibrations, it is that of the least known of them. Outputs become g by
    the scale of the family.

    Parameters
    ----------
    archive : address; the default archive where None
    """
    stored = stored_family(recipe, Archive(archive), set(recipe.units), kind)
    found = family(stored)
    if stored is None or found is None:
        return None
    per_g = found.mean[:, stored.effects.index("scale")] if "scale" in stored.effects else np.ones(len(found.mean))
    precision = found.precision
    if recipe.units and set(recipe.units) <= set(found.own):
        widest = max(
            (covariance for _, covariance in found.own.values()), key=lambda c: float(np.linalg.slogdet(c)[1].sum())
        )
        precision = np.linalg.inv(widest)
    return np.asarray(precision * (per_g**2)[:, None, None], dtype=np.float64)


def stored_in(about: Mapping[str, Any]) -> StoredFamily | None:
    """The family that a run was started with."""
    return StoredFamily.model_validate(about["prior"]) if about.get("prior") else None


def family(stored: StoredFamily | None) -> Family | None:
    """The family that a job keeps."""
    if stored is None:
        return None
    of_units = {unit: (np.array(known.mean), np.array(known.covariance)) for unit, known in stored.own.items()}
    mean, unit, lot, error, tails = map(np.array, (stored.mean, stored.unit, stored.lot, stored.error, stored.tails))
    return Family(mean, unit, lot, error, stored.units, stored.lots, tails, of_units)
