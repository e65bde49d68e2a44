"""Whether the common residual of a lot contradicts the stated table: rates on drawn stations, what run and certificate say."""

from pathlib import Path

import numpy as np
import pytest
from capture_double import CaptureDouble, measured_run, small_job
from long_suites import mostly_slow
from root_process import ROOT

from benchmarks.budget_lots import plan_of
from benchmarks.contradiction import judged as judged_lot
from benchmarks.contradiction import larger
from pipelines.archive import Archive, Run
from pipelines.archive.signatures import VARIABLE
from pipelines.certificates import Ledger
from pipelines.chain import certifiable
from pipelines.chain import certify as certifying
from pipelines.chain.certify import certify
from pipelines.cli.text.verdict_text import print_references
from pipelines.jobs.references import contradiction, references_of, unseen
from pipelines.report.context import ReportContext
from pipelines.report.panels import stated_references
from schemas.errors import WrongUse
from stations.plant.preset import load_preset

pytestmark = pytest.mark.usefixtures("no_verdict")
WORKSHOP = ROOT / "deploy" / "stations" / "simulated-workshop.toml"
Array = np.ndarray


class TurnedTable(CaptureDouble):
    """A table that misses every pose by the same turn for all units, ``urad`` in each direction."""

    urad = 0.0

    def output(
        self, slot: int, force: Array, temperature: float, shape: tuple[int, int], rng: np.random.Generator
    ) -> Array:
        own = np.random.default_rng(
            [*np.frombuffer(np.round(1e6 * force + 2e6).astype(np.int64).tobytes(), np.uint32), round(temperature)]
        )
        turned = force + np.cross(1e-6 * self.urad * own.standard_normal(3), force)
        return super().output(slot, turned, temperature, shape, rng)


def run_of(folder: Path, urad: float) -> Run:
    table = TurnedTable()
    table.urad = urad
    job = small_job(folder, ("9.8123", "9.80665"), station=WORKSHOP)
    return measured_run(job, Archive(folder / "archive"), table)


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[float, Run]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(VARIABLE, "")
        return {urad: run_of(tmp_path_factory.mktemp("run"), urad) for urad in (50.0, 200.0)}


@pytest.mark.parametrize(
    ("size", "count", "least", "most"),
    mostly_slow([(4.0, 2, 2, 2), (1.0, 10, 0, 1), (2.0, 10, 8, 10), (4.0, 10, 10, 10)], (4.0, 2, 2, 2)),
)
def test_an_honest_table_is_rarely_told_and_one_twice_or_four_times_as_bad_nearly_always(
    size: float, count: int, least: int, most: int
) -> None:
    """At 1 % two of 10 come in four of a thousand times; `benchmarks/contradiction.py` has the rates over many lots."""
    rng = np.random.default_rng([6, round(size)])
    plan, preset = plan_of("twelve edges × 3"), load_preset("sf1500")
    told = sum(bool(judged_lot(plan, preset, larger(size), rng).found) for _ in range(count))
    assert least <= told <= most


@pytest.mark.slow
@pytest.mark.parametrize("name", ["harmonics", "pose"])
def test_what_is_larger_is_named_first_with_an_interval_around_the_truth(name: str) -> None:
    rng = np.random.default_rng(8)
    plan, preset = plan_of("24 directions × 3"), load_preset("qa700")
    lots = [judged_lot(plan, preset, larger(4.0, (name,)), rng).found for _ in range(6)]
    told = [found[0] for found in lots if found]
    assert len(told) >= 5
    assert {one.name for one in told} == {name}
    assert sum(one.low <= 4.0 <= one.high for one in told) >= 4


def test_of_an_honest_table_nothing_is_told_and_level_and_offsets_are_hardly_seen() -> None:
    judged = judged_lot(plan_of("24 directions × 3"), load_preset("qa700"), larger(1.0), np.random.default_rng(3))
    assert not judged.found
    seen = {one.name: one.seen_from for one in judged.looked}
    assert seen["pose"] < 1.5
    assert seen["harmonics"] < 4.0
    assert seen["level"] > 5.0
    assert seen["outer_offset"] > 20.0
    assert seen["inner_offset"] == np.inf


def test_a_run_on_a_worse_table_says_what_is_stated_and_what_was_found_and_one_as_stated_does_not(
    runs: dict[float, Run], capsys: pytest.CaptureFixture[str]
) -> None:
    honest, worse = (references_of(runs[urad]) for urad in (50.0, 200.0))
    assert honest["worse"] is False
    assert contradiction(honest) == certifiable.refuse_contradicted(runs[50.0]) == ""
    first = worse["seen"][0]
    assert (first["entry"], first["unit"], first["stated"], first["worse"]) == ("pose", "urad", 50.0, True)
    # turned about any axis, not by two angles
    assert 100.0 < first["low"] < first["found"] < (first["high"] or 0.0) < 450.0
    print_references(worse)
    text = capsys.readouterr().out
    assert "CONTRADICTED: the table is worse than stated (p < 0.001)" in text
    assert "repeatability of the poses: stated u 50 µrad, found " in text
    told = " ".join(text.split()).partition("; it cannot show: ")[2]
    assert "seat of the fixture (acts as the misalignment of each unit), local gravity" in told
    html = str(stated_references.render(ReportContext(runs[200.0], {})))
    assert "the table is worse than stated" in html
    assert "not contradicted" not in html.lower()
    assert "Not contradicted" in str(stated_references.render(ReportContext(runs[50.0], {})))


def test_a_contradicted_run_is_not_certified_and_a_weaker_finding_stands_in_the_certificate(
    runs: dict[float, Run], monkeypatch: pytest.MonkeyPatch
) -> None:
    run = runs[200.0]
    monkeypatch.setenv(VARIABLE, "")
    monkeypatch.setattr(certifying, "refuse_inadequate", lambda _run: "ADEQUATE (p = 0.4)")  # the other judge
    monkeypatch.setattr(certifying, "refuse_unstated", lambda _run: None)
    with pytest.raises(
        WrongUse, match=r"worse than stated .*stated u 50 µrad, found .*state in \[uncertainty\] at least what"
    ):
        certify(Ledger(run.archive), run)
    monkeypatch.setattr(certifiable, "REFUTED_BELOW", 0.0)
    proposals, _ = certifying._proposals(run, (), "2026-01-01", "2027-01-01", "")
    judged = references_of(run)
    assert {one.adequacy for one in proposals} <= {f"ADEQUATE (p = 0.4); {contradiction(judged)}"}
    assert certifiable.refuse_contradicted(run) == contradiction(judged)


def test_one_unit_alone_cannot_be_judged(runs: dict[float, Run], monkeypatch: pytest.MonkeyPatch) -> None:
    read = Run.table
    monkeypatch.setattr(Run, "table", lambda own, name: read(own, name).query("unit == 'A1'"))
    monkeypatch.setattr("pipelines.jobs.references._judged", {})
    judged = references_of(runs[200.0])
    assert judged["worse"] is None
    assert "one unit alone" in str(judged["reason"])
    assert unseen(judged) == "it shows nothing of the table"
