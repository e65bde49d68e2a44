"""What was changed, lost, edited or forged in an archive is found; what is whole is not accused."""

import json
import shutil
from collections.abc import Callable
from datetime import timedelta
from pathlib import Path

import pytest
from capture_double import BRIEF, CaptureDouble, PulledPlug, finished_run, small_job
from each import each
from typer.testing import CliRunner

from pipelines.archive import Archive, Run, files
from pipelines.archive.signatures import VARIABLE, make_key, name_of, public_keys
from pipelines.certificates import Ledger
from pipelines.chain.certify import certify
from pipelines.chain.chain import ORDER
from pipelines.chain.runner import Runner
from pipelines.cli import app
from pipelines.integrity import Report, seals, verify
from pipelines.integrity import runs as run_checks
from pipelines.integrity.findings import VerifiedPart
from schemas.errors import ArchiveUnusable, WrongUse
from schemas.event import Event


def make(folder: Path) -> Path:
    """An archive with a finished run, certified, one unit of it revoked."""
    run = finished_run(folder, *BRIEF)
    ledger = Ledger(Archive(folder / "archive"))
    certify(ledger, run)
    ledger.revoke("A2", "dropped")
    return folder / "archive"


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(VARIABLE, "")
        return make(tmp_path_factory.mktemp("whole"))


@pytest.fixture(scope="module")
def key(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("keys") / "signing.key"
    make_key(place)
    return place


@pytest.fixture(scope="module")
def signed(tmp_path_factory: pytest.TempPathFactory, key: Path) -> Path:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(VARIABLE, str(key))
        return make(tmp_path_factory.mktemp("signed"))


@pytest.fixture
def copy(whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(VARIABLE, "")
    shutil.copytree(whole, tmp_path / "archive")
    return tmp_path / "archive"


@pytest.fixture
def signed_copy(signed: Path, key: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(VARIABLE, str(key))
    shutil.copytree(signed, tmp_path / "archive")
    return tmp_path / "archive"


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


def edit(path: Path, change: Callable[[dict], None]) -> None:
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content, sort_keys=True, indent=1, ensure_ascii=False) + "\n")


def test_a_whole_archive_is_whole_says_that_it_is_unsigned_and_is_read_by_run(copy: Path) -> None:
    report = verified(copy)
    assert (report.checked.findings, report.checked.remarks) == ([], [])
    assert report.trust.startswith("UNSIGNED")
    assert report.checked.rows > len(run_of(copy).table("samples"))
    assert len(report.head) == 64
    named = verify(Archive(copy), [run_of(copy).id], keys={})
    assert (named.runs, named.captures, named.checked.findings) == (1, 1, [])


EVERY_KIND = (
    "archive.json", "captures/*/complete.json", "captures/*/state/*.bin", "captures/*/00001/record.json",
    "captures/*/00000/samples.parquet", "captures/*/00003/readings.parquet", "captures/*/00003/history.parquet",
    "runs/*/run.json", "runs/*/sealed.json", "runs/*/report.html", "runs/*/report.json", "runs/*/soaks.json",
    "runs/*/coefficients.json", "runs/*/coefficients.parquet", "runs/*/grades.parquet", "runs/*/dwells.json",
    "calibrations/*/*/000001.json", "calibrations/*/*/000002.json", "chain/*/000000001.json",
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
    signed: Path, whole: Path, signed_copy: Path, tmp_path: Path
) -> None:
    for path in run_of(whole).path.glob("*.parquet"):
        assert (run_of(signed).path / path.name).read_bytes() == path.read_bytes()
    report = verified(signed_copy)
    assert report.whole
    [name] = public_keys([])
    assert report.trust == f"{report.checked.manifests} of {report.checked.manifests} manifests signed by {name}"
    other = make_key(tmp_path / "other.key")
    report = verify(Archive(signed_copy), keys={name_of(other): other}, demanded=True)
    assert [f.kind for f in report.checked.findings] == ["signature"]
    assert "by a key that is not known here" in verify(Archive(signed_copy), keys={name_of(other): other}).trust
    edit(one(signed_copy, "runs/*/grades.json"), lambda content: content.update(who="somebody else"))
    assert ("signature", "grades.json") in found(signed_copy)  # the signature is false now


def test_an_unsigned_archive_is_wrong_where_a_key_is_demanded(copy: Path, key: Path, monkeypatch) -> None:
    monkeypatch.setenv(VARIABLE, str(key))
    keys = public_keys()
    report = verify(Archive(copy), keys=keys, demanded=True)
    assert [f.kind for f in report.checked.findings] == ["signature"]
    assert "manifests: each is not signed" in report.checked.findings[0].message


def test_a_key_is_made_once_and_for_its_owner_only(tmp_path: Path) -> None:
    place = tmp_path / "deep" / "signing.key"
    make_key(place)
    assert place.stat().st_mode & 0o777 == 0o600
    with pytest.raises(WrongUse, match="exists, a new file is needed"):
        make_key(place)


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
    arguments = ["verify", "--archive", str(copy), "--json"]
    sound = CliRunner().invoke(app, arguments)
    assert sound.exit_code == 0
    assert json.loads(sound.stdout)["rows_per_s"] > 0
    flip(one(copy, "runs/*/coefficients.parquet"))
    spoilt = CliRunner().invoke(app, arguments)
    assert spoilt.exit_code == 1
    assert json.loads(spoilt.stdout)["findings"][0]["kind"] == "changed"
    told = CliRunner().invoke(app, arguments[:-1])
    assert all(words in told.stdout for words in ("coefficients.parquet", "UNSIGNED"))
    empty = CliRunner().invoke(app, ["verify", "--archive", str(copy / "chain")])
    assert "holds no archive, one with runs is needed" in str(empty.exception)


@pytest.fixture(scope="module")
def interrupted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An archive of another lot, whose capture has an event in its journal."""
    folder = tmp_path_factory.mktemp("interrupted")

    def noting(job, records, progress) -> None:
        records.events.note(Event(1.0, "suspended", 3, "the door was open", "measured again"))
        CaptureDouble()(job, records, progress)

    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(VARIABLE, "")
        job = small_job(folder, *BRIEF, ("seed = 5", "seed = 6"))
        list(Runner(job, Archive(folder / "archive"), measure=noting).all())
    return folder / "archive"


@each(
    [
        ("changed", "00000.json", b'{"reason": "nothing"}'),
        ("missing", "00000.json", None),
        ("foreign", "00001.json", b"{}"),
    ]
)
def test_the_journal_of_a_capture_is_held_against_its_end(
    row: tuple[str, str, bytes | None], tmp_path: Path, interrupted: Path
) -> None:
    kind, name, content = row
    shutil.copytree(interrupted, tmp_path / "archive")
    path = one(tmp_path / "archive", "captures/*/events/00000.json").with_name(name)
    path.unlink() if content is None else path.write_bytes(content)
    assert found(tmp_path / "archive") == [(kind, name)]


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
    copy: Path, interrupted: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(seals, "JUST_NOW", timedelta(0))
    other = run_of(interrupted)
    shutil.copytree(other.path, copy / "runs" / other.id)
    shutil.copytree(other.records.path, copy / "captures" / other.records.path.name)
    [finding] = verified(copy).checked.findings
    assert (finding.kind, finding.path) == ("edited", f"runs/{other.id}/sealed.json")
    assert finding.message.endswith(
        "run and chain are not from one archive; restore both from one copy, or work in the archive that made the run (--archive)"
    )
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


def test_a_key_in_the_archive_is_named_and_none_is_made_there(copy: Path, key: Path) -> None:
    shutil.copy(key, run_of(copy).path / "notes.txt")
    report = verified(copy)
    assert [(f.kind, Path(f.path).name) for f in report.checked.findings] == [("signature", "notes.txt")]
    assert "not written by the archive" in report.checked.remarks[0]
    result = CliRunner().invoke(app, ["archive", "key", "--output", str(copy / "runs" / "signing.key")])
    assert "lies in archive" in str(result.exception)


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
    for path, place in (
        (one(signed_copy, "runs/*/report.json"), ""),
        (max(signed_copy.glob("chain/*/*.json")), "other.key"),
    ):
        with monkeypatch.context() as patch:
            patch.setenv(VARIABLE, str(tmp_path / place) if place else "")
            path.write_bytes(files.manifest_bytes(json.loads(path.read_text())))
    report = verified(signed_copy)
    assert any("report.json is not signed" in remark for remark in report.checked.remarks)
    assert any("is signed with a key that is not known here" in remark for remark in report.checked.remarks)
    demanded = set(found(signed_copy, demanded=True))
    assert {("signature", "report.json"), ("signature", max(signed_copy.glob("chain/*/*.json")).name)} <= demanded


OF_ANOTHER_KIND = (5, None, "x", ["a"], {"a": 5})
MANIFESTS = (
    "runs/*/dwells.json", "runs/*/sealed.json", "captures/*/00003/record.json", "captures/*/complete.json",
    "calibrations/*/*/000001.json", "chain/*/000000001.json",
)  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("every", [False, True], ids=["one of each", "each"])
def test_an_entry_of_another_kind_in_a_manifest_is_found_and_stops_nothing(copy: Path, *, every: bool) -> None:
    """Every name with one of the kinds in turn; in the slow suite with each of them."""
    for pattern in MANIFESTS:
        path = one(copy, pattern)
        data = path.read_bytes()
        for number, name in enumerate(json.loads(data)):
            for value in OF_ANOTHER_KIND if every else OF_ANOTHER_KIND[number % len(OF_ANOTHER_KIND) :][:1]:
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
