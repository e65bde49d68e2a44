"""Archives that somebody forged: what ``verify`` finds, and what certificates, exports, queries and lineage do with them."""

import json
import shutil
from collections.abc import Callable
from datetime import timedelta
from functools import cache
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from capture_double import BRIEF, CaptureDouble, small_job
from long_suites import mostly_slow
from typer.testing import CliRunner, Result

from pipelines.archive import Archive, Run, files, parquet, stage_key
from pipelines.archive.signatures import VARIABLE, make_key, public_keys
from pipelines.audit.index import check_index, up_to_date
from pipelines.audit.sql import ask
from pipelines.certificates import Ledger
from pipelines.certificates.ledger_index import INDEX_FOLDER, histories_of
from pipelines.chain.certify import certify
from pipelines.chain.runner import Runner
from pipelines.cli import app
from pipelines.integrity import seals, verify
from schemas.errors import ArchiveUnusable

FIRST, SECOND = ("A1", "A2"), ("B1", "B2")


def make(folder: Path) -> Path:
    """An archive with two finished runs of different lots, both certified, and its indexes."""
    archive = Archive(folder / "archive")
    for serials in (FIRST, SECOND):
        units = ", ".join(f'"{serial}"' for serial in serials)
        job = small_job(folder, *BRIEF, ('"A1", "A2", "A3"', units))
        runner = Runner(job, archive, measure=CaptureDouble())
        list(runner.all())
        certify(Ledger(archive), runner.run)
    up_to_date(archive)
    return folder / "archive"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """The archive without a key or the one with a key, made when it is first asked for, and the key."""
    folder = tmp_path_factory.mktemp("made")
    make_key(folder / "own.key")

    @cache
    def of(name: str) -> Path:
        if name == "own":
            return folder / "own.key"
        (folder / name).mkdir()
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv(VARIABLE, str(folder / "own.key") if name == "signed" else "")
            return make(folder / name)

    return of


@pytest.fixture(params=mostly_slow(["unsigned", "signed"], "unsigned"))
def root(request: pytest.FixtureRequest, made: Callable[[str], Path], tmp_path: Path, monkeypatch) -> Path:
    """A copy of one of the two, looked at by its owner."""
    monkeypatch.setenv(VARIABLE, str(made("own")) if request.param == "signed" else "")
    monkeypatch.setattr(seals, "JUST_NOW", timedelta(0))
    shutil.copytree(made(request.param), tmp_path / "archive")
    return tmp_path / "archive"


def runs(root: Path) -> tuple[Run, Run]:
    archive = Archive(root)
    by_units = {info.units: archive.run(info.id) for info in archive.runs()}
    return by_units[FIRST], by_units[SECOND]


def write(path: Path, content: dict, by: str = "") -> None:
    """A manifest as somebody with another key, or with none, would write it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(VARIABLE, by)
        path.write_bytes(files.manifest_bytes(content) if by else files.json_bytes(content))


def table(run: Run, name: str, **columns: object) -> dict:
    """Other values in a table, and its manifest with the hash to match."""
    data = parquet.table_bytes(name, run.table(name).assign(**columns), 1)
    (run.path / f"{name}.parquet").write_bytes(data)
    return {**run.manifest(name), "sha256": files.hash_of(data)}


def moved(run: Run) -> dict:
    return table(run, "coefficients", value=lambda t: t["value"] * 1.01)


# -- what a forger does; each with the words of the finding that must tell, and the path that it must be told of


def coefficients_alone(root: Path) -> str:
    moved(runs(root)[0])
    return "coefficients.parquet"


def coefficients_with_their_manifest(root: Path) -> str:
    run = runs(root)[0]
    write(run.path / "coefficients.json", moved(run))
    return "coefficients.json"


def coefficients_with_all_hashes_of_the_run(root: Path) -> str:
    """Every manifest that names another is written anew with the hash to match, and sealed.json with them."""
    run = runs(root)[0]
    write(run.path / "coefficients.json", moved(run))
    for _ in range(8):  # until nothing changes any more
        for path in sorted(run.path.glob("*.json")):
            content = json.loads(path.read_text())
            if path.name == "sealed.json":
                content["files"] = {
                    name: files.sha256(root / name) if name.startswith("runs/") else value
                    for name, value in content["files"].items()
                }
            else:
                for name in content.get("inputs", {}):
                    if (run.path / f"{name}.parquet").is_file():
                        content["inputs"][name] = files.sha256(run.path / f"{name}.parquet")
                for name in content.get("manifests", {}):
                    if (run.path / f"{name}.json").is_file():
                        content["manifests"][name] = files.sha256(run.path / f"{name}.json")
                if "key" in content:
                    content["key"] = stage_key(*(content[k] for k in ("stage", "inputs", "parameters", "code")))
            write(path, content)
    return "coefficients.json"


def a_failed_unit_that_passes(root: Path) -> str:
    run = runs(root)[0]
    write(run.path / "grades.json", table(run, "grades", grade="forged"))
    return "grades.json"


def an_earlier_day_of_measurement(root: Path) -> str:
    run = runs(root)[0]
    write(run.path / "readings.json", {**run.manifest("readings"), "when": "2020-01-01T00:00:00.000+00:00"})
    return "readings.json"


def other_limits(root: Path) -> str:
    run = runs(root)[0]
    write(run.path / "run.json", {**run.about, "limits": {**run.about["limits"], "validity_months": 120}})
    return "run.json"


def exchange(first: Path, second: Path) -> None:
    first.rename(first.with_name("aside"))
    second.rename(first)
    first.with_name("aside").rename(second)


def exchanged_run_folders(root: Path) -> str:
    exchange(*(run.path for run in runs(root)))
    return "sealed.json"


def exchanged_captures(root: Path) -> str:
    exchange(*(root / "captures" / run.about["capture"] for run in runs(root)))
    return "complete.json"


def tables_of_another_run(root: Path) -> str:
    first, second = runs(root)
    for name in ("coefficients.parquet", "coefficients.json"):
        shutil.copy(second.path / name, first.path / name)
    return "coefficients.json"


def a_manifest_that_is_gone(root: Path) -> str:
    (runs(root)[0].path / "coefficients.json").unlink()
    return "coefficients.json"


def signatures_of_a_foreign_key(root: Path) -> str:
    run = runs(root)[0]
    make_key(root.parent / "foreign.key")
    write(run.path / "coefficients.json", moved(run), str(root.parent / "foreign.key"))
    return "coefficients.json"


def a_capture_outside(root: Path) -> str:
    run = runs(root)[0]
    shutil.copytree(root / "captures" / run.about["capture"], root.parent / "outside")
    write(run.path / "run.json", {**run.about, "capture": "../../outside"})
    return "run.json"


def a_record_outside(root: Path) -> str:
    run = runs(root)[0]
    place = root / "captures" / run.about["capture"] / "00000" / "record.json"
    content = json.loads(place.read_text())
    write(place, {**content, "content": {**content["content"], "../../../../secret.txt": "0" * 64}})
    return "record.json"


OF_A_RUN = (
    coefficients_alone, coefficients_with_their_manifest, coefficients_with_all_hashes_of_the_run, a_failed_unit_that_passes,
    an_earlier_day_of_measurement, other_limits, exchanged_run_folders, exchanged_captures, tables_of_another_run,
    a_manifest_that_is_gone, signatures_of_a_foreign_key,
    a_capture_outside, a_record_outside,
)  # fmt: skip


def an_event_with_another_until(root: Path) -> str:
    place = min(root.glob("calibrations/*/*/000001.json"))
    write(place, {**json.loads(place.read_text()), "until": "2199-01-01"})
    return str(place.relative_to(root))


def a_certificate_copied_to_another_unit(root: Path) -> str:
    first, second = sorted(root.glob("calibrations/*/*/000001.json"))[:2]
    shutil.copy(first, second)
    return str(second.relative_to(root))


def a_certificate_from_nowhere(root: Path) -> str:
    place = min(root.glob("calibrations/*/*/000001.json"))
    other = place.with_name("000002.json")
    write(other, {**json.loads(place.read_text()), "sequence": 2, "previous": files.sha256(place), "ends": []})
    return str(other.relative_to(root))


def a_chain_written_anew_behind_other_coefficients(root: Path) -> str:
    coefficients_with_all_hashes_of_the_run(root)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(VARIABLE, "")
        shutil.rmtree(root / "chain")
        for run in runs(root):
            (run.path / "sealed.json").unlink()
            run.seal()
    return "coefficients.json"  # the certificate names other coefficients


def an_edited_part_of_the_index(root: Path, *, sealed: bool = False) -> str:
    [part] = [path for path in (root / "index").iterdir() if (path / "seal.json").is_file()]
    place = part / "coefficients.parquet"
    old = pq.read_table(place)
    column = old.schema.get_field_index("value")
    pq.write_table(old.set_column(column, "value", pa.array([0.0] * len(old))), place)
    if sealed:
        hashes = json.loads((part / "seal.json").read_text())["files"]
        write(part / "seal.json", {"files": {**hashes, place.name: files.sha256(place)}})
    return f"index/{part.name}"


def an_edited_part_of_the_index_with_its_seal(root: Path) -> str:
    return an_edited_part_of_the_index(root, sealed=True)


def an_edited_list(root: Path) -> str:
    content = {
        "runs": {runs(root)[0].id: [0, ["x", "x", "x", ["x"], "x", True, []]]},
        "seal": {"files": {"runs": "0" * 64}},
    }
    write(root / "index" / "list.json", content)
    return "index/list.json"


OF_THE_WHOLE = (
    an_event_with_another_until, a_certificate_copied_to_another_unit, a_certificate_from_nowhere,
    a_chain_written_anew_behind_other_coefficients, an_edited_part_of_the_index,
    an_edited_part_of_the_index_with_its_seal, an_edited_list,
)  # fmt: skip


def typed(root: Path, *words: str) -> Result:
    return CliRunner().invoke(app, [*words, "--archive", str(root)])


def findings(root: Path) -> list[str]:
    keys = public_keys()
    report = verify(Archive(root), keys=keys, demanded=bool(keys), also=[check_index])
    return [one.path for one in report.checked.findings]


def test_the_archive_is_whole_before_it_is_forged(root: Path) -> None:
    assert findings(root) == []
    assert typed(root, "verify").exit_code == 0


TWICE = (exchanged_run_folders, exchanged_captures)
"""Two folders."""


SIGNED = (
    coefficients_with_all_hashes_of_the_run, signatures_of_a_foreign_key, an_event_with_another_until,
    a_chain_written_anew_behind_other_coefficients, an_edited_part_of_the_index_with_its_seal,
)  # fmt: skip
"""Forgeries that are as whole as the archive was: only the key of the signed archive tells them, or tells them otherwise."""


@pytest.mark.parametrize(
    ("root", "forge"),
    [
        *(("unsigned", forge) for forge in (*OF_A_RUN, *OF_THE_WHOLE)),
        *(pytest.param("signed", forge, marks=pytest.mark.slow) for forge in SIGNED),
    ],
    indirect=["root"],
    ids=lambda one: getattr(one, "__name__", one),
)
def test_a_forgery_is_found(root: Path, forge: Callable[[Path], str]) -> None:
    wanted = forge(root)
    paths = findings(root)
    assert any(wanted in path for path in paths), paths
    # two acts, and without the key each entry is one more
    if forge is not a_chain_written_anew_behind_other_coefficients:
        assert len(paths) == (2 if forge in TWICE else 1), paths


def a_link_to_a_table_elsewhere(root: Path) -> None:
    place = runs(root)[0].path / "dwells.parquet"
    place.rename(root.parent / "dwells.parquet")
    place.symlink_to(root.parent / "dwells.parquet")


def a_link_to_a_run_elsewhere(root: Path) -> None:
    place = runs(root)[0].path
    shutil.move(place, root.parent / "elsewhere")
    place.symlink_to(root.parent / "elsewhere")


def a_run_copied_in_without_its_seal(root: Path) -> None:
    path = runs(root)[0].path
    shutil.copytree(path, root.parent / "copy")
    shutil.rmtree(path)
    (root.parent / "copy" / "sealed.json").unlink()
    (root.parent / "copy").rename(path)


LINKS_AND_COPIES = (a_link_to_a_table_elsewhere, a_link_to_a_run_elsewhere, a_run_copied_in_without_its_seal)
UNLIKE = (
    *LINKS_AND_COPIES, coefficients_with_their_manifest, exchanged_run_folders, a_manifest_that_is_gone, a_capture_outside,
)  # fmt: skip
"""Each refused in a way of its own; of the others it is enough that ``verify`` finds them, by which a certificate is refused."""


@pytest.mark.parametrize("root", ["unsigned"], indirect=True)  # where no signature helps
@pytest.mark.parametrize("forge", mostly_slow([*OF_A_RUN, *LINKS_AND_COPIES], *UNLIKE), ids=lambda one: one.__name__)
def test_a_forged_run_is_not_certified(root: Path, forge: Callable[[Path], object]) -> None:
    name = runs(root)[0].id
    before = sorted(root.glob("calibrations/*/*/*.json"))
    forge(root)
    done = typed(root, "certificate", "issue", name, "--until", "6m")
    assert isinstance(done.exception, ArchiveUnusable), done.output
    assert sorted(root.glob("calibrations/*/*/*.json")) == before


def test_one_edited_file_gives_one_finding_with_its_consequences(root: Path) -> None:
    for name in ("dwells", "coefficients", "run"):
        place = runs(root)[0].path / f"{name}.json"
        data = place.read_bytes()
        place.write_bytes(files.json_bytes({**json.loads(data), "who": "somebody else"}))
        [finding] = verify(Archive(root), keys=public_keys()).checked.findings
        assert finding.path.endswith(f"/{name}.json")
        assert finding.kind == ("signature" if public_keys() else "edited")
        assert len(finding.consequences) >= 2
        place.write_bytes(data)
    shutil.rmtree(runs(root)[0].path)
    [run, *_] = verify(Archive(root), keys=public_keys()).checked.findings
    assert (run.kind, len(Path(run.path).parts)) == ("missing", 2)


def test_numbers_that_moved_under_a_certificate_leave_by_no_door(root: Path) -> None:
    """A table that was removed is made again under a library that moves a number; the certificate is of the one before."""
    run = runs(root)[0]
    (run.path / "coefficients.json").write_bytes(files.manifest_bytes(moved(run)))
    for words in (
        ("export", run.id),
        ("export", run.id, "--format", "c"),
        ("show", run.id, "--report"),
        ("show", "A1"),
    ):
        done = typed(root, *words)
        assert isinstance(done.exception, ArchiveUnusable), (words, done.output)
        assert "another table coefficients" in str(done.exception) or "is not the table of certificate" in str(
            done.exception
        )
        assert "certificate A1/1" not in done.stdout


def test_query_and_audit_notice_an_edit_of_the_index_and_answer_from_the_runs(root: Path, caplog) -> None:
    question = "SELECT sum(abs(value)) FROM coefficients"
    before = ask(Archive(root), question).rows
    for words in (("archive", "query", question), ("audit", "--workers", "1")):
        place = an_edited_part_of_the_index(root)
        caplog.clear()
        typed(root, *words)
        assert place in caplog.text
        assert "was edited since it was made" in caplog.text
        assert ask(Archive(root), question).rows == before
    if public_keys():  # a seal to match is noticed where a key is configured
        an_edited_part_of_the_index_with_its_seal(root)
        assert ask(Archive(root), question).rows == before


def test_noted_events_that_were_edited_are_read_again(root: Path, caplog) -> None:
    first = sorted(map(repr, histories_of(root).units))
    Ledger(root).revoke("A1", "a reason", certificate=1)
    (root / INDEX_FOLDER).mkdir(parents=True, exist_ok=True)
    digit = min(root.glob("calibrations/*/*")).parent.name[0]
    (root / INDEX_FOLDER / f"{digit}.noted").write_bytes(b'{"files": {"data": "00"}}\nPAR1')
    assert len(histories_of(root).units) == len(first)
    assert "was edited since it was made" in caplog.text


@pytest.mark.parametrize("root", ["unsigned"], indirect=True)
def test_a_crate_of_a_foreign_archive_stays_in_its_folder(root: Path, tmp_path: Path) -> None:
    run = runs(root)[0]
    place, crates, recipe = run.path / "run.json", tmp_path / "crates", run.about["recipe"]
    data = place.read_bytes()
    for number, name in enumerate(("../../../x", "/etc/x", "a/b", "..", "a\\b")):
        for entry, value in (("recipe", {**recipe, "name": name}), ("capture", name), ("parents", [name])):
            write(place, {**json.loads(data), entry: value})
            outside = {path for path in tmp_path.rglob("*") if not path.is_relative_to(crates)}
            done = typed(root, "lineage", run.id, "--output", str(crates / f"{entry}{number}"))
            assert {path for path in tmp_path.rglob("*") if not path.is_relative_to(crates)} == outside
            if entry != "recipe":
                assert isinstance(done.exception, ArchiveUnusable)
                assert "a plain name without '/' and '..' is needed" in str(done.exception)
            place.write_bytes(data)
