"""``tumbleline archive``: queries, differences between runs, signing key, leftovers, compaction, backup and restore."""

import csv
import io
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

from inertial.counts import number_of, size_text
from pipelines.archive import Archive, signatures
from pipelines.cli.archive_diff import diff
from pipelines.cli.groups import group
from pipelines.cli.options import ArchiveOption, JsonOption, argument, option
from pipelines.cli.printing import (
    cell,
    conclude,
    give,
    is_standard_output,
    print_json,
    print_table,
    print_text,
    publish,
    refuse_standard_output,
    say,
)
from schemas.errors import WrongUse

PART = "Certificates, trace, audit"
ORDER = 460
SUMMARY = "Query the archive, compare its runs, and maintain it: key, compaction, backup."
EXAMPLES = (
    "tumbleline archive query 'SELECT * FROM units' --output units.csv",
    "tumbleline archive backup /mnt/copy --database /mnt/copies",
)
EXAMPLES_OF = {
    "query": (
        "tumbleline archive query 'SELECT station, count(*) AS runs FROM runs GROUP BY station'",
        "tumbleline archive query 'SELECT * FROM units' --output units.csv",
    ),
    "diff": ("tumbleline archive diff latest RE-RUN", "tumbleline archive diff RUN-A RUN-B --all"),
    "compact": ("tumbleline archive compact", "tumbleline archive compact --until 2026-05-01"),
    "clean": ("tumbleline archive clean --dry-run", "tumbleline archive clean --archive /srv/archive"),
    "key": ("tumbleline archive key", "tumbleline archive key --public"),
    "backup": (
        "tumbleline archive backup /mnt/copy",
        "tumbleline archive backup /mnt/copy --database /mnt/copies --keep 30",
    ),
    "restore": (
        "tumbleline archive restore /mnt/copy --archive /srv/restored",
        "tumbleline archive restore /mnt/copy --archive /srv/restored --database orchestrator.db",
    ),
}
"""Of the subcommands."""
MANY = 100


def query(
    sql: Annotated[str, argument("SQL", "One SELECT, for instance 'SELECT count(*) FROM units'.")],
    output: Annotated[
        Path | None,
        option("--output -o FILE.csv", "Comma-separated values in this file, or with - on standard output."),
    ] = None,
    archive: ArchiveOption = None,
    *,
    as_json: JsonOption = False,
    compact: Annotated[
        bool,
        option("--index/--no-index", "Read coefficients and figures from the index, or from the files of every run."),
    ] = True,
) -> None:
    """Query the archive in SQL: DuckDB on its Parquet files, read only.

    Views: runs, units, parameters, station, coefficients, figures, calibrations, and every table of the runs (dwells, residuals,
    grades, verification, noise, …) with the run in the first column.
    """
    from pipelines.audit.sql import ask

    printed = is_standard_output(output, "archive query", as_json=as_json)
    store = Archive(archive)
    store.refuse_misnamed(archive)
    answer = ask(store, sql, compact=compact)
    if output is not None:
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(answer.columns)
        writer.writerows(answer.rows)
        print_text(text.getvalue()) if printed else publish(output, text.getvalue(), "answer")
    if as_json:
        print_json({"columns": list(answer.columns), "rows": answer.documents()})
    if as_json or output is not None:
        return
    print_table(
        list(answer.columns), [["" if value is None else cell(value) for value in row] for row in answer.rows[:MANY]]
    )
    if len(answer.rows) > MANY:
        say(f"{number_of(len(answer.rows) - MANY, 'more row')}; print all rows with --json or --output -")


def clean(
    archive: ArchiveOption = None,
    *,
    only_look: Annotated[bool, option("--dry-run", "Show what would be removed, and change nothing.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Remove temporary files of killed processes, and add finished runs to the chain of hashes; files in use are not touched."""
    from pipelines.archive.cleaning import clean as cleaned

    store = Archive(archive)
    store.refuse_none()
    done = cleaned(store, only_look=only_look)
    word = "found" if only_look else "removed"
    lines = [
        *(f"{word}  {path}" for path in done.removed),
        *(f"in use   {path}" for path in dict.fromkeys(done.busy)),
        *(f"sealed   {run}" for run in done.sealed),
        f"{number_of(len(done.removed), 'leftover')} of killed writers {word} ({size_text(done.bytes)})",
    ]
    if done.anchored:
        lines.append(f"{number_of(done.anchored, 'calibration')} added to the chain")
    give({"archive": str(store.root), "only_looked": only_look, **asdict(done)}, lines, as_json=as_json)


def key(
    output: Annotated[
        Path | None, option("--output FILE", "File of the private key; default: in the user's configuration folder.")
    ] = None,
    *,
    public: Annotated[bool, option("--public", "Show the public key of the existing key; make no key.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Make the key that signs manifests, outside the archive, and show its public key."""
    refuse_standard_output(output, "archive key", "a private key is never printed")
    path = output or (signatures.key_file() if public else signatures.default_key_file())
    if path is None:
        raise WrongUse("archive key: no key exists, one is needed; make it with 'tumbleline archive key'")
    if public:
        made = signatures.private_key(path).public_key()
    else:
        within = next((folder for folder in path.resolve().parents if (folder / "archive.json").is_file()), None)
        if within is not None:
            raise WrongUse(
                f"archive key: {path} lies in archive {within}, a place outside it is needed; give another with --output"
            )
        made = signatures.make_key(path)
    name, hexadecimal = signatures.name_of(made), made.public_bytes_raw().hex()
    lines = [f"key      {name}", f"public   {hexadecimal}", f"private  {path}"]
    if output is not None and not public:
        lines.append(f"to sign with this key, set TUMBLELINE_SIGNING_KEY={path}")
    give({"name": name, "public": hexadecimal, "private_file": str(path)}, lines, as_json=as_json)


def backup(
    target: Annotated[str, argument("COPY", "Folder or address of the copy: empty, or an earlier copy.")],
    archive: ArchiveOption = None,
    database: Annotated[
        Path | None, option("--database DIR", "Also copy the database of the orchestrator into this folder.")
    ] = None,
    keep: Annotated[int, option("--keep", "Number of copies of the database to keep.", min=1)] = 14,
    *,
    as_json: JsonOption = False,
) -> None:
    """Copy the archive to another disk or store, also during runs; a repeated copy adds only what is new.

    The database of the orchestrator is that of PREFECT_SERVER_DATABASE_CONNECTION_URL (PostgreSQL), else prefect.db in
    PREFECT_HOME. It holds the history of runs only; the archive does not need it.
    """
    from pipelines.archive.backup import copy_archive
    from pipelines.orchestrator.database import copy_into

    source, copy = Archive(archive), Archive(target)
    made = copy_into(database, keep) if database is not None else None
    done = copy_archive(source, copy)
    file = None if made is None else str(made)
    document = {"archive": str(source.root), "copy": str(copy.root), "database": file, **asdict(done)}
    lines = [f"{number_of(done.files, 'file')} copied ({size_text(done.bytes)}), {done.present} already there"]
    give(document, [*lines, *([f"database  {file}"] if file else [])], as_json=as_json)


def compact(
    archive: ArchiveOption = None,
    until: Annotated[str, option("--until DATE", "Only runs that began before this day; default: all.")] = "",
    *,
    as_json: JsonOption = False,
) -> None:
    """Put the files of finished runs, their captures and the calibrations into a few large files, one for each month.

    Refused while a run is being written. Nothing changes for any other command: hashes, chain and signatures are those of the
    single files, which 'unzip' of the files in packed/ restores. Reports stay single files.
    """
    from datetime import date

    from pipelines.archive.compaction import compact as compacted
    from pipelines.audit.index import up_to_date

    try:
        day = date.fromisoformat(until).isoformat() if until else ""
    except ValueError:
        raise WrongUse(f"archive compact: --until {until!r} is no date, one such as 2026-05-01 is needed") from None
    store = Archive(archive)
    store.refuse_none()
    done = compacted(store, day)
    up_to_date(store)
    packed = f"{number_of(done.packed, 'file')} packed ({size_text(done.bytes)})"
    lines = [
        *(f"written  packed/{name}" for name in done.packs),
        *(f"kept     {name}: changed, or in use; the next compaction packs it" for name in done.kept),
        *(f"open     {name}: not finished, left as it is" for name in done.unfinished),
        f"{packed}, {number_of(done.freed, 'single file')} removed",
    ]
    give({"archive": str(store.root), **asdict(done)}, lines, as_json=as_json)


def restore(
    source: Annotated[str, argument("COPY", "Folder or address of the copy.")],
    archive: ArchiveOption = None,
    database: Annotated[
        Path | None, option("--database FILE", "Also restore the database of the orchestrator from this file.")
    ] = None,
    *,
    as_json: JsonOption = False,
) -> None:
    """Copy an archive back into an empty folder and verify it; exit 1 where the verification has findings.

    Stop the server and the workers first. The key that signs the archive is not part of a copy: keep it elsewhere.
    """
    from pipelines.archive.backup import copy_archive
    from pipelines.archive.signatures import public_keys
    from pipelines.integrity.archive import verify
    from pipelines.orchestrator.database import default_database, restore_database

    copy, target = Archive(source), Archive(archive)
    done = copy_archive(copy, target)  # before the database: an archive that is refused leaves the database as it is
    if database is not None:
        restore_database(database, default_database())
    report = verify(target, keys=public_keys(()))
    document = {"archive": str(target.root), "copy": str(copy.root), "whole": report.whole, "head": report.head}
    state = "nothing is wrong" if report.whole else "run 'tumbleline verify' for the findings"
    lines = [
        f"{number_of(done.files, 'file')} copied ({size_text(done.bytes)}), {done.present} already there",
        f"verified: {number_of(report.runs, 'run')}, {state}",
    ]
    conclude({**document, **asdict(done)}, lines, as_json=as_json, passed=report.whole)


app = group(
    SUMMARY,
    {
        "query": query, "diff": diff, "compact": compact, "clean": clean, "key": key, "backup": backup, "restore": restore,
    },
)  # fmt: skip
