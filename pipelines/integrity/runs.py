"""Checks of one run (its tables, their manifests, the links between these) and of one capture (its records, their chain)."""

from dataclasses import replace
from typing import Any

from pipelines.archive import Run, files, parquet, stage_key
from pipelines.archive.hash_chain import is_number
from pipelines.archive.listing import SEALED
from pipelines.archive.records import COMPLETE, EVENTS, Events
from pipelines.archive.run import START
from pipelines.archive.store import Place
from pipelines.certificates.coefficient_remarks import differing_libraries
from pipelines.integrity.findings import CHANGED, EDITED, FOREIGN, MISSING, VerifiedPart, parquet_metadata

OURS = ("run.json", SEALED, "lock")
KEYED = ("stage", "inputs", "parameters", "code", "key")
REMOVE_FOREIGN = "remove it; import foreign files with 'tumbleline import'"
Record = tuple[dict[str, Any], str, Place]  # manifest of a record, hash of the manifest, and folder


def check_run(run: Run, checked: VerifiedPart, schema: int) -> VerifiedPart:
    """Check a run."""
    names = {path.name: path for path in run.path.iterdir()}
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
    for name, path in sorted(names.items()):
        if path.suffix == ".json" and name not in OURS and not name.startswith(files.TEMPORARY):
            manifest = checked.manifest(path, schema)
            if manifest is not None:
                manifests[path.stem], hashes[path.stem] = manifest
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
        # a fit states its origin, but no reasons
        command = "'tumbleline rerun'" if "because" in about else "its command"
        checked.remarks.append(f"run {run.id} is not finished: give {command} again to continue it")
    return checked


def _check_links(
    path: Place,
    content: dict[str, Any],
    manifests: dict[str, dict[str, Any]],
    hashes: dict[str, str],
    checked: VerifiedPart,
) -> None:
    """Compare a manifest with its own key, and with the manifests that it names."""
    tables = all(isinstance(content.get(name), dict) for name in ("inputs", "parameters"))
    if tables and all(name in content for name in KEYED):
        if stage_key(*(content[name] for name in KEYED[:4])) != content["key"]:
            text = "was edited: its key does not agree with its stage, inputs, parameters and code"
            checked.wrong(EDITED, path, text)
    elif not isinstance(content.get("parameters", {}), dict):
        checked.wrong(EDITED, path, "was edited: its parameters are not a table of names and values")
    for name, expected in checked.named(content, "inputs", path).items():
        if name in manifests and manifests[name].get("sha256") != expected:
            table = path.parent / f"{name}.json"
            checked.wrong(EDITED, path, f"names another table {name} than the one in the run", table)
    for name, expected in checked.named(content, "manifests", path).items():
        if name in hashes and hashes[name] != expected:
            text = f"is not the manifest that {path.stem} was made from: it was edited or written again"
            checked.wrong(EDITED, path.parent / f"{name}.json", text, path)
        elif name not in hashes and name != "records":
            checked.wrong(MISSING, path.parent / f"{name}.json", f"is missing, {path.stem} was made from it")


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
    for name, path in sorted(names.items()):
        manifest = run.path / f"{path.stem}.json"
        if name.startswith(files.TEMPORARY):
            what = "is a temporary file of a killed or active writer; see 'archive clean'"
            checked.remarks.append(f"{checked.name(path)} {what}")
        elif path.suffix == ".parquet" and path.stem not in manifests and not manifest.is_file():
            mark = table_mark(path)
            if mark != path.stem:
                what = f"holds table '{mark}'" if mark else "was not written by this archive"
                checked.wrong(FOREIGN, path, f"{what}: {REMOVE_FOREIGN}")
            elif "report.json" in names:
                checked.wrong(MISSING, manifest, "is missing, its table exists")


def table_mark(path: Place) -> str:
    """Name of the table in the metadata of a Parquet file; empty for a foreign or damaged file."""
    file = parquet_metadata(path)
    return "" if file is None else (file.metadata or {}).get(parquet.TABLE_MARK, b"").decode(errors="replace")


def check_capture(path: Place, checked: VerifiedPart, schema: int) -> VerifiedPart:
    """Check a capture."""
    records: list[Record] = []
    unusable: Place | None = None
    for folder in sorted(path.iterdir(), key=lambda entry: entry.name):
        if not is_number(folder.name):
            continue
        manifest = checked.manifest(folder / "record.json", schema)
        if manifest is None:
            unusable = unusable or folder / "record.json"
            continue
        content = checked.named(manifest[0], "content", folder / "record.json")
        for name, expected in sorted(content.items()):
            checked.table(folder / name, str(expected))
        if manifest[0].get("record") != int(folder.name):
            found = f"holds record {manifest[0].get('record')!r}"
            checked.wrong(EDITED, folder, f"{found}: two folders were exchanged, or this one was renamed")
        check_strangers(folder, {*content, "record.json"}, checked)
        records.append((*manifest, folder))
    records.sort(key=lambda record: (str(type(record[0].get("order"))), record[0].get("order", 0)))
    part = checked.blank()
    _check_order(records, part)
    _check_end(path, records, part, schema)
    if unusable is not None:  # the gap that it leaves in the order
        part.findings = [replace(finding, because=checked.name(unusable)) for finding in part.findings]
    checked.add(part)
    if records:
        _check_state(path, records[-1], checked)
    return checked


def check_strangers(folder: Place, known: set[str], checked: VerifiedPart) -> None:
    """Tables in a folder that the archive did not write."""
    what = f"was not written by the archive: {REMOVE_FOREIGN}"
    for file in sorted(folder.iterdir(), key=lambda path: path.name) if folder.is_dir() else ():
        if file.suffix == ".parquet" and file.name not in known and file.is_file():
            checked.wrong(FOREIGN, file, what)


def _check_order(records: list[Record], checked: VerifiedPart) -> None:
    """Every record names the record before it; the first record in an archive of an older version names none."""
    before = ""
    for count, (content, file_hash, folder) in enumerate(records):
        if content.get("order") != count:
            order = content.get("order")
            checked.wrong(MISSING, folder, f"was stored as number {order}, {count} records exist before it")
            return
        if content.get("previous", before) != before:
            earlier = records[count - 1][2] if count else folder
            checked.wrong(EDITED, earlier / "record.json", f"is not the manifest that record {folder.name} refers to")
        before = file_hash


def _check_end(path: Place, records: list[Record], checked: VerifiedPart, schema: int) -> None:
    end = path / COMPLETE
    if not end.is_file():
        checked.remarks.append(f"{checked.name(path)} is not finished: {len(records)} records are stored")
        return
    manifest = checked.manifest(end, schema)
    if manifest is None:
        return
    content, stored = manifest[0], manifest[0].get("records")
    if stored != len(records):
        checked.wrong(MISSING, path, f"holds {len(records)} records, {stored} were stored")
    if "events" in content:  # older versions did not store them
        _check_events(path, checked.named(content, "events", end), checked)
    if stored == len(records) and records and content.get("previous", records[-1][1]) != records[-1][1]:
        checked.wrong(EDITED, records[-1][2] / "record.json", "is not the last manifest of the finished capture")


def _check_events(path: Place, expected: dict[str, str], checked: VerifiedPart) -> None:
    """Compare the journal with its hashes in the last file of the capture."""
    actual = Events(path).hashes()
    for name in sorted({*expected, *actual}):
        file = path / EVENTS / name
        if name not in actual:
            checked.wrong(MISSING, file, "is missing, the finished capture had this event in its journal")
        elif name not in expected:
            checked.wrong(FOREIGN, file, "was added to the journal after the end of the capture")
        elif actual[name] != expected[name]:
            checked.wrong(CHANGED, file, "differs from the event in the journal of the finished capture")


def _check_state(path: Place, last: Record, checked: VerifiedPart) -> None:
    """Compare the state of the station, from which the capture continues, with the hash in its record."""
    expected = last[0].get("state")
    if expected is None:  # older versions did not store it
        return
    file = path / "state" / f"{last[2].name}.bin"
    if not file.is_file():
        checked.wrong(MISSING, file, f"is missing, record {last[2].name} refers to this state of the station")
    elif files.sha256(file) != expected:
        checked.wrong(CHANGED, file, f"differs from the state of the station in record {last[2].name}")
