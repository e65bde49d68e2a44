"""Checks of the chain, of the ledger, and that everything finished is in the chain: runs, calibrations and releases.

No entry of the chain may be missing or edited, and the files that it seals must be unchanged.

A run without an entry was copied here, or its entry was removed, or its writer was killed before it wrote the entry. A run whose
writer may still be active gives a remark and no finding.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path, PurePosixPath
from typing import Any

from pipelines.archive import Run, files, hash_chain
from pipelines.archive.hash_chain import is_number
from pipelines.archive.keys import digest
from pipelines.archive.listing import stages_of
from pipelines.archive.provenance import provenance
from pipelines.archive.signatures import ENTRY
from pipelines.archive.store import Place
from pipelines.certificates.entries import SCHEMA, STATIC, folder_of
from pipelines.integrity.findings import CHANGED, EDITED, MISSING, UNCHAINED, UNREADABLE, VerifiedPart
from schemas.errors import ArchiveUnusable

JUST_NOW = timedelta(minutes=5)  # clocks of hosts may differ by as much: see the ledger
MARK, REPORT = "sealed.json", "report.json"
OF_ANOTHER = "is the seal of another run"
REMEDY = "it was copied here, its entry was removed, or its writer was killed: see 'tumbleline archive clean'"


@dataclass
class Chain:
    """Content of the chain.

    head : hash of its last entry.
    sealed : the files that it names, with the hash that the last entry to name them gives.
    entries : what each entry seals, by its number.
    differing : the files that differ from what it sealed.
    """

    head: str = ""
    sealed: dict[str, str] = field(default_factory=dict[str, str])
    entries: dict[int, dict[str, str]] = field(default_factory=dict[int, "dict[str, str]"])
    differing: set[str] = field(default_factory=set[str])


def check_chain(root: Place, checked: VerifiedPart, *, only: set[str] | None = None, head: str = "") -> Chain:
    """Read and check the chain; findings go into ``checked``.

    only : runs whose sealed files are checked; all where None.
    head : hash of an entry from a copy elsewhere; it must exist.
    """
    before, seen, chain, latest = "", set[str](), Chain(), ""
    for number, path in hash_chain.entries(root):
        part = checked.blank()
        manifest = part.manifest(path, 1)
        if only is not None and (manifest is None or manifest[0].get("run") not in only):
            part.untrusted = {}  # signatures of other runs' entries are not checked
        checked.add(part)
        if manifest is None:
            before = ""
            continue
        content, file_hash = manifest
        if content.get("number") != number:
            checked.wrong(EDITED, path, f"says that it is entry {content.get('number')!r}")
        if before and content.get("previous") != before:
            earlier = hash_chain.path_of_entry(root, number - 1)
            checked.wrong(EDITED, earlier, f"is not the entry that number {number} refers to")
        named = checked.named(content, "files", path)
        # names that lead out of the archive are ignored
        inside = {k: v for k, v in named.items() if ".." not in PurePosixPath(k).parts and not k.startswith("/")}
        chain.entries[number] = inside
        if only is None or content.get("run") in only:
            chain.sealed |= inside
        when = str(content.get("when", ""))
        if when < latest:
            what = f"entry {number} of the chain says {when}, one before it {latest}: a clock was set back"
            checked.remarks.append(what)
        before, latest = file_hash, max(when, latest)
        seen.add(file_hash)
    if head and head not in seen:
        what = f"has no entry with hash {head}: entries were removed or written again"
        checked.wrong(MISSING, root / hash_chain.FOLDER, what)
    chain.differing = {name for name, hashed in chain.sealed.items() if not _is_sealed(root, name, hashed, checked)}
    chain.head = before
    return chain


def _is_sealed(root: Place, name: str, expected: str, checked: VerifiedPart) -> bool:
    """Whether a file is there as it was sealed."""
    path = root / name
    try:
        actual = files.sha256(path)
    except OSError:
        checked.wrong(MISSING, path, "is missing, the chain of the archive names it")
        return False
    if actual != expected:
        checked.wrong(EDITED, path, "differs from what the chain of the archive sealed")
    return actual == expected


def check_seals(root: Place, runs: Sequence[Run], chain: Chain, checked: VerifiedPart, *, everything: bool) -> None:
    """Compare finished runs with the chain, and in a check of the whole archive also calibrations and releases."""
    for run in runs:
        _check_run(run, chain, checked)
    if everything:
        for top, pattern in (("calibrations", "*/*/*.json"), ("programming", "*/*/*.json"), ("releases", "*.json")):
            for path in sorted((root / top).glob(pattern), key=str) if (root / top).is_dir() else ():
                if is_number(path.stem) and checked.name(path).replace("\\", "/") not in chain.sealed:
                    with suppress(ArchiveUnusable):  # the check of the ledger reports it
                        _report(path, files.read_json(path), checked)
        for path in sorted((root / "whatif").glob("*.json"), key=str) if (root / "whatif").is_dir() else ():
            _check_evidence(path, checked)


def _check_run(run: Run, chain: Chain, checked: VerifiedPart) -> None:
    mark = run.path / MARK
    if not mark.is_file():
        _check_unsealed(run, chain, checked)
        return
    try:
        fault = _fault_of_seal(run, files.read_json(mark), chain, checked)
    except ArchiveUnusable:
        fault = "is not a readable seal; restore it from a copy"
    if fault:
        checked.wrong(EDITED, mark, fault)


def _fault_of_seal(run: Run, content: dict[str, Any], chain: Chain, checked: VerifiedPart) -> str:
    """What is wrong with a seal; empty where nothing is, or where a finding about another file says it."""
    number, mark = content.get("entry"), run.path / MARK
    if not isinstance(number, int) or number < 1:
        return f"names entry {number!r} of the chain, a number is needed; restore it from a copy"
    if number not in chain.entries:
        entry = hash_chain.path_of_entry(run.archive.root, number)
        checked.wrong(MISSING, entry, f"is missing, it sealed run {run.id}")
        return ""
    if f"runs/{run.id}/run.json" not in checked.named(content, "files", mark):
        return f"{OF_ANOTHER}: the folder was exchanged with another or renamed; restore it from a copy"
    if chain.entries[number] != content["files"]:
        copied = "restore both from one copy, or work in the archive that made the run (--archive)"
        return f"differs from what entry {number} of the chain sealed: run and chain are not from one archive; {copied}"
    if not set(content) <= {"entry", "files", "stages"} or files.json_bytes(content) != mark.read_bytes():
        return "was changed since it was written; restore it from a copy"
    return "" if _has_its_stages(run, content) else "names other stages than those that made the tables"


def _has_its_stages(run: Run, content: dict[str, Any]) -> bool:
    """Whether the stages in a seal, which lists show, are the stages that made the tables."""
    named = {name.rpartition("/")[2] for name in content["files"] if name.startswith("runs/")}
    there = {path.name for path in run.path.glob("*.json") if path.name != MARK}
    with suppress(ArchiveUnusable):  # the check of the run reports it
        return named != there or "stages" not in content or content["stages"] == stages_of(run.path)
    return True


def _check_unsealed(run: Run, chain: Chain, checked: VerifiedPart) -> None:
    """A run without a seal: unfinished, made by a version without a chain, or a finding."""
    prefix, report = f"runs/{run.id}/", run.path / REPORT
    if any(name.startswith(prefix) for name in chain.sealed):
        checked.wrong(MISSING, run.path / MARK, "is missing, the chain of the archive has an entry for the run")
    elif report.is_file():
        with suppress(ArchiveUnusable):  # the check of the run reports it
            content = files.read_json(report)
            if "manifests" in content:  # versions without a chain did not write this
                _report(report, content, checked)


def _check_evidence(path: Place, checked: VerifiedPart) -> None:
    """The evidence of a release has the hash of its content in its name; provenance is not part of it."""
    try:
        content = files.read_json(path)
    except ArchiveUnusable:
        checked.wrong(UNREADABLE, path, "is not a readable manifest")
        return
    evidence = {name: value for name, value in content.items() if name not in {*provenance(), ENTRY}}
    if path.stem != f"{str(evidence.get('model'))[:10]}-{digest(evidence)[:10]}":
        checked.wrong(EDITED, path, "was edited: its name does not agree with its content")


def _report(path: Place, content: dict[str, Any], checked: VerifiedPart) -> None:
    """A finding, or a remark where the file was written just now."""
    with suppress(ValueError, TypeError):
        if abs(datetime.now(UTC) - datetime.fromisoformat(str(content.get("when", "")))) < JUST_NOW:
            what = "is not in the chain yet: its writer is still active, or was killed a moment ago"
            checked.remarks.append(f"{checked.name(path)} {what}")
            return
    checked.wrong(UNCHAINED, path, f"is in no entry of the archive's chain: {REMEDY}")


def check_shard(shard: Place, checked: VerifiedPart) -> VerifiedPart:
    """Check the units of one part of the ledger."""
    known: dict[Place, str] = {}
    for folder in sorted((folder for folder in shard.iterdir() if folder.is_dir()), key=lambda folder: folder.name):
        before = ""
        names = sorted(path.name for path in folder.iterdir() if path.suffix == ".json" and is_number(path.stem))
        for count, name in enumerate(names, 1):
            path = folder / name
            if name != f"{count:06d}.json":
                checked.wrong(MISSING, folder / f"{count:06d}.json", "is missing, later events of the unit exist")
                break
            manifest = checked.manifest(path, SCHEMA)
            if manifest is None:
                break
            content, file_hash = manifest
            if content.get("previous") != before and count > 1:
                checked.wrong(EDITED, folder / names[count - 2], f"is not the event that {name} refers to")
            if folder_of(str(content.get("serial"))) != checked.name(folder).replace("\\", "/"):
                checked.wrong(EDITED, path, f"names unit {content.get('serial')!r}, which has another folder")
            if content.get("sequence") != count:
                checked.wrong(EDITED, path, f"says that it is event {content.get('sequence')!r} of its unit")
            _check_certified(path, content, known, checked)
            before = file_hash
    return checked


def _check_certified(path: Place, content: dict[str, Any], known: dict[Place, str], checked: VerifiedPart) -> None:
    """Compare the evidence of a certificate with the files of its run."""
    if content.get("action") == "revoke":
        return
    run = checked.root / "runs" / Path(str(content.get("run"))).name
    for name, expected in checked.named(content, "evidence", path).items():
        manifest = run / f"{name}.json"
        if not (actual := _hash(manifest, known)):
            checked.wrong(MISSING, manifest, f"is missing, certificate {checked.name(path)} is based on it")
        elif actual != expected:
            checked.wrong(EDITED, manifest, f"is not the manifest that certificate {checked.name(path)} is based on")
    # earlier versions stated the empty coefficients of a dynamic test
    further = () if STATIC in str(content.get("covers", STATIC)).split() else ("procedure_results",)
    tables = [run / f"{name}.json" for name in ("coefficients", *further)]
    with suppress(ArchiveUnusable):  # the check of the run reports it
        present = [files.read_json(table).get("sha256") for table in tables if _hash(table, known)]
        if present and content.get("coefficients") not in present:
            checked.wrong(CHANGED, tables[-1], f"is of another table than certificate {checked.name(path)} states")


def _hash(path: Place, known: dict[Place, str]) -> str:
    """Hash of a file, computed once; empty where it is not there."""
    if path not in known:
        known[path] = files.sha256(path) if path.is_file() else ""
    return known[path]
