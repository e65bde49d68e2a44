"""The audit and the questions in SQL, from the command line, on a generated archive whose hidden events are known."""

import json
import os
import re
import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
from each import each
from in_process import document_of, given, refused, text_of
from root_process import ROOT, python
from s3_server import CREDENTIALS, s3_bucket

from benchmarks.generated_archive import write_archive
from pipelines.archive import Archive
from pipelines.audit.audit import Scope, audit
from pipelines.audit.calibrations import day_of
from pipelines.audit.document import document
from pipelines.audit.findings import findings
from pipelines.audit.index import up_to_date
from pipelines.audit.rules import load_rules
from pipelines.audit.sql import VIEWS, ask
from pipelines.flows.local import local_server
from pipelines.tables.json_values import json_value
from schemas.errors import RecipeInvalid, WrongUse
from schemas.tables import TABLES

UNTIL = "2022-01-31"
NAMESPACES = ("www.w3.org", "purl.org", "creativecommons.org")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("factory") / "archive"
    write_archive(folder, 24, years=1.0, seed=5, workers=1)
    return folder


@pytest.fixture
def copy(made: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(made, tmp_path / "archive"))


def audited(archive: Archive):
    return audit(archive, load_rules(), Scope(day_of("2021-01-01"), day_of(UNTIL)))


def told(archive: Archive) -> str:
    """The whole document of an audit, as text."""
    found = audited(archive)
    return json.dumps(json_value(document(found, findings(found), "archive")), sort_keys=True)


def content(folder: Path, pattern: str = "*") -> dict[Path, bytes]:
    return {path.relative_to(folder): path.read_bytes() for path in folder.rglob(pattern) if path.is_file()}


def test_the_command_tells_findings_by_who_must_act_and_leaves_one(made, tmp_path):
    page, words = tmp_path / "audit.html", ("audit", "--archive", made, "--until", UNTIL, "--workers", "1")
    found = document_of(*words, "--output", page, status=1)
    assert found["counts"]["runs"] == 24
    order = [finding["who"] for finding in found["findings"]]
    assert order == sorted(order, key=["quality", "station", "line", "product", "archive"].index)
    assert found["due"]["units"] > 100
    text = page.read_text(encoding="utf-8")
    assert "<svg" in text
    assert set(re.findall(r"http://[\w.]+", text)) <= {f"http://{name}" for name in NAMESPACES}
    assert found["findings"][0]["message"] in text_of(*words, status=1)


def test_a_re_run_of_a_capture_is_no_second_calibration(made, copy):
    run = min((copy / "runs").iterdir())
    again = copy / "runs" / f"{run.name}x"
    shutil.copytree(run, again)
    about = json.loads((again / "run.json").read_text())
    about |= {"rerun_of": run.name, "measured": about["when"], "when": "2026-01-01T00:00:00+00:00"}
    (again / "run.json").write_text(json.dumps(about))
    assert told(Archive(copy)) == told(Archive(made))


READS = (
    "EXPLAIN SELECT * FROM dwells", "EXPLAIN ANALYZE SELECT count(*) FROM dwells", "explain (format json) FROM units",
    "-- how many\nEXPLAIN /* so */ ANALYZE WITH q AS (SELECT 1) SELECT * FROM q", "DESCRIBE units",
    "SUMMARIZE units", "FROM units", "TABLE units", "VALUES (1)", "/* first */ SELECT 1 -- last",
)  # fmt: skip


def test_every_way_to_read_is_answered_and_sees_the_same_from_index_and_files(made):
    question = "SELECT run, unit, axis, effect, name, value FROM coefficients ORDER BY ALL"
    archive = Archive(made)
    assert ask(archive, question).rows == ask(archive, question, compact=False).rows
    assert [read for read in READS if not ask(archive, read).rows] == []
    assert {*TABLES} - {*VIEWS} == {"samples"}
    counted = ask(archive, "SELECT count(*), count(DISTINCT run) FROM dwells").rows[0]
    assert counted == (sum(len(archive.run(info.id).table("dwells")) for info in archive.runs()), 24)


UNANSWERED = {
    "SELECT * FROM grade": "did you mean grades?",
    "SELEC 1": "syntax error",
    "SELECT pfa FROM figures": "--no-index for every column of coefficients and figures",
    "": "no statement",
    "EXPLAIN ANALYZE CREATE TABLE t AS SELECT 1": "found explain of create",
    "SELECT * FROM archive": "no view is called 'archive'",  # a variable of the caller is no view
}


@each(UNANSWERED)
def test_a_question_that_cannot_be_answered_is_refused_clearly(question, made):
    with pytest.raises(WrongUse, match=r"^query: ") as problem:
        ask(Archive(made), question)
    assert UNANSWERED[question] in str(problem.value)


ATTACKS = (  # {t} is a table of the archive, {d} a folder in it
    "EXPLAIN ANALYZE COPY (SELECT 1) TO '{t}'",
    "EXPLAIN ANALYZE COPY (SELECT 1) TO '{t}' (USE_TMP_FILE false, FORMAT parquet)",
    "explain/**/analyse--\n copy (SELECT 1) TO '{t}'",
    "/* SELECT */ EXPLAIN /* a */ ANALYZE /* b */ COPY dwells TO '{t}'",
    "EXPLAIN (ANALYZE) COPY (SELECT 1) TO '{t}'",
    "EXPLAIN (FORMAT json, ANALYZE) COPY (SELECT 1) TO '{t}'",
    "EXPLAIN EXPLAIN ANALYZE COPY (SELECT 1) TO '{t}'",
    "WITH x AS MATERIALIZED (COPY (SELECT 1) TO '{t}' (USE_TMP_FILE false)) SELECT * FROM dwells",
    "EXPLAIN ANALYZE WITH x AS MATERIALIZED (COPY (SELECT 1) TO '{t}' (USE_TMP_FILE false)) SELECT * FROM dwells",
    "WITH x AS (INSERT INTO dwells SELECT * FROM dwells RETURNING *) SELECT * FROM x",
    "SELECT * FROM query('COPY (SELECT 1) TO ''{t}''')",
    "COPY (SELECT 1) TO '{t}'", "EXPORT DATABASE '{d}'", "IMPORT DATABASE '{d}'", "ATTACH '{d}/x.db'", "ATTACH '{t}' AS x",
    "INSTALL httpfs", "LOAD httpfs", "LOAD '{t}'", "PRAGMA database_list", "PRAGMA enable_profiling", "CALL enable_logging()",
    "SET enable_external_access = true", "RESET lock_configuration", "SET VARIABLE x = 1", "USE memory", "BEGIN", "VACUUM",
    "CHECKPOINT", "PREPARE x AS SELECT 1", "EXECUTE x", "ANALYZE", "CREATE TABLE t (a int)", "CREATE MACRO m() AS 1",
    "CREATE SECRET s (TYPE s3)", "INSERT INTO runs VALUES (1)", "UPDATE runs SET run = ''", "DELETE FROM runs", "DETACH memory",
    "ALTER VIEW dwells RENAME TO x", "DROP VIEW dwells", "COMMENT ON VIEW dwells IS 'x'", "TRUNCATE runs",
    "SELECT * FROM enable_logging(storage := 'file', storage_path := '{d}')", "SELECT * FROM enable_profiling()",
    "SELECT * FROM read_text('{t}')", "SELECT * FROM read_parquet('{t}')", "SELECT * FROM '{t}'", "FROM glob('{d}/*')",
    "SELECT * FROM read_csv('/etc/hosts')", "SELECT * FROM sniff_csv('{t}')", "SELECT * FROM 'https://example.org/x.csv'",
    "SELECT 1; COPY (SELECT 1) TO '{t}'", "SELECT 1; -- \n EXPLAIN ANALYZE COPY (SELECT 1) TO '{t}'", ";;", "EXPLAIN",
)  # fmt: skip


def test_no_question_writes_or_reads_a_file_of_its_own_choice(made):
    table = min((made / "runs").glob("*/dwells.parquet"))
    ask(Archive(made), "SELECT count(*) FROM runs")  # the index is there
    before = content(made)
    for attack in ATTACKS:
        question = attack.format(t=table, d=table.parent)
        with pytest.raises(WrongUse, match=r"^query: "):
            ask(Archive(made), question)
        assert {path.relative_to(made) for path in made.rglob("*") if path.is_file()} == before.keys(), question
    assert content(made) == before


def test_the_query_command_prints_a_table_json_and_csv(made):
    question = "SELECT station, count(*) AS n FROM runs GROUP BY station ORDER BY station"
    words = ("archive", "query", question, "--archive", made)
    assert document_of(*words, status=0)["rows"][0] == {"station": "line-1", "n": 6}
    assert given(*words, "--output", "-")[1].splitlines()[:2] == ["station,n", "line-1,6"]
    assert "line-1" in text_of(*words)
    refused(*words, "--output", "-", "--json")
    joined = "SELECT g.outcome, f.outcome FROM grades g JOIN figures f USING (run, unit)"
    assert "two columns are called 'outcome'" in refused("archive", "query", joined, "--archive", made, "--json")


def test_what_cannot_be_audited_is_refused(made, tmp_path):
    words = ("audit", "--archive", made)
    assert "did you mean ADXL355?" in refused(*words, "--device", "ADXL335")
    assert "a period is needed" in refused(*words, "--since", "2024-01-01", "--until", "2023-01-01")
    assert "holds no archive" in refused("audit", "--archive", tmp_path / "none")


def test_rules_say_what_is_wrong_with_them(tmp_path):
    file = tmp_path / "rules.toml"
    for text, words in (
        ("interval_month = 3", "did you mean interval_months"),
        ('[tolerance]\nbias = { max = 3.0, unit = "mg" }', "is in µg"),
        ('[device.X.tolerance]\nbia = { max = 3.0, unit = "µg" }', "did you mean bias"),
        ("shortest_months = 30", "above longest_months"),
    ):
        file.write_text(text, encoding="utf-8")
        with pytest.raises(RecipeInvalid, match=words):
            load_rules(file)
    file.write_text(
        '[device.adxl355]\ninterval_months = 6\n[device.adxl355.tolerance]\nbias = { max = 7.0, unit = "µg" }'
    )
    rules = load_rules(file)
    assert (rules.months("ADXL355"), rules.months("QA700")) == (6, 12)
    assert (rules.tolerance_of("ADXL355", "bias"), rules.tolerance_of("SF1500", "bias")) == (7.0, 800.0)


@pytest.mark.slow
def test_every_hidden_event_of_some_years_is_found(tmp_path):
    folder = tmp_path / "archive"
    truth = write_archive(folder, 500, years=5.0, seed=2, workers=2)
    found = audit(Archive(folder), load_rules(), Scope(day_of("2021-01-01"), day_of("2026-01-04")))
    by_kind: dict[str, list] = {}
    for finding in findings(found):
        by_kind.setdefault(finding.kind, []).append(finding)
    assert {f.subject for f in by_kind["exchanged"]} == set(truth["swap"]["units"])
    assert {f.evidence["run"] for f in by_kind["exchanged"]} == {truth["swap"]["run"]}
    assert [f.subject for f in by_kind["drifts"]] == [truth["drifting"]["unit"]]
    [moved] = by_kind["station_moved"]
    assert (moved.evidence["station"], moved.evidence["parameter"]) == (truth["level"]["station"], "level_2")
    assert moved.evidence["earliest"] <= truth["level"]["date"][:10] <= moved.evidence["latest"]
    assert moved.evidence["shift_urad"] == pytest.approx(300.0, abs=20.0)
    level_day = day_of(truth["level"]["date"])
    since = (found.all.station == "line-2") & (found.all.day >= level_day) & found.product
    assert set(moved.units) == {str(unit) for unit in found.all.unit[since]}
    [knocked] = by_kind["slot_moved"]
    assert knocked.evidence["where"] == f"slot {truth['slot']['slot']}"
    assert knocked.evidence["earliest"] <= truth["slot"]["date"][:10] <= knocked.evidence["latest"]
    assert [f.subject for f in by_kind["odd_lot"]] == [truth["bad_lot"]["run"]]
    assert found.studies
    assert "standard" not in by_kind  # the check standards of this factory stand still
    assert "foreign" not in by_kind


@pytest.mark.slow
def test_an_archive_in_an_object_store_gives_the_same_audit_and_answers(made, monkeypatch):
    for name, value in CREDENTIALS.items():
        monkeypatch.setenv(name, value)
    with s3_bucket() as query:
        store = Archive(f"s3://factory/archive?{query}")
        for name, data in content(made).items():
            if name.parts[0] != "index":
                (store.root / str(name)).write_bytes(data)
        assert told(store) == told(Archive(made))
        assert up_to_date(store).made == 0
        for columns in ("bias_x FROM parameters", "outcome FROM grades"):
            question = f"SELECT run, unit, {columns} ORDER BY ALL"
            assert ask(store, question).rows == ask(Archive(made), question).rows


@pytest.mark.slow
def test_the_weekly_audit_leaves_its_findings_as_artifacts(tmp_path):
    archive, folder, home = tmp_path / "archive", tmp_path / "pages", tmp_path / "orchestrator"
    write_archive(archive, 16, years=1.0, seed=5, workers=1)
    with local_server(home) as address:
        environment = {**os.environ, **address, "PYTHONPATH": str(ROOT)}
        python(environment, "-m", "prefect", "work-pool", "create", "line", "--type", "process")
        names = python(environment, "-m", "pipelines.flows.deploy", "deploy/prefect.yaml").split()
        parameters = json.dumps({"archive": str(archive), "pages": str(folder), "until": "2023-12-31"})
        python(environment, "-m", "prefect", "deployment", "run", "audit_archive/weekly-audit", "--params", parameters)
        python(environment, "-m", "prefect", "worker", "start", "--pool", "line", "--run-once", "--limit", "1")
        schedules = python(environment, "-m", "prefect", "deployment", "schedule", "ls", "audit_archive/weekly-audit")
    assert "audit_archive/weekly-audit" in names
    assert "0 5 * * 1" in schedules
    with closing(sqlite3.connect(f"file:{home / 'prefect.db'}?mode=ro", uri=True)) as database:
        artifacts = dict(database.execute("select key, data from artifact where key is not null").fetchall())
        states = database.execute("select state_type from flow_run where state_type != 'SCHEDULED'").fetchall()
    assert states == [("COMPLETED",)]
    messages = [one["message"] for one in json.loads((folder / "audit-2023-12-31.json").read_text("utf-8"))["findings"]]
    assert messages
    assert [row["finding"] for row in json.loads(json.loads(artifacts["tumbleline-audit"]))] == messages
    assert "# Audit until 2023-12-31" in artifacts["tumbleline-audit-summary"]
    assert "<svg" in (folder / "audit-2023-12-31.html").read_text(encoding="utf-8")
