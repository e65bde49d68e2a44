"""``tumbleline release``: release a model to the line from a date, or list the releases."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from pipelines.archive import Archive
from pipelines.cli.groups import group
from pipelines.cli.options import (
    ArchiveOption,
    EffectFileOption,
    JsonOption,
    ReasonOption,
    argument,
    option,
    stated_device,
)
from pipelines.cli.printing import give, print_table, say
from pipelines.cli.release_whatif import whatif
from schemas.errors import WrongUse

if TYPE_CHECKING:
    from pipelines.jobs.releases import Release

PART = "Old data, new models"
ORDER = 550
SUMMARY = "Release a model to the line from a date, list the releases, see the effect before."
EXAMPLES = (
    "tumbleline release model.toml --since 2026-01-01 --reason 'the error on fresh runs falls'",
    "tumbleline release whatif model.toml",
)
EXAMPLES_OF = {
    "model": (
        "tumbleline release",
        "tumbleline release model.toml --since 2026-01-01 --reason 'the error on fresh runs falls'",
    ),
    "whatif": ("tumbleline release whatif model.toml", "tumbleline release whatif model.toml device:adxl355"),
}
"""Of the subcommands."""


def model(
    file: Annotated[Path | None, argument("[MODEL]", "A model file.")] = None,
    since: Annotated[str, option("--since DATE", "First day of use (UTC).")] = "",
    device: Annotated[str, option("--device KIND", "For this kind of device only.")] = "",
    station: Annotated[str, option("--station NAME", "For this station only.")] = "",
    reason: ReasonOption = "",
    effect_file: EffectFileOption = None,
    archive: ArchiveOption = None,
    *,
    force: Annotated[bool, option("--force", "Release the model without a what-if with the verdict 'better'.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Release a model to the line from a date; without a model, list the releases.

    Recipes with model = "line" use the model from this date on. It needs a what-if in the archive with the verdict 'better' (see
    'tumbleline release whatif'), or --force and a reason. Releases are never changed; a later release replaces an earlier one.
    """
    from pipelines.jobs.model_change import change_from_options
    from pipelines.jobs.releases import release as publish
    from pipelines.rerun.selection import moment

    store = Archive(archive)
    store.refuse_misnamed(archive)
    if file is None and not (since or device or station or reason or force):
        _list(store, as_json=as_json)
        return
    if file is None or not since:
        missing = ["a model file"] * (file is None) + ["--since DATE"] * (not since)
        are = "are" if len(missing) > 1 else "is"
        raise WrongUse(
            f"release: {' and '.join(missing)} {are} missing; give 'tumbleline release MODEL --since DATE', or "
            "'tumbleline release' alone for the list"
        )
    change = change_from_options("", file, "", effect_file, where="release")
    device, slip = stated_device(device, "release it for that kind")
    first = moment(since, "--since")
    record = publish(store, change, first, device=device, station=station, reason=reason, force=force)
    lines = [
        f"release {record.number}: {_name(record)} for {_where(record)} from {record.since:%Y-%m-%d %H:%M} UTC",
        f"  {', '.join(record.model.effects or ())}",
        f"  evidence: {record.evidence or 'none'}{', forced' if record.forced else ''}",
        *(f"  {line}" for line in slip),
    ]
    give({"archive": str(store.root), **record.document()}, lines, as_json=as_json)


def _list(store: Archive, *, as_json: bool) -> None:
    from datetime import UTC, datetime

    from pipelines.jobs.releases import released, releases

    records = releases(store)
    now = datetime.now(UTC)
    valid = {record.number for record in records if released(store, record.device, record.station, now) == record}
    rows = [{**record.document(), "in_use": record.number in valid} for record in records]
    give({"archive": str(store.root), "releases": rows}, lambda _: _print(store, records, valid), as_json=as_json)


def _print(store: Archive, records: "list[Release]", valid: set[int]) -> None:
    if not records:
        say(f"no model is released in {store.root}; release one with 'tumbleline release'")
        return
    lines = [
        [str(r.number), _name(r), _where(r), f"{r.since:%Y-%m-%d}", "yes" if r.number in valid else "", r.who]
        for r in records
    ]
    print_table(["no.", "model", "for", "from", "in use", "by"], lines, fixed=4)
    for record in records:
        say(f"  {record.number}: {record.reason}{' (forced)' if record.forced else ''}")


def _name(record: "Release") -> str:
    return f"{record.model.model_name} version {record.model.model_version}"


def _where(record: "Release") -> str:
    return f"{record.device} on {record.station}".removeprefix(" on ").removesuffix(" on ") or "all"


app = group(SUMMARY, {"model": model, "whatif": whatif}, usual="model")
