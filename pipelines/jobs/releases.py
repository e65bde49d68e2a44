"""Releases of models to the line: records in the archive that are never changed, and the evidence for them.

Every record has its scope (device, station) and its first day of use. A record for the same device and station has priority over
a record for the device only, and this over a record for all; among records of equal scope that with the latest date not in the
future applies, and of two with the same date that written last.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from pipelines.archive import Archive, files, hash_chain
from pipelines.archive.keys import digest
from pipelines.archive.locks import alone
from pipelines.archive.provenance import provenance
from pipelines.jobs.documents import ReleaseRecord
from pipelines.jobs.model_change import ModelChange
from pipelines.jobs.model_files import chosen_effects, effect_file_hashes, use_formulas
from pipelines.jobs.recipes import load_recipe
from schemas.errors import RecipeInvalid, WrongUse
from schemas.recipe import FormulaSpec, Recipe

FOLDER, EVIDENCE = "releases", "whatif"
SCHEMA = 1


@dataclass(frozen=True, kw_only=True)
class Release:
    """One record: model, first day of use, device and station (empty: all), reason, and evidence."""

    number: int
    model: ModelChange
    since: datetime
    device: str
    station: str
    reason: str
    evidence: str
    forced: bool
    who: str
    when: str

    def document(self) -> ReleaseRecord:
        """The record for JSON."""
        return {
            "release": self.number,
            "model": self.model.model_name,
            "version": self.model.model_version,
            "effects": list(self.model.effects or ()),
            "from": self.since.isoformat(),
            "device": self.device,
            "station": self.station,
            "reason": self.reason,
            "evidence": self.evidence,
            "forced": self.forced,
            "by": self.who,
            "at": self.when,
        }


def _matches(scope: str, name: str) -> bool:
    return not scope or scope.lower() == name.lower()


def model_digest(change: ModelChange) -> str:
    """Hash of the effects and formulas of a model, and of the Python files of its effects, without its name."""
    formulas = [formula.model_dump(mode="json") for formula in change.formulas]
    content: dict[str, Any] = {"effects": sorted(change.effects or ()), "formulas": formulas}
    own = effect_file_hashes(change.effects or ())
    return digest(content | {"effect_files": own} if own else content)


def keep_evidence(archive: Archive, change: ModelChange, document: Mapping[str, Any], runs: list[str]) -> str:
    """Store a what-if in the archive; return its name."""
    model = model_digest(change)
    content = {"schema": SCHEMA, "model": model, "runs": sorted(runs), **document}
    name = f"{model[:10]}-{digest(content)[:10]}"
    archive.prepare()
    path = archive.root / EVIDENCE / f"{name}.json"
    if not path.is_file():
        files.publish(path, files.manifest_bytes({**provenance(), **content}))
    return name


def evidence_for(archive: Archive, change: ModelChange, device: str, station: str) -> dict[str, Any] | None:
    """The newest what-if of a model with lots of this device and station; None where there was none."""
    model = model_digest(change)
    matches: list[dict[str, Any]] = []
    for path in (archive.root / EVIDENCE).glob(f"{model[:10]}-*.json"):
        content = files.read_json(path)
        groups = content.get("groups", [])
        if content.get("model") == model and any(
            _matches(device, row["device"]) and _matches(station, row["station"]) for row in groups
        ):
            matches.append({**content, "name": path.stem})
    return max(matches, key=lambda what_if: str(what_if["when"]), default=None)


def release(
    archive: Archive,
    change: ModelChange,
    since: datetime,
    *,
    device: str = "",
    station: str = "",
    reason: str,
    force: bool = False,
) -> Release:
    """Write a new release of a model to the line; return the record.

    Raises WrongUse: the release is not forced and there is no what-if of the model for this device and station, or its verdict
    is not 'better'; or no reason is given.
    """
    if not reason.strip():
        raise WrongUse("release: no reason is given, one is needed; give --reason TEXT")
    evidence = evidence_for(archive, change, device, station)
    if not force:
        _refuse_without(evidence, change, device, station)
    archive.prepare()
    content: dict[str, Any] = {
        "schema": SCHEMA,
        "model": {**change.of_model(), "formulas": [formula.model_dump(mode="json") for formula in change.formulas]},
        "from": since.isoformat(),
        "device": device,
        "station": station,
        "reason": reason.strip(),
        "evidence": evidence["name"] if evidence else "",
        "forced": force,
    }
    with alone(archive.root / FOLDER, wait=True):
        number = max((record.number for record in releases(archive)), default=0) + 1  # a record may have been removed
        path = _path(archive, number)
        files.publish_first(path, files.manifest_bytes({**provenance(), **content, "number": number}))
        sealed = {f"{FOLDER}/{path.name}": files.sha256(path)}
        hash_chain.append(archive.root, "release", sealed, {**provenance(), "release": number})
    return _read(archive, number)


def _refuse_without(evidence: dict[str, Any] | None, change: ModelChange, device: str, station: str) -> None:
    where = "".join([f" of {device}" if device else "", f" on {station}" if station else ""])
    name = change.model_name or "the model"
    if evidence is None:
        raise WrongUse(
            f"release: nothing in the archive shows the effect of {name} on lots{where}, a what-if is needed; run "
            "'tumbleline release whatif', or give --force with a reason that says why not"
        )
    if evidence["verdict"] != "better":
        raise WrongUse(
            f"release: the what-if {evidence['name']} says {evidence['verdict']}: {evidence['words']}; a better model is needed; "
            "change it, or give --force with a reason that says why it is released"
        )


def releases(archive: Archive) -> list[Release]:
    """Every record, in the order of writing."""
    stems = (path.stem for path in (archive.root / FOLDER).glob("*.json"))
    return [_read(archive, number) for number in sorted(int(stem) for stem in stems if hash_chain.is_number(stem))]


def released(archive: Archive, device: str, station: str, when: datetime) -> Release | None:
    """The record of the line's model for a device and station at a time; None where no record applies."""
    matching = [
        record for record in releases(archive) if _matches(record.device, device) and _matches(record.station, station)
    ]
    holding = [record for record in matching if record.since <= when]
    return max(
        holding,
        key=lambda record: (bool(record.station), bool(record.device), record.since, record.number),
        default=None,
    )


def line_model(archive: Archive, device: str, station: str, when: datetime | None = None) -> dict[str, Any]:
    """The keys of a recipe for the line's model, now or at a time.

    Raises RecipeInvalid: no model is released for the device and station.
    """
    at = when or datetime.now(UTC)
    in_force = released(archive, device, station, at)
    if in_force is None:
        there = releases(archive)
        known = (
            ", ".join(f"{record.device or 'every device'} from {record.since:%Y-%m-%d}" for record in there) or "none"
        )
        raise RecipeInvalid(
            f"recipe: key 'model': for {device} on {station} no model is released at {at:%Y-%m-%d} "
            f"(released: {known}); release one with 'tumbleline release', or name effects in the recipe",
            key="model",
        )
    return in_force.model.of_model()


def planned_recipe(name: str, effects: str, model: Path | None, archive: str | None, station: str) -> Recipe:
    """The recipe to be planned, with another model where that is given; the archive is read only for the line's model.

    effects, model : a list of effects, or a model file; empty or None if not given
    """
    chosen = chosen_effects(effects, model, "plan")

    def line(device: str) -> dict[str, Any]:
        if chosen:
            return {"effects": chosen}
        keys = line_model(Archive(archive), device, station)
        use_formulas(keys["formulas"], "the line's model")
        return keys

    loaded = load_recipe(name, line)
    return loaded.model_copy(update={"effects": list(chosen)}) if chosen else loaded


def _path(archive: Archive, number: int) -> Any:
    return archive.root / FOLDER / f"{number:06d}.json"


def _read(archive: Archive, number: int) -> Release:
    content = files.read_json(_path(archive, number))
    model = content["model"]
    as_written = ("device", "station", "reason", "evidence", "forced", "who", "when")
    formulas = tuple(FormulaSpec.model_validate(formula) for formula in model["formulas"])
    return Release(
        number=number,
        model=ModelChange(tuple(model["effects"]), formulas, model["model_name"], model["model_version"]),
        since=datetime.fromisoformat(content["from"]),
        **{key: content[key] for key in as_written},
    )
