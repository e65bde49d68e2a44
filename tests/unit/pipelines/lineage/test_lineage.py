"""Lineage: from certificate to raw samples and back, in graphs that other tools read."""

import json
import os
import shutil
import subprocess
import warnings
from pathlib import Path

import pytest
from capture_double import CaptureDouble, recipe_file
from in_process import document_of, given, text_of
from rdflib import Graph as Rdf
from rdflib import Namespace
from root_process import ROOT

from pipelines.archive import Archive, Run, files
from pipelines.archive.signatures import VARIABLE
from pipelines.certificates import Ledger
from pipelines.chain.certify import certify
from pipelines.chain.runner import Runner
from pipelines.jobs.job import Request
from pipelines.lineage import Lineage, lineage
from pipelines.lineage.prov import iri, prov_of
from pipelines.lineage.ro_crate import write_crate
from schemas.errors import ArchiveUnusable, WrongUse

VALIDATOR = Path(os.environ.get("TUMBLELINE_CRATE_VALIDATOR", ROOT / ".venv" / "crate-validator" / "bin" / "python"))
PROV = Namespace("http://www.w3.org/ns/prov#")
STANDARD = """
[[reference]]
id = "AG-7"
what = "local gravity"
certificate = "D-K-15070-2026-03"
laboratory = "absolute gravimetry"
due = 2028-03-01
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A finished run on a station with a reference standard, certified, one unit of it revoked."""
    folder = tmp_path_factory.mktemp("lineage")
    station = folder / "bench.toml"
    own = (ROOT / "stations" / "simulated.toml").read_text(encoding="utf-8")
    station.write_text(own + STANDARD, encoding="utf-8")
    archive = Archive(folder / "archive")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(VARIABLE, "")
        job = Request(recipe=recipe_file(folder), station=station).job()
        runner = Runner(job, archive, measure=CaptureDouble())
        list(runner.all())
        certify(Ledger(archive), runner.run)
        Ledger(archive).revoke("A2", "dropped")
    return runner.run


@pytest.fixture(scope="module")
def of_unit(run: Run) -> Lineage:
    return lineage(run.archive, "A1")


def labels(traced: Lineage, kind: str) -> set[str]:
    return {node.label for node in traced.graph.nodes.values() if node.kind == kind}


def test_a_units_lineage_goes_from_its_certificate_to_every_record_with_origin_and_hashes(
    of_unit: Lineage, run: Run
) -> None:
    assert len(labels(of_unit, "samples")) == len(run.records.finished())
    kinds = ("certificate", "recipe", "limits", "station", "reference")
    found = [labels(of_unit, kind) for kind in kinds]
    assert found == [{"A1/1"}, {"small"}, {"consumer"}, {"simulated"}, {"AG-7"}]
    [standard] = [node for node in of_unit.graph.nodes.values() if node.kind == "reference"]
    assert (standard.about["certificate"], standard.about["due"]) == ("D-K-15070-2026-03", "2028-03-01")
    made = {step.name: step for step in of_unit.graph.steps.values()}
    assert made.keys() >= {"certify", "grade", "noise", "verify", "fit", "reduce", "validate", "capture", "start"}
    told = {"who", "where", "when", "code", "libraries", "software", "schema", "parameters"}
    assert told <= made["fit"].about.keys()
    with_hash = [node for node in of_unit.graph.nodes.values() if node.file and node.sha256]
    assert len(with_hash) > 60
    assert all(files.sha256(run.archive.root / node.file) == node.sha256 for node in with_hash)


def test_a_record_leads_to_the_certificates_that_it_went_into(run: Run) -> None:
    traced = lineage(run.archive, str(run.records.path / "00003" / "samples.parquet"))
    assert traced.kind == "file"
    assert labels(traced, "certificate") == {"A1/1", "A2/1", "A3/1"}
    assert labels(traced, "revocation") == {"revocation A2/2"}
    assert labels(traced, "samples") == {"record 3 samples.parquet"}


def test_a_file_that_was_copied_out_is_known_by_its_content(run: Run, tmp_path: Path) -> None:
    copy = shutil.copy(run.path / "grades.parquet", tmp_path / "sent-by-mail.parquet")
    traced = lineage(run.archive, str(copy))
    assert traced.focus == (f"runs/{run.id}/grades.parquet",)
    (tmp_path / "strange.parquet").write_bytes(b"strange")
    with pytest.raises(ArchiveUnusable, match="is no table and no source"):
        lineage(run.archive, str(tmp_path / "strange.parquet"))
    with pytest.raises(WrongUse, match="'small-x' is neither a unit, a certificate, a run nor a file"):
        lineage(run.archive, "small-x")


def test_a_run_is_followed_to_what_it_runs_again_and_a_unit_without_certificate_from_its_grades(
    run: Run, tmp_path: Path
) -> None:
    shutil.copytree(run.archive.root, tmp_path / "archive")
    archive = Archive(tmp_path / "archive")
    again = archive.open_run("small", {**run.about, "rerun_of": run.id, "because": []}, {"again": 1})
    more = archive.open_run("small-next", {**run.about, "parents": [again.id], "rerun_of": None}, {"more": 1})
    assert {again.id, run.id} <= labels(lineage(archive, more.id), "run")
    assert again.id in labels(lineage(archive, run.id), "run")
    shutil.rmtree(tmp_path / "archive" / "calibrations")
    traced = lineage(Archive(tmp_path / "archive"), "A3")
    assert (traced.kind, traced.focus) == ("unit", (f"runs/{run.id}/grades.parquet",))


def read_back(traced: Lineage) -> Rdf:
    """The PROV document as another library reads it."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "ConjunctiveGraph is deprecated")  # rdflib's own parser uses it
        return Rdf().parse(data=json.dumps(prov_of(traced)), format="json-ld")


def test_prov_is_read_by_another_library_and_leads_from_certificate_to_samples(of_unit: Lineage, run: Run) -> None:
    graph = read_back(of_unit)
    assert len(graph) > 500
    [certificate] = [node.id for node in of_unit.graph.nodes.values() if node.kind == "certificate"]
    reached = {
        str(row[0])
        for row in graph.query(
            "SELECT ?source WHERE { ?certificate (prov:wasDerivedFrom)+ ?source }",
            initBindings={"certificate": next(s for s in graph.subjects() if str(s) == iri("thing", certificate))},
            initNs={"prov": PROV},
        )
    }
    samples = {iri("thing", node.id) for node in of_unit.graph.nodes.values() if node.kind == "samples"}
    assert samples <= reached
    assert len(set(graph.subjects(predicate=None, object=PROV.Person))) == 1
    activities = set(graph.subjects(predicate=None, object=PROV.Activity))
    assert set(graph.objects(predicate=PROV.wasGeneratedBy)) <= activities
    for activity in activities:
        assert graph.value(activity, PROV.endedAtTime) is not None
        assert graph.value(activity, PROV.wasAssociatedWith) is not None
    revoked = read_back(lineage(run.archive, "A2"))
    assert len(set(revoked.subjects(predicate=PROV.wasInvalidatedBy))) == 1


def validated(crate: Path, severity: str) -> dict:
    if not VALIDATOR.is_file():
        pytest.skip(f"no RO-Crate validator at {VALIDATOR}; 'make test' installs it")
    command = [str(VALIDATOR), str(ROOT / "tests" / "validate_crate.py"), str(crate), severity]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


def test_the_crate_holds_every_file_and_its_hash(of_unit: Lineage, run: Run, tmp_path: Path) -> None:
    count = write_crate(run.archive, of_unit, tmp_path / "crate")
    document = json.loads((tmp_path / "crate" / "ro-crate-metadata.json").read_text())
    parts = [one for one in document["@graph"] if one["@type"] == "File"]
    assert len(parts) == count
    for part in parts:
        assert files.sha256(tmp_path / "crate" / part["@id"].replace("%3A", ":").replace("%40", "@")) == part["sha256"]
    with pytest.raises(WrongUse, match="exists and is not empty"):
        write_crate(run.archive, of_unit, tmp_path)


@pytest.mark.slow
def test_the_crate_passes_another_makers_validator(of_unit: Lineage, run: Run, tmp_path: Path) -> None:
    write_crate(run.archive, of_unit, tmp_path / "crate")
    required = validated(tmp_path / "crate", "REQUIRED")
    assert (required["passed"], required["issues"], required["checks"] > 40) == (True, [], True)
    recommended = {issue["message"] for issue in validated(tmp_path / "crate", "RECOMMENDED")["issues"]}
    assert recommended <= {"The organization SHOULD have a URL."}  # the archive does not know whose it is


def test_the_command_shows_the_way_once_and_writes_prov_crate_and_json(run: Run, tmp_path: Path) -> None:
    words = ("lineage", "A1", "--archive", run.archive.root)
    shown = text_of(*words)
    known = ("certificate A1/1", "by fit", "raw samples 23 records", "reference AG-7", "station simulated", "pyarrow")
    assert [words for words in known if words not in shown] == []
    assert shown.count("by fit") == 1
    document = document_of(*words, "--output", tmp_path / "p.jsonld", "--output", tmp_path / "c")
    assert document["focus"] == [node["id"] for node in document["things"] if node["kind"] == "certificate"]
    assert json.loads((tmp_path / "p.jsonld").read_text()) == json.loads(given(*words, "--output", "-")[1])
    assert (tmp_path / "c" / "ro-crate-metadata.json").is_file()
