"""What is certified, for how long, by whom, and once: the run is named, its dates are allowed, its files are sound and signed."""

import errno
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from capture_double import BRIEF, small_run
from each import each
from ledger_events import day, day_before
from typed_commands import printed_commands
from typer.testing import CliRunner, Result

from pipelines.archive import Archive, Run, files, hash_chain
from pipelines.archive.signatures import VARIABLE, make_key
from pipelines.certificates import Ledger
from pipelines.certificates.coefficient_remarks import library_remarks
from pipelines.certificates.days import months_after
from pipelines.certificates.document.archive_comparison import NOBODY
from pipelines.certificates.document.compose import compose
from pipelines.certificates.measured import measured_on, measured_span
from pipelines.certificates.refusals import allowed_months
from pipelines.chain import certifiable
from pipelines.chain import certify as certifying
from pipelines.chain.certifiable import refuse_unstated
from pipelines.chain.certify import certify, offered
from pipelines.cli import app
from pipelines.jobs.model_change import change_from_options
from pipelines.rerun.rerun import again
from pipelines.stages.figures import UNITS
from schemas.errors import ArchiveUnusable, RecipeInvalid, WrongUse
from schemas.event import Event
from schemas.limits import VALIDITY_MONTHS, parse_limits

Typed = Callable[..., Result]
LIMITS = 'name = "half"\nvalidity_months = 6\n[figures]\nresidual_rms_ug = {max = 5000.0, unit = "µg"}\n'


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Run:
    monkeypatch.setenv(VARIABLE, "")
    run = small_run(tmp_path)
    run.seal()
    return run


def end_of(run: Run) -> str:
    """The day on which a run was measured: a suite may run over midnight."""
    return str(run.manifest("readings")["when"])[:10]


def refusal(done: Result, kind: type[Exception] = WrongUse) -> str:
    """What a command says that is refused for this reason."""
    assert isinstance(done.exception, kind), done.output
    return str(done.exception)


def issued(typed: Typed, *words: str, status: int = 0) -> dict[str, Any]:
    """The document of ``certificate issue``."""
    done = typed("certificate", "issue", *words, "--json")
    assert done.exit_code == status
    return json.loads(done.stdout)


def test_the_run_is_named_before_it_is_signed(run: Run, typed: Typed, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_args: object) -> None:
        raise WrongUse("stopped before anything was written")

    with monkeypatch.context() as patch:
        patch.setattr(certifying, "refuse_unsound", refused)
        stopped = typed("certificate", "issue")
    assert str(stopped.exception) == "stopped before anything was written"
    assert f"certificate issue: run {run.id}, measured on {end_of(run)}, 3 units: A1, A2, A3" in stopped.stderr
    assert issued(typed)["run"] == run.id


def test_a_disk_that_becomes_full_leaves_units_out_that_the_same_command_adds(
    run: Run, typed: Typed, monkeypatch: pytest.MonkeyPatch
) -> None:
    write, room = files._write_durably, iter(range(2))

    def written(path: Path, data: bytes) -> None:
        if "calibrations" in path.parts and next(room, None) is None:
            raise OSError(errno.ENOSPC, "No space left on device", str(path))
        write(path, data)

    with monkeypatch.context() as patch:
        patch.setattr(files, "_write_durably", written)
        told = str(typed("certificate", "issue", "--reason", "first").exception)
    assert "No space left" in told
    assert told.endswith("; units in the ledger: 2 of 3; give the same command again to go on")
    done = issued(typed, "--reason", "first")["certified"]
    assert {(one["certificate"], one["was_there"]) for one in done} == {("A1/1", True), ("A2/1", True), ("A3/1", False)}
    assert not Ledger(run.archive).unanchored([one.event for one in Ledger(run.archive).all()])


def test_a_certificate_begins_at_the_measurement_or_later_and_lasts_no_longer_than_is_allowed(
    run: Run, typed: Typed
) -> None:
    told = f"valid from 2020-01-01, run {run.id} was measured on {end_of(run)}, that day or a later one is needed"
    assert told in refusal(typed("certificate", "issue", run.id, "--since", "2020-01-01"))
    assert allowed_months(run) == VALIDITY_MONTHS
    for words in (
        ("--since", day_before(end_of(run))), ("--since", day(400)),
        ("--until", "13m"), ("--until", "2099-01-01"), ("--until", "1200m"),
    ):  # fmt: skip
        assert typed("certificate", "issue", run.id, *words).exit_code != 0, words
    ledger = Ledger(run.archive)
    assert ledger.events("A1") == []
    assert typed("certificate", "issue", run.id).exit_code == 0
    event = ledger.events("A1")[0]
    assert event.start >= end_of(run)
    assert event.until == months_after(event.start, VALIDITY_MONTHS)
    assert typed("certificate", "issue", run.id, "--since", day(1)).exit_code == 0


def test_what_was_revoked_is_certified_again_from_the_same_run_only_by_name_and_with_a_reason(
    run: Run, typed: Typed
) -> None:
    typed("certificate", "issue", "latest")
    typed("certificate", "revoke", "A2", "--reason", "cracked glass")
    document = issued(typed, "latest", status=1)
    assert [one["serial"] for one in document["certified"]] == ["A1", "A3"]
    revoked = f"certificate A2/1 of this run was revoked on {day()} (cracked glass)"
    assert document["left_out"]["A2"].startswith(f"{revoked}; measure the unit")
    for words in (("--units", "A2"), ("--units", "A2", "--reason", " ")):
        told = refusal(typed("certificate", "issue", run.id, *words))
        assert f"unit A2 of run {run.id}: {revoked}" in told
        assert "--units A2 --reason TEXT" in told
    assert "A2" in issued(typed, run.id, "--reason", "all", status=1)["left_out"]
    assert Ledger(run.archive).valid_at("A2", day()) is None
    (again,) = issued(typed, run.id, "--units", "A2", "--reason", "another unit was meant")["certified"]
    assert (again["certificate"], again["reason"]) == ("A2/3", "another unit was meant")
    known = Ledger(run.archive).calibrations("A2")
    amendment = compose(run, known[-1], known, NOBODY).amendment
    assert (amendment.replaces, amendment.reason) == (("A2/1",), "another unit was meant")
    assert typed("certificate", "issue", run.id).exit_code == 0  # it holds now like the others


@pytest.mark.slow
def test_a_re_run_of_measurements_whose_certificate_was_revoked_is_certified_only_by_name_and_with_a_reason(
    run: Run, typed: Typed
) -> None:
    model = "bias,scale,misalignment,bias_temperature,scale_temperature,second_order"
    rerun = run.archive.run(again(run.archive, run.id, change_from_options(model)).new)
    assert offered(Ledger(run.archive), rerun)
    typed("certificate", "issue", run.id)
    assert typed("certificate", "issue", rerun.id, "--units", "A3", "--supersede").exit_code == 0
    typed("certificate", "revoke", "A1", "--reason", "the seat was loose")
    typed("certificate", "revoke", "A3", "--reason", "dropped")
    document = issued(typed, rerun.id, status=1)
    assert [one["serial"] for one in document["certified"]] == ["A2"]
    told = f"certificate A1/1 of run {run.id}, which has the same measurements, was revoked on {day()} (the seat was loose)"
    assert document["left_out"]["A1"].startswith(told)
    assert told in refusal(typed("certificate", "issue", rerun.id, "--units", "A1"))
    back = issued(typed, run.id, status=1)["left_out"]  # nor by the first run once more
    assert f"certificate A3/2 of run {rerun.id}, which has" in back["A3"]
    named = issued(typed, rerun.id, "--units", "A1", "--reason", "the model was wrong, the seat was not")
    assert [one["certificate"] for one in named["certified"]] == ["A1/3"]
    known = Ledger(run.archive).calibrations("A1")
    assert compose(rerun, known[-1], known, NOBODY).amendment.replaces == ("A1/1",)


def test_certificates_are_listed_with_their_state_on_a_day(run: Run, typed: Typed) -> None:
    typed("certificate", "issue", run.id)
    typed("certificate", "revoke", "A2", "--reason", "cracked glass")
    listed = json.loads(typed("certificate", "list", "--json").stdout)["certificates"]
    states = {one["certificate"]: one["state"] for one in listed}
    assert states == {"A1/1": "valid", "A2/1": "revoked", "A3/1": "valid"}
    holding = json.loads(typed("certificate", "list", "--at", day(), "--json").stdout)
    assert [each["serial"] for each in holding["certificates"]] == ["A1", "A3"]
    assert "no certificate valid on 2001-01-01" in typed("certificate", "list", "--at", "2001-01-01").stdout
    first = Ledger(run.archive).calibrations("A1")[0]
    assert first.state_on("2001-01-01") == "begins later"
    assert (first.state_on(first.start), first.state_on(first.until)) == ("valid", "expired")
    assert "unit 'A9' has no certificate; known: A1, A2, A3" in refusal(typed("certificate", "list", "A9"))


def test_a_certificate_is_offered_where_it_would_be_given(
    run: Run, typed: Typed, monkeypatch: pytest.MonkeyPatch
) -> None:
    ledger = Ledger(run.archive)
    assert offered(ledger, run)
    typed("certificate", "issue", run.id)
    for serial in ("A1", "A2"):
        typed("certificate", "revoke", serial, "--reason", "dropped")
    assert offered(ledger, run)  # A3 is left
    typed("certificate", "issue", run.id, "--units", "A3", "--since", day(1))
    ended = ("certificate", "revoke", "A3", "1", "--reason", "dropped")
    told = typed(*ended).stdout
    assert "A3/2, of the same measurements, stays valid" in " ".join(told.split())
    (command,) = printed_commands(told)
    assert json.loads(typed(*command, "--json").stdout)["still_valid"] == []
    assert not offered(ledger, run)

    def refused(_run: Run) -> str:
        raise WrongUse("its model is not adequate")

    monkeypatch.setattr(certifying, "refuse_inadequate", refused)
    assert not offered(Ledger(run.archive.root / "other"), run)


def test_the_limits_file_says_how_long_within_bounds_and_stays_out_of_the_name_of_a_run_that_does_not_say(
    run: Run, tmp_path: Path
) -> None:
    (tmp_path / "half.toml").write_text(LIMITS, encoding="utf-8")
    new = run.archive.run(again(run.archive, run.id, change_from_options(limits=str(tmp_path / "half.toml"))).new)
    assert allowed_months(new) == 6
    assert measured_on(new) == end_of(run)
    ledger = Ledger(run.archive)
    with pytest.raises(WrongUse, match=r"no more than until .* is allowed; limits 'half' allow 6 months"):
        certify(ledger, new, months=7)
    event = certify(ledger, new).written[0]
    assert event.until == months_after(event.start, 6)
    for months in ("0", "121", '"6"', "true", "6.5"):
        with pytest.raises(RecipeInvalid, match="validity_months"):
            parse_limits(LIMITS.replace("= 6", f"= {months}"), "half.toml", UNITS)
    plain = parse_limits(LIMITS.replace("validity_months = 6\n", ""), "x", UNITS)
    assert "validity_months" not in plain.model_dump(mode="json")


def test_a_fit_by_an_older_version_has_the_date_of_its_capture(run: Run) -> None:
    happened = Event(kind="soak", time_s=0.0, record=0, reason="25 °C", action="settled")
    run.records.events.note(happened)
    [place] = (run.records.path / "events").iterdir()
    place.write_bytes(files.json_bytes({**happened.document(), "when": "2020-02-03T23:30:00.000+00:00"}))
    assert measured_span(run) is None
    assert measured_on(run) == "2020-02-03"
    (run.path / "run.json").write_bytes(files.json_bytes({**run.about, "when": "2020-02-03T23:00:00.000+00:00"}))
    assert measured_span(run) is not None


def meanwhile(monkeypatch: pytest.MonkeyPatch, certified: Callable[[], object]) -> None:
    """Lets somebody else certify once, while a command checks its run."""
    real, once = certifying.refuse_unsound, iter([certified])

    def checked(which: Run, keys: object) -> None:
        real(which, keys)
        next(once, lambda: None)()

    monkeypatch.setattr(certifying, "refuse_unsound", checked)


def test_two_that_certify_at_the_same_moment_do_not_both_succeed(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "half.toml").write_text(LIMITS, encoding="utf-8")
    other = run.archive.run(again(run.archive, run.id, change_from_options(limits=str(tmp_path / "half.toml"))).new)
    ledger = Ledger(run.archive)
    with monkeypatch.context() as patch:
        meanwhile(patch, lambda: certify(ledger, other, ["A2"]))
        with pytest.raises(WrongUse, match=r"A2/1 of run .* was written by .* while this command was at work"):
            certify(ledger, run)
    assert [len(ledger.events(serial)) for serial in ("A1", "A2", "A3")] == [0, 1, 0]
    meanwhile(monkeypatch, lambda: certify(ledger, run))  # the same certificate is written once
    assert {event.certificate for event in certify(ledger, run).there} == {"A1/1", "A2/2", "A3/1"}
    assert len(ledger.events("A1")) == 1
    # a writer that is killed before the chain has its certificates: the same command adds them
    hash_chain.path_of_entry(ledger.root, hash_chain.last_number(ledger.root)).unlink()
    assert len(ledger.unanchored(certify(ledger, run).there)) == 0


@pytest.fixture
def keys(tmp_path: Path) -> dict[str, Path]:
    paths = {name: tmp_path / f"{name}.key" for name in ("own", "foreign")}
    for place in paths.values():
        make_key(place)
    return paths


def sign(run: Run, key: Path | None) -> None:
    """All manifests of a run anew by a key, and its entry of the chain."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(VARIABLE, str(key or ""))
        for name in ("coefficients", "covariance", "grades"):
            path = run.path / f"{name}.json"
            path.write_bytes(files.manifest_bytes(json.loads(path.read_text())))


@pytest.mark.parametrize(("by", "said"), [("", "not signed"), ("foreign", "signed with a key that is not the own")])
def test_show_and_export_name_who_did_not_sign_and_stop_where_a_signed_file_was_edited(
    run: Run, typed: Typed, keys: dict[str, Path], monkeypatch: pytest.MonkeyPatch, by: str, said: str
) -> None:
    typed("certificate", "issue", run.id)
    sign(run, keys.get(by))
    handed_out = ("show", run.id), ("show", "A1"), ("export", run.id)
    for words in handed_out:
        assert said not in typed(*words).stderr
    monkeypatch.setenv(VARIABLE, str(keys["own"]))
    for words in handed_out:
        done = typed(*words)
        assert done.exit_code == 0, (words, done.exception)
        assert f"{said}: " in done.stderr, words
        assert f"runs/{run.id}/coefficients.json" in done.stderr
        assert "calibrations/" in done.stderr  # the certificate was not signed either
    told = refusal(typed("certificate", "issue", run.id, "--until", "6m"), ArchiveUnusable)
    assert "a signature by the own key, or by one given with --trust, is needed" in told
    sign(run, keys["own"])
    path = run.path / "coefficients.json"  # an edit behind a signature stops them
    path.write_bytes(files.json_bytes({**json.loads(path.read_text()), "who": "somebody else"}))
    for words in (("show", run.id), ("export", run.id)):
        assert "was edited after it was signed" in str(typed(*words).exception)


@pytest.mark.slow
def test_a_run_of_a_station_with_another_key_is_certified_where_that_key_is_trusted(
    tmp_path: Path, keys: dict[str, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    from cryptography.hazmat.primitives.serialization import Encoding, PublicFormat, load_pem_private_key

    monkeypatch.setenv(VARIABLE, str(keys["foreign"]))
    run, pem = small_run(tmp_path, None, *BRIEF), tmp_path / "station.pem"
    run.seal()
    public = load_pem_private_key(keys["foreign"].read_bytes(), None).public_key()
    pem.write_bytes(public.public_bytes(Encoding.PEM, PublicFormat.SubjectPublicKeyInfo))
    monkeypatch.setenv(VARIABLE, str(keys["own"]))
    words = ["certificate", "issue", run.id, "--archive", str(run.archive.root)]
    assert isinstance(CliRunner().invoke(app, words).exception, ArchiveUnusable)
    assert CliRunner().invoke(app, [*words, "--trust", str(pem)]).exit_code == 0


def test_tables_made_with_different_libraries_are_told_wherever_they_are_handed_out(run: Run, typed: Typed) -> None:
    assert library_remarks(run) == []
    path = run.path / "coefficients.json"
    content = json.loads(path.read_text())
    path.write_bytes(files.json_bytes({**content, "libraries": {**content["libraries"], "scipy": "0.1"}}))
    for words in (("show", run.id), ("export", run.id), ("certificate", "issue", run.id)):
        assert "tables made with scipy 0.1 (coefficients)" in typed(*words).stderr, words
    assert "tables made with scipy 0.1 (coefficients)" in typed("verify").stdout


def restated(run: Run, frame: str = "", **entries: object) -> Run:
    """A run whose station states other entries of its uncertainty, None for no longer, in the frame of a certificate."""
    about = json.loads((run.path / "run.json").read_text(encoding="utf-8"))
    stated = {**about["station"]["uncertainty"], **entries}
    about["station"]["uncertainty"] = {name: entry for name, entry in stated.items() if entry is not None}
    if frame:
        about["recipe"]["certificate"] = {**(about["recipe"].get("certificate") or {}), "frame": frame}
    (run.path / "run.json").write_bytes(files.json_bytes(about))
    return Archive(run.archive.root).run(run.id)


@each([
    ({"reader": None}, "reader (dominates scale and bias)"),
    ({"reader": {"gain_u_ppm": 0.0, "offset_u_ug": 2.0, "source": "s"}}, "reader gain (dominates"),
    ({"inner_offset": None}, "inner_offset (dominates misalignment)"),
    ({"level": {"u_urad": 0.0}}, "level (dominates bias and misalignment)"),
    ({"thermometer": None}, "thermometer (dominates"),
    ({"gradient": None, "thermometer": {"measures": "slot", "offset_u_K": 0.1, "slope_u_percent": 0.1, "source": "s"}},
     "gradient (dominates bias and scale over temperature)"),
])  # fmt: skip
def test_an_entry_that_the_results_depend_on_is_asked_for_and_a_zero_is_none(
    row: tuple[dict[str, object], str], tmp_path: Path
) -> None:
    own = small_run(tmp_path)
    refuse_unstated(own)
    with pytest.raises(WrongUse, match="not stated: ") as refused:
        refuse_unstated(restated(own, **row[0]))
    assert row[1] in str(refused.value)
    assert "a 0 needs exact = true" in str(refused.value)
    for frame in ("fixture", "intrinsic"):  # the seat is asked for in either, as the misalignment is a result
        with pytest.raises(WrongUse, match=r"seat \(dominates misalignment\)"):
            refuse_unstated(restated(own, frame, seat=None))


def verdict(p: float | None, reason: str | None = None, *, named: bool = False) -> dict[str, object]:
    figures = {"rms_ug": 1.0, "floor_ug": 1.0, "p_value": p, "named": named}
    return {"adequate": None if p is None else False, "reason": reason, **figures, "units": 3, "faulty": []}


@each([
    (verdict(4e-5), "NOT ADEQUATE (p < 0.001), p of at least 0.001 is needed"),
    (verdict(0.01, named=True), "NOT ADEQUATE (p = 0.01), and what it lacks is found"),
    (verdict(0.4, named=True), "NOT ADEQUATE (p = 0.4), and what it lacks is found"),
    (verdict(None, "too few poses"), "cannot be judged (too few poses)"),
])  # fmt: skip
def test_a_captured_run_whose_model_is_not_adequate_is_not_certified(
    row: tuple[dict, str], run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(certifiable, "adequacy_of", lambda _run: row[0])
    with pytest.raises(WrongUse, match=re.escape(row[1])):
        certify(Ledger(run.archive), run)
    assert Ledger(run.archive).events("A1") == []


def test_a_p_that_one_good_lot_in_twenty_has_is_certified_unless_the_limits_ask_for_more(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(certifiable, "adequacy_of", lambda _run: verdict(0.01))
    strict = tmp_path / "strict.toml"
    strict.write_text(LIMITS.replace("[figures]", "adequacy_p_min = 0.02\n[figures]"), encoding="utf-8")
    new = run.archive.run(again(run.archive, run.id, change_from_options(limits=str(strict))).new)
    with pytest.raises(WrongUse, match=r"NOT ADEQUATE \(p = 0.01\), p of at least 0.02 is needed"):
        certify(Ledger(run.archive), new)
    event = certify(Ledger(run.archive), run).written[0]
    assert event.adequacy.startswith("NOT ADEQUATE at the level of 5 % (p = 0.01)")
    assert Ledger(run.archive).events("A1")[0].adequacy == event.adequacy
