"""The prior of a job: the family of its devices, from the calibrations of an archive."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from inertial.arrays import Array
from inertial.errors import NotIdentified
from inertial.population.family import Family, family_of
from pipelines.archive import Archive
from pipelines.tables.calibration import read_calibration
from schemas.errors import RecipeInvalid
from schemas.prior import StoredFamily
from schemas.recipe import Recipe

READ = ("coefficients", "covariance")


def stored_family(recipe: Recipe, own: Archive, units: set[str], kind: str) -> StoredFamily | None:
    """The family of a recipe's device in the archive that its ``[prior]`` names; None where it has none.

    Every other unit counts once, with its first calibration by the same model; calibrations with a prior say nothing new of the
    family.

    Parameters
    ----------
    own : the archive where none is named
    units : those of the lot, whose earlier calibrations are left out
    kind : of the station: simulated units say nothing of real ones

    Raises
    ------
    RecipeInvalid
        There are too few calibrations.
    """
    if recipe.prior is None:
        return None
    archive = Archive(recipe.prior.archive) if recipe.prior.archive else own
    archive.refuse_none()
    since = "" if recipe.prior.since is None else recipe.prior.since.isoformat()
    values, errors, lots, runs, seen = [], [], [], list[str](), set(units)
    for info in sorted(archive.runs(), key=lambda info: (info.started, info.id)):
        if info.device.lower() != recipe.device.lower() or info.rerun_of or info.started < since or "fit" not in info.stages:
            continue
        run = archive.run(info.id)
        about = run.about
        other = about.get("recipe") or {}
        if (
            other.get("effects") != recipe.effects
            or about.get("prior")
            or (about.get("station") or {}).get("kind") != kind
        ):
            continue
        calibration = read_calibration(*(run.table(name) for name in READ))
        new = [k for k, unit in enumerate(calibration.units) if unit not in seen]
        if not new or len(calibration.axes) != recipe.sensor_axes:
            continue
        seen.update(calibration.units)
        values.append(calibration.coefficients[new])
        errors.append(calibration.covariance[new])
        lots += [len(runs)] * len(new)
        runs.append(info.id)
        names = [effect for effect, _ in calibration.names[0]]
    if not runs:
        raise RecipeInvalid(
            f"recipe {recipe.name}: prior: no calibration of {recipe.device} with this model in archive {archive.address}; "
            "leave [prior] out until there are some",
            key="prior",
        )
    try:
        family = family_of(np.concatenate(values), np.concatenate(errors), np.array(lots))
    except NotIdentified as problem:
        raise RecipeInvalid(f"recipe {recipe.name}: {problem}", key="prior") from None
    numbers = {
        name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in asdict(family).items()
    }
    return StoredFamily(effects=names, runs=runs, **numbers)


def planned_precision(recipe: Recipe, archive: str | None, kind: str) -> Array | None:
    """Precision (m, p, p) of the prior of a recipe that is planned, 1/g²; None without one.

    Outputs become g by the scale of the family.

    Parameters
    ----------
    archive : address; the default one where None
    """
    stored = stored_family(recipe, Archive(archive), set(), kind)
    own = family(stored)
    if stored is None or own is None:
        return None
    per_g = own.mean[:, stored.effects.index("scale")] if "scale" in stored.effects else np.ones(len(own.mean))
    return own.precision * (per_g**2)[:, None, None]


def stored_in(about: Mapping[str, Any]) -> StoredFamily | None:
    """The family that a run was started with."""
    return StoredFamily.model_validate(about["prior"]) if about.get("prior") else None


def family(stored: StoredFamily | None) -> Family | None:
    """The family that a job keeps."""
    if stored is None:
        return None
    own: dict[str, Any] = stored.model_dump(exclude={"effects", "runs"})
    return Family(**{name: np.array(value) if isinstance(value, list) else value for name, value in own.items()})
