"""Checks of one run: its tables, their manifests, and the links between the manifests."""

from __future__ import annotations

from typing import Any

from pipelines.archive import Run, files, parquet, stage_key
from pipelines.archive.listing import SEALED
from pipelines.archive.packed_path import member_of
from pipelines.archive.records import COMPLETE
from pipelines.archive.run import START
from pipelines.archive.store import ObjectPath, Place
from pipelines.certificates.coefficient_remarks import differing_libraries
from pipelines.integrity.findings import EDITED, FOREIGN, MISSING, VerifiedPart

OURS = ("run.json", SEALED, "lock")
KEYED = ("stage", "inputs", "parameters", "code", "key")


def check_run(run: Run, checked: VerifiedPart, schema: int) -> VerifiedPart:
    """Check a run."""
    names = {place.name: place for place in run.path.iterdir()}
    left = any(name.startswith(files.TEMPORARY) for name in names)
    begun = any(name != "lock" and not name.startswith(files.TEMPORARY) for name in names)
    # a re-run publishes all files at once, this one last: a killed re-run left it under a temporary name
    if not begun or (left and not names.keys() & {START, "report.json", SEALED}):
        checked.remarks.append(f"{checked.name(run.path)} holds no run: its writer was killed, or has just started")
        return checked
    start = checked.manifest(run.path / "run.json", schema)
    if start is None:
        return checked
    about, hashes = start[0], {"run": start[1]}
    manifests: dict[str, dict[str, Any]] = {}
    for name, place in sorted(names.items()):
        if place.suffix == ".json" and name not in OURS and not name.startswith(files.TEMPORARY):
            manifest = checked.manifest(place, schema)
            if manifest is not None:
                manifests[place.stem], hashes[place.stem] = manifest
    for name, content in manifests.items():
        data = run.path / ("report.html" if name == "report" else f"{name}.parquet")
        checked.table(data, str(content.get("sha256")), content.get("rows"))
        if name != "report" and "stage" not in content:
            checked.wrong(EDITED, run.path / f"{name}.json", "was edited: the stage that made its table is missing")
        _check_links(run.path / f"{name}.json", content, manifests, hashes, checked)
    capture = str(about.get("capture") or "")
    _check_capture_link(run, capture, manifests, checked)
    _check_others(run, names, manifests, checked)
    checked.remarks += differing_libraries(run.id, manifests)
    if not names.keys() & {"report.json", SEALED} and capture:
        command = (
            "'tumbleline rerun'" if "because" in about else "its command"
        )  # a fit states its origin, but no reasons
        checked.remarks.append(f"run {run.id} is not finished: give {command} again to continue it")
    return checked


def _check_links(
    place: Place,
    content: dict[str, Any],
    manifests: dict[str, dict[str, Any]],
    hashes: dict[str, str],
    checked: VerifiedPart,
) -> None:
    """Compare a manifest with its own key, and with the manifests that it names."""
    if all(name in content for name in KEYED) and all(
        isinstance(content[name], dict) for name in ("inputs", "parameters")
    ):
        key = stage_key(*(content[name] for name in KEYED[:4]))
        if key != content["key"]:
            checked.wrong(
                EDITED, place, "was edited: its key does not agree with its stage, inputs, parameters and code"
            )
    elif not isinstance(content.get("parameters", {}), dict):
        checked.wrong(EDITED, place, "was edited: its parameters are not a table of names and values")
    for name, expected in checked.named(content, "inputs", place).items():
        if name in manifests and manifests[name].get("sha256") != expected:
            table = place.parent / f"{name}.json"
            checked.wrong(EDITED, place, f"names another table {name} than the one in the run", table)
    for name, expected in checked.named(content, "manifests", place).items():
        if name in hashes and hashes[name] != expected:
            edited = place.parent / f"{name}.json"
            checked.wrong(
                EDITED,
                edited,
                f"is not the manifest that {place.stem} was made from: it was edited or written again",
                place,
            )
        elif name not in hashes and name != "records":
            checked.wrong(MISSING, place.parent / f"{name}.json", f"is missing, {place.stem} was made from it")


def _check_capture_link(run: Run, capture: str, manifests: dict[str, dict[str, Any]], checked: VerifiedPart) -> None:
    """Compare the capture with the one from which the tables of the run were made."""
    if not capture:
        return
    end = run.archive.root / "captures" / capture / COMPLETE
    if not end.is_file():
        if manifests:
            checked.wrong(MISSING, end, f"is missing, run {run.id} was made from this capture")
        return
    actual = files.sha256(end)
    for name, content in manifests.items():
        named = content.get("manifests", {})
        if isinstance(named, dict) and named.get("records", actual) != actual:
            text = f"is not the end of the capture that {name} of run {run.id} was made from"
            checked.wrong(EDITED, end, text, run.path / f"{name}.json")
            return


def _check_others(run: Run, names: dict[str, Place], manifests: dict[str, Any], checked: VerifiedPart) -> None:
    """Files in the folder of a run that no manifest names."""
    for name, place in sorted(names.items()):
        if name.startswith(files.TEMPORARY):
            checked.remarks.append(
                f"{checked.name(place)} is a temporary file of a killed or active writer; see 'archive clean'"
            )
        elif (
            place.suffix == ".parquet"
            and place.stem not in manifests
            and not (run.path / f"{place.stem}.json").is_file()
        ):
            mark = table_mark(place)
            if mark != place.stem:
                what = f"holds table '{mark}'" if mark else "was not written by this archive"
                checked.wrong(FOREIGN, place, f"{what}: remove it; import foreign files with 'tumbleline import'")
            elif "report.json" in names:
                checked.wrong(MISSING, run.path / f"{place.stem}.json", "is missing, its table exists")


def table_mark(place: Place) -> str:
    """Name of the table in the metadata of a Parquet file; empty for a foreign or damaged file."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    inside = isinstance(place, ObjectPath) or member_of(place) is not None
    source = pa.BufferReader(place.read_bytes()) if inside else str(place)
    try:
        metadata = pq.read_metadata(source).metadata or {}
    except (pa.ArrowInvalid, OSError):
        return ""
    return metadata.get(parquet.TABLE_MARK, b"").decode(errors="replace")
