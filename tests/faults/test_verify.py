"""What was changed, lost, edited or forged in an archive is found; what is whole is not accused."""

import json
import shutil
from collections.abc import Callable
from datetime import timedelta
from functools import cache
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from capture_double import BRIEF, CaptureDouble, PulledPlug, finished_run, small_job
from each import each
from in_process import document_of, refused, text_of
from long_suites import mostly_slow
from typer.testing import CliRunner, Result

from pipelines.archive import Archive, Run, files, parquet, stage_key
from pipelines.archive.signatures import VARIABLE, make_key, name_of, public_keys
from pipelines.audit.index import check_index, up_to_date
from pipelines.audit.sql import ask
from pipelines.certificates import Ledger
from pipelines.certificates.ledger_index import INDEX_FOLDER, histories_of
from pipelines.chain.certify import certify
from pipelines.chain.chain import ORDER
from pipelines.chain.runner import Runner
from pipelines.cli import app
from pipelines.integrity import Report, seals, verify
from pipelines.integrity import runs as run_checks
from pipelines.integrity.findings import VerifiedPart
from schemas.errors import ArchiveUnusable, WrongUse
from schemas.event import Event


def one_run(folder: Path) -> None:
    """An archive with a finished run whose capture was interrupted, certified, one unit of it revoked."""

    def noting(job, records, progress) -> None:
        records.events.note(Event(1.0, "suspended", 3, "the door was open", "measured again"))
        CaptureDouble()(job, records, progress)

    archive = Archive(folder / "archive")
    runner = Runner(small_job(folder, *BRIEF), archive, measure=noting)
    list(runner.all())
    certify(Ledger(archive), runner.run)
    Ledger(archive).revoke("A2", "dropped")


def two_runs(folder: Path) -> None:
    """An archive with two finished runs of different lots, both certified, and its indexes."""
    archive = Archive(folder / "archive")
    for serials in ('"A1", "A2"', '"B1", "B2"'):
        runner = Runner(small_job(folder, *BRIEF, ('"A1", "A2", "A3"', serials)), archive, measure=CaptureDouble())
        list(runner.all())
        certify(Ledger(archive), runner.run)
    up_to_date(archive)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """The folder of an archive and a key, by how many runs it has and whether they are signed; each made once."""

    @cache
    def of(kind: str) -> Path:
        folder = tmp_path_factory.mktemp(kind.replace(" ", "-"))
        make_key(folder / "own.key")
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv(VARIABLE, str(folder / "own.key") if "signed" in kind else "")
            one_run(folder) if "one" in kind else two_runs(folder)
        return folder

    return of


@pytest.fixture
def copied(made: Callable[[str], Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], Path]:
    """A copy of one of them, looked at by its owner."""

    def of(kind: str) -> Path:
        monkeypatch.setenv(VARIABLE, str(made(kind) / "own.key") if "signed" in kind else "")
        shutil.copytree(made(kind) / "archive", tmp_path / "archive")
        return tmp_path / "archive"

    return of


@pytest.fixture
def copy(copied: Callable[[str], Path]) -> Path:
    return copied("one")


@pytest.fixture
def signed_copy(copied: Callable[[str], Path]) -> Path:
    return copied("one signed")


@pytest.fixture(params=mostly_slow(["two", "two signed"], "two"))
def root(request: pytest.FixtureRequest, copied: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(seals, "JUST_NOW", timedelta(0))
    return copied(request.param)


def verified(root: Path, **more: object) -> Report:
    return verify(Archive(root), keys=public_keys(), **more)


def found(root: Path, **more: object) -> list[tuple[str, str]]:
    """Kind and last part of the path of each finding."""
    return [(finding.kind, Path(finding.path).name) for finding in verified(root, **more).checked.findings]


def run_of(root: Path) -> Run:
    return Archive(root).run("latest")


def one(root: Path, pattern: str) -> Path:
    paths = sorted(root.glob(pattern))
    assert paths, pattern
    return paths[0]


def flip(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)


def test_a_whole_archive_is_whole_is_read_by_run_and_says_that_it_is_unsigned(copy: Path, made, monkeypatch) -> None:
    report = verified(copy)
    assert (report.checked.findings, report.checked.remarks) == ([], [])
    assert report.trust.startswith("UNSIGNED")
    assert report.checked.rows > len(run_of(copy).table("samples"))
    assert len(report.head) == 64
    named = verify(Archive(copy), [run_of(copy).id], keys={})
    assert (named.runs, named.captures, named.checked.findings) == (1, 1, [])
    monkeypatch.setenv(VARIABLE, str(made("one") / "own.key"))
    [finding] = verified(copy, demanded=True).checked.findings
    assert finding.kind == "signature"
    assert "manifests: each is not signed" in finding.message


EVERY_KIND = (
    "archive.json", "captures/*/complete.json", "captures/*/state/*.bin", "captures/*/00001/record.json",
    "captures/*/events/00000.json", "captures/*/00000/samples.parquet", "captures/*/00003/readings.parquet",
    "captures/*/00003/history.parquet", "runs/*/run.json", "runs/*/sealed.json", "runs/*/report.html", "runs/*/report.json",
    "runs/*/soaks.json", "runs/*/coefficients.json", "runs/*/coefficients.parquet", "runs/*/grades.parquet",
    "runs/*/dwells.json", "calibrations/*/*/000001.json", "calibrations/*/*/000002.json", "chain/*/000000001.json",
)  # fmt: skip


def test_a_file_of_every_kind_that_was_changed_cut_or_taken_away_is_named(copy: Path) -> None:
    """One bit, half of the file or the whole of it: nothing that the archive wrote can be without it."""
    for number, pattern in enumerate(EVERY_KIND):
        path = one(copy, pattern)
        data, name = path.read_bytes(), str(path.relative_to(copy))
        flip(path)
        found = {(f.path, f.kind) for f in verified(copy).checked.findings}
        assert any(known == name for known, _ in found), (name, found)
        assert path.suffix in {".json", ".bin"} or (name, "changed") in found, (name, found)
        path.write_bytes((data[: len(data) // 2], b"")[number % 2])
        assert name in {f.path for f in verified(copy).checked.findings}, name
        path.unlink()
        kinds = {f.kind for f in verified(copy).checked.findings if name.startswith(f.path)}
        assert "missing" in kinds or (kinds and path.name == "sealed.json"), (name, kinds)
        path.write_bytes(data)
    assert verified(copy).whole


def test_a_run_that_was_cut_off_is_told_and_is_not_wrong_and_a_state_that_was_changed_is_not_gone_on_from(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(VARIABLE, "")
    measured_on(tmp_path, 4)
    report = verified(tmp_path / "archive")
    assert report.checked.findings == []
    for words in ("4 records are stored", "give its command again"):
        assert any(words in remark for remark in report.checked.remarks)
    flip(one(tmp_path / "archive", "captures/*/state/*.bin"))
    [capture] = (tmp_path / "archive" / "captures").iterdir()
    with pytest.raises(ArchiveUnusable, match=r"is not the station's state that record 00003 was stored with"):
        Archive(tmp_path / "archive").capture(capture.name).last_state()


def test_a_chain_that_was_written_anew_lacks_the_entry_noted_elsewhere(copy: Path) -> None:
    head = verified(copy).head
    assert verified(copy, head=head).whole
    shutil.rmtree(copy / "chain")
    Archive(copy).run("latest").path.joinpath("sealed.json").unlink()
    Archive(copy).run("latest").seal()
    assert verified(copy).whole
    assert [f.kind for f in verified(copy, head=head).checked.findings] == ["missing"]


@pytest.mark.slow
def test_a_signed_archive_has_the_same_tables_and_says_by_which_key(
    made: Callable[[str], Path], signed_copy: Path, tmp_path: Path
) -> None:
    for path in run_of(made("one") / "archive").path.glob("*.parquet"):
        assert (run_of(signed_copy).path / path.name).read_bytes() == path.read_bytes()
    report = verified(signed_copy)
    assert report.whole
    [name] = public_keys([])
    assert report.trust == f"{report.checked.manifests} of {report.checked.manifests} manifests signed by {name}"
    other = make_key(tmp_path / "other.key")
    report = verify(Archive(signed_copy), keys={name_of(other): other}, demanded=True)
    assert [f.kind for f in report.checked.findings] == ["signature"]
    assert "by a key that is not known here" in verify(Archive(signed_copy), keys={name_of(other): other}).trust
    place = one(signed_copy, "runs/*/grades.json")
    place.write_bytes(files.json_bytes({**json.loads(place.read_text()), "who": "somebody else"}))
    assert ("signature", "grades.json") in found(signed_copy)  # the signature is false now


@each([None, b"no key", b""])
def test_a_key_that_cannot_be_used_stops_writing_with_one_message(
    content: bytes | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place = tmp_path / "signing.key"
    if content is not None:
        place.write_bytes(content)
    monkeypatch.setenv(VARIABLE, str(place))
    with pytest.raises(ArchiveUnusable, match="signing key"):
        Runner(small_job(tmp_path), Archive(tmp_path / "archive"), measure=CaptureDouble())


def test_the_command_leaves_with_status_1_where_something_is_wrong(copy: Path) -> None:
    assert document_of("verify", "--archive", copy, status=0)["rows_per_s"] > 0
    flip(one(copy, "runs/*/coefficients.parquet"))
    assert document_of("verify", "--archive", copy, status=1)["findings"][0]["kind"] == "changed"
    told = text_of("verify", "--archive", copy, status=1)
    assert all(words in told for words in ("coefficients.parquet", "UNSIGNED"))
    assert "holds no archive, one with runs is needed" in refused("verify", "--archive", copy / "chain")


def test_a_foreign_event_in_the_journal_of_a_capture_is_named(copy: Path) -> None:
    one(copy, "captures/*/events/00000.json").with_name("00001.json").write_bytes(b"{}")
    assert found(copy) == [("foreign", "00001.json")]


def test_a_link_of_the_chain_that_was_taken_off_its_end_is_missed_unless_its_writer_may_be_at_work(
    copy: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    max(copy.glob("chain/*/*.json")).unlink()
    report = verified(copy)
    assert report.whole
    assert any("is not in the chain yet: its writer is still active" in remark for remark in report.checked.remarks)
    monkeypatch.setattr(seals, "JUST_NOW", timedelta(0))
    for count in (1, 4):
        findings = {(f.kind, f.path) for f in verified(copy).checked.findings}
        assert {kind for kind, _ in findings} == {"unchained"}
        assert len({path for _, path in findings}) == count
        max(copy.glob("chain/*/*.json")).unlink()
    assert ("missing", "chain/000000/000000001.json") in {(f.kind, f.path) for f in verified(copy).checked.findings}


def test_a_run_that_was_copied_here_is_named_with_its_seal_and_without(
    copy: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(seals, "JUST_NOW", timedelta(0))
    (tmp_path / "other").mkdir()
    other = finished_run(tmp_path / "other", *BRIEF, ("seed = 5", "seed = 6"))
    other.seal()
    shutil.copytree(other.path, copy / "runs" / other.id)
    shutil.copytree(other.records.path, copy / "captures" / other.records.path.name)
    [finding] = verified(copy).checked.findings
    assert (finding.kind, finding.path) == ("edited", f"runs/{other.id}/sealed.json")
    remedy = "restore both from one copy, or work in the archive that made the run (--archive)"
    assert finding.message.endswith(f"run and chain are not from one archive; {remedy}")
    (copy / "runs" / other.id / "sealed.json").unlink()
    assert found(copy) == [("unchained", "report.json")]


def test_a_capture_whose_run_was_never_here_and_two_exchanged_records_are_named(copy: Path) -> None:
    [capture] = (copy / "captures").iterdir()
    shutil.copytree(capture, copy / "captures" / "f00")
    assert [(f.kind, f.path) for f in verified(copy).checked.findings] == [("missing", "captures/f00")]
    shutil.rmtree(copy / "captures" / "f00")
    first, second = one(copy, "captures/*/00003"), one(copy, "captures/*/00004")
    first.rename(first.with_name("aside"))
    second.rename(first)
    first.with_name("aside").rename(second)
    assert {f.path.rpartition("/")[2] for f in verified(copy).checked.findings} == {"00003", "00004"}


def test_a_link_in_place_of_a_file_or_folder_is_named_and_a_folder_of_the_archive_may_lie_on_another_disk(
    copy: Path, tmp_path: Path
) -> None:
    for pattern in ("runs/*/dwells.parquet", "runs/*/grades.json", "runs/*", "captures/*/00002"):
        path = one(copy, pattern)
        path.rename(tmp_path / "elsewhere")
        path.symlink_to(tmp_path / "elsewhere")
        assert ("foreign", str(path.relative_to(copy))) in {(f.kind, f.path) for f in verified(copy).checked.findings}
        path.unlink()
        (tmp_path / "elsewhere").rename(path)
    (copy / "captures").rename(tmp_path / "disk")
    (copy / "captures").symlink_to(tmp_path / "disk")
    assert verified(copy).whole


def test_a_key_is_made_once_for_its_owner_only_and_not_in_an_archive_where_it_is_named(
    copy: Path, tmp_path: Path
) -> None:
    key = tmp_path / "deep" / "signing.key"
    make_key(key)
    assert key.stat().st_mode & 0o777 == 0o600
    with pytest.raises(WrongUse, match="exists, a new file is needed"):
        make_key(key)
    assert "lies in archive" in refused("archive", "key", "--output", copy / "runs" / "signing.key")
    shutil.copy(key, run_of(copy).path / "notes.txt")
    report = verified(copy)
    assert [(f.kind, Path(f.path).name) for f in report.checked.findings] == [("signature", "notes.txt")]
    assert "not written by the archive" in report.checked.remarks[0]


def test_files_of_the_desktop_disturb_nothing_and_are_told(copy: Path) -> None:
    for folder in (copy, *(path for path in copy.rglob("*") if path.is_dir())):
        (folder / ".DS_Store").write_bytes(b"\0\0\0\1Bud1")
    [event] = copy.glob("calibrations/*/*/000002.json")
    (event.parent / "._000001.json").write_bytes(b"\0\5\26\7")
    (copy / "chain" / "²").mkdir()
    (copy / "chain" / "²" / "².json").write_text("{}")
    report = verified(copy)
    assert report.checked.findings == []
    assert ".DS_Store" in report.checked.remarks[0]
    assert len(Ledger(Archive(copy)).calibrations("A2")) == 1
    assert len(Archive(copy).runs()) == 1


@pytest.mark.slow
def test_who_did_not_sign_is_named(signed_copy: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    make_key(tmp_path / "other.key")
    report, link = one(signed_copy, "runs/*/report.json"), max(signed_copy.glob("chain/*/*.json"))
    for path, key in ((report, ""), (link, str(tmp_path / "other.key"))):
        with monkeypatch.context() as patch:
            patch.setenv(VARIABLE, key)
            path.write_bytes(files.manifest_bytes(json.loads(path.read_text())))
    remarks = " ".join(verified(signed_copy).checked.remarks)
    assert "report.json is not signed" in remarks
    assert "is signed with a key that is not known here" in remarks
    demanded = set(found(signed_copy, demanded=True))
    assert {("signature", "report.json"), ("signature", link.name)} <= demanded


OF_ANOTHER_KIND = (5, None, "x", ["a"], {"a": 5})
MANIFESTS = (
    "runs/*/dwells.json", "runs/*/sealed.json", "captures/*/00003/record.json", "captures/*/complete.json",
    "calibrations/*/*/000001.json", "chain/*/000000001.json",
)  # fmt: skip


@pytest.mark.slow
def test_an_entry_of_another_kind_in_a_manifest_is_found_and_stops_nothing(copy: Path) -> None:
    for pattern in MANIFESTS:
        path = one(copy, pattern)
        data = path.read_bytes()
        for name in json.loads(data):
            for value in OF_ANOTHER_KIND:
                path.write_bytes(files.json_bytes({**json.loads(data), name: value}))
                assert verified(copy).checked.findings, (pattern, name, value)
        path.write_bytes(data)


# beside a run in progress ---------------------------------------------------------------------------------------------


def measured_on(folder: Path, records: int) -> None:
    """A run whose capture is measured for so many records more, and then stops."""
    runner = Runner(small_job(folder), Archive(folder / "archive"), measure=CaptureDouble(stop_after=records))
    with pytest.raises(PulledPlug):
        runner.stage(ORDER[0])


def test_a_record_that_is_stored_during_the_check_is_no_finding(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(VARIABLE, "")
    measured_on(tmp_path, 4)
    real, looks = run_checks._check_state, []

    def meanwhile(path: Path, last: tuple, checked: VerifiedPart) -> None:
        looks.append(last[2].name)
        measured_on(tmp_path, 1)  # drops the state that the record of this look refers to
        real(path, last, checked)

    monkeypatch.setattr(run_checks, "_check_state", meanwhile)
    assert verify(Archive(tmp_path / "archive"), keys={}).checked.findings == []
    assert looks == ["00003", "00004"]


def test_what_is_missing_of_a_capture_in_progress_is_found_by_both_looks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(VARIABLE, "")
    measured_on(tmp_path, 4)
    [state] = (tmp_path / "archive" / "captures").glob("*/state/*.bin")
    state.unlink()
    [finding] = verify(Archive(tmp_path / "archive"), keys={}).checked.findings
    assert (finding.kind, Path(finding.path).name) == ("missing", state.name)


# -- archives that somebody forged: what is found, and what certificates, exports, queries, lineage do --------------------


def runs(root: Path) -> list[Run]:
    archive = Archive(root)
    return [archive.run(info.id) for info in sorted(archive.runs(), key=lambda info: info.units)]


def write(path: Path, content: dict, by: str = "") -> None:
    """A manifest as somebody with another key, or with none, would write it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(VARIABLE, by)
        path.write_bytes(files.manifest_bytes(content) if by else files.json_bytes(content))


def moved(run: Run) -> dict:
    """Other coefficients, and their manifest with the hash to match."""
    table = run.table("coefficients")
    data = parquet.table_bytes("coefficients", table.assign(value=table["value"] * 1.01), 1)
    (run.path / "coefficients.parquet").write_bytes(data)
    return {**run.manifest("coefficients"), "sha256": files.hash_of(data)}


# -- what a forger does; each with the words of the finding that must tell, and the path that it must be told of


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
    coefficients_with_their_manifest, coefficients_with_all_hashes_of_the_run, exchanged_run_folders, exchanged_captures,
    tables_of_another_run, a_manifest_that_is_gone, signatures_of_a_foreign_key, a_capture_outside, a_record_outside,
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
    row = [0, ["x", "x", "x", ["x"], "x", True, []]]
    content = {"runs": {runs(root)[0].id: row}, "seal": {"files": {"runs": "0" * 64}}}
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


SIGNED = (
    coefficients_with_all_hashes_of_the_run, signatures_of_a_foreign_key, an_event_with_another_until,
    a_chain_written_anew_behind_other_coefficients, an_edited_part_of_the_index_with_its_seal,
)  # fmt: skip
"""Forgeries that are as whole as the archive was: only the key of the signed archive tells them, or tells them otherwise."""


@pytest.mark.parametrize(
    ("root", "forge"),
    [
        *(("two", forge) for forge in (*OF_A_RUN, *OF_THE_WHOLE)),
        *(pytest.param("two signed", forge, marks=pytest.mark.slow) for forge in SIGNED),
    ],
    indirect=["root"],
    ids=lambda one: getattr(one, "__name__", one),
)
def test_a_forgery_is_found(root: Path, forge: Callable[[Path], str]) -> None:
    wanted = forge(root)
    paths = findings(root)
    assert any(wanted in path for path in paths), paths
    # two folders, two acts; and without the key each entry of the chain is one more
    if forge is not a_chain_written_anew_behind_other_coefficients:
        assert len(paths) == (2 if forge in {exchanged_run_folders, exchanged_captures} else 1), paths


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


LINK_AND_COPY = (a_link_to_a_run_elsewhere, a_run_copied_in_without_its_seal)
UNLIKE = (
    *LINK_AND_COPY, coefficients_with_their_manifest, exchanged_run_folders, a_manifest_that_is_gone, a_capture_outside,
)  # fmt: skip
"""Each refused in a way of its own; of the others it is enough that ``verify`` finds them, by which a certificate is refused."""


@pytest.mark.parametrize("root", ["two"], indirect=True)  # where no signature helps
@pytest.mark.parametrize("forge", mostly_slow([*OF_A_RUN, *LINK_AND_COPY], *UNLIKE), ids=lambda one: one.__name__)
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
        told = str(done.exception)
        assert "another table coefficients" in told or "is not the table of certificate" in told
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


@pytest.mark.parametrize("root", ["two"], indirect=True)
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
            assert entry == "recipe" or "a plain name without '/' and '..' is needed" in str(done.exception)
            place.write_bytes(data)
