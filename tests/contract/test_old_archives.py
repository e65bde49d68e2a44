"""Archives that older versions wrote open: ``tests/archives`` keeps a small one of every version of the schema."""

from pathlib import Path

import pandas as pd
import pytest
from root_process import ROOT

from deploy.release import unpack
from pipelines.archive import Archive, Run, parquet
from pipelines.certificates import Ledger
from pipelines.certificates.measured import measured_on
from pipelines.chain import certify as certifying
from pipelines.chain.certify import certify
from pipelines.integrity import verify
from pipelines.jobs.model_change import ModelChange
from pipelines.lineage import lineage
from pipelines.rerun.rerun import again
from schemas import version
from schemas.errors import WrongUse

KEPT = sorted((ROOT / "tests" / "archives").glob("v*.tar.xz"))
FRAME = pd.DataFrame({"unit": ["A", "B"], "value": [1.0, 2.0]})


@pytest.fixture(params=KEPT, ids=lambda path: path.name.partition(".")[0])
def run(request: pytest.FixtureRequest, tmp_path: Path) -> Run:
    unpack(request.param, tmp_path / "archive")
    return Archive(tmp_path / "archive").run("latest")


def test_its_runs_are_listed_every_table_reads_and_it_is_whole_and_unsigned(run: Run) -> None:
    assert {path.name for path in KEPT} == {f"v{number}.tar.xz" for number in range(1, version.VERSION + 1)}
    [info] = run.archive.runs()
    assert (info.recipe, info.units, info.finished) == ("small", ("A1", "A2"), True)
    assert {"capture", "fit", "grade"} <= set(info.stages)
    assert [name for name in run.tables() if len(run.table(name)) != run.manifest(name)["rows"]] == []
    assert len(run.table("samples")) > 1000
    report = verify(run.archive, keys={})
    assert report.checked.findings == []
    assert report.trust.startswith("UNSIGNED")


def test_nothing_new_is_certified_on_noise_only_and_what_was_certified_then_is_traced(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(WrongUse, match=r"states no uncertainty of its references \(noise only\)"):
        certify(Ledger(run.archive), run, start=measured_on(run))
    monkeypatch.setattr(certifying, "refuse_unstated", lambda run: None)  # as versions before did
    certify(Ledger(run.archive), run, start=measured_on(run))
    traced = lineage(run.archive, "A1")
    kinds = {node.kind for node in traced.graph.nodes.values()}
    assert {"certificate", "samples", "table", "station", "recipe"} <= kinds


def test_it_is_run_again_since_its_keys_are_of_other_code_and_then_no_more(run: Run) -> None:
    first = again(run.archive, run.id, ModelChange())
    assert {cause["what"] for cause in first.because} == {"code"}
    assert {name for name, done in first.stages.items() if done != "computed"} == {"capture"}
    assert again(run.archive, first.new, ModelChange()).because == []
    renewed = run.archive.run(first.new)
    assert set(renewed.table("grades")["unit"]) == {"A1", "A2"}
    # run again by a version that knows the budget, but without a statement
    with pytest.raises(WrongUse, match="noise only"):
        certify(Ledger(run.archive), renewed, start=measured_on(renewed))
    assert verify(run.archive, keys={}).checked.findings == []


def test_a_table_is_brought_up_version_by_version(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    changes = {
        ("dwells", 1): lambda frame: frame.assign(added=frame["value"] * 10.0),
        ("dwells", 2): lambda frame: frame.rename(columns={"added": "renamed"}),
        ("grades", 1): lambda frame: frame.iloc[:0],
    }
    for module, name, value in ((version, "VERSION", 3), (version, "UPGRADES", changes)):
        monkeypatch.setattr(module, name, value)
    for written, columns in ((1, ["unit", "value", "renamed"]), (3, ["unit", "value"])):
        path = tmp_path / f"{written}.parquet"
        path.write_bytes(parquet.table_bytes("dwells", FRAME, written))
        assert list(parquet.read_table(path, "dwells").columns) == columns
        assert parquet.table_bytes("dwells", FRAME, written) == path.read_bytes()
