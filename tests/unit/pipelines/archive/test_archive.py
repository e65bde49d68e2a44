"""The archive: whole or not at all, the same bytes for the same content, keys of its code, and trouble told in one message."""

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pandas as pd
import pytest
from capture_double import small_job, small_run
from in_process import refused

from pipelines.archive import Archive, Run, files, parquet, stage_key
from pipelines.archive.code import CODE
from pipelines.archive.keys import sources
from pipelines.chain.chain import ORDER
from pipelines.chain.runner import Runner
from schemas.errors import ArchiveUnusable, OperatorNeeded, WrongUse

FRAME = pd.DataFrame({"unit": ["A", "B"], "value": [1.0, 2.0]})


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """One to whose archive runs are added."""
    return small_run(tmp_path_factory.mktemp("run"))


def test_a_table_reads_back_and_what_is_none_is_named(tmp_path: Path) -> None:
    path, content = tmp_path / "t.parquet", parquet.table_bytes("t", FRAME, 1)
    assert content == parquet.table_bytes("t", FRAME.copy(), 1)
    files.publish(path, content)
    pd.testing.assert_frame_equal(parquet.read_table(path, "t"), FRAME)
    for data, said in (
        (content[:100], r"t\.parquet \(100 bytes\) is not a whole Parquet file"),
        (FRAME.to_parquet(), "was not written by this archive"),
        (parquet.table_bytes("other", FRAME, 1), "holds table 'other'"),
    ):
        path.write_bytes(data)
        with pytest.raises(ArchiveUnusable, match=said):
            parquet.read_table(path, "t")


def test_leaves_nothing_under_a_temporary_name_and_names_a_folder_that_cannot_be_an_archive(tmp_path: Path) -> None:
    files.publish(tmp_path / "a", b"1")
    files.publish_folder(tmp_path / "b", {"x": b"1", "y": b"2"})
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "b"]
    with pytest.raises(ArchiveUnusable, match="holds other files and no archive"):
        Archive(tmp_path).prepare()
    with pytest.raises(ArchiveUnusable, match=r"cannot be written \(.*\), a folder with write permission"):
        Archive(tmp_path / "a" / "archive").prepare()


def test_a_manifest_says_from_what_and_with_what_its_key_depends_on_that_and_a_finished_run_is_not_computed_again(
    run: Run, tmp_path: Path
) -> None:
    manifest = run.manifest("coefficients")
    assert manifest["inputs"] == {name: run.manifest(name)["sha256"] for name in ("dwells", "history")}
    assert {"who", "where", "when", "libraries", "code", "schema"} <= manifest.keys()
    changes = [(dwells, effect, code) for dwells in "12" for effect in ("bias", "scale") for code in ("code", "new")]
    keys = [stage_key("fit", {"dwells": one[0]}, {"effects": [one[1]]}, one[2]) for one in changes * 2]
    assert len(set(keys)) == len(changes)
    job = small_job(tmp_path)
    again = Runner(job, run.archive, measure=_never)
    assert again.run.id == run.id
    assert all(again.stage(name).reused for name in ORDER[:-1])


def _never(*_: object) -> None:
    raise AssertionError


def test_a_table_changed_behind_the_archives_back_is_found(tmp_path: Path) -> None:
    run = small_run(tmp_path)
    path = run.path / "coefficients.parquet"
    path.write_bytes(path.read_bytes()[:-7])
    with pytest.raises(ArchiveUnusable, match="truncated or has changed"):
        list(Runner(small_job(tmp_path), run.archive, measure=_never).all())
    own = ("--archive", run.archive.root)
    message = refused("show", run.id, "coefficients", *own)
    assert "is not a whole Parquet file" in message
    assert f"or remove {run.path} and make the run again: its capture is kept" in message
    samples = next((run.archive.root / "captures").glob("*/00003/samples.parquet"))
    samples.write_bytes(samples.read_bytes()[:-7])
    capture = samples.parent.parent
    with pytest.raises(ArchiveUnusable, match=rf"backup' made, or remove {capture} and measure again with"):
        parquet.read_table(samples, "samples")


def test_finds_a_run_by_its_beginning_and_the_latest_and_names_what_is_close(run: Run) -> None:
    archive = Archive(run.archive.root)
    ids = [info.id for info in archive.runs()]
    assert run.id in ids
    assert archive.run(run.id[:-2]).id == run.id
    assert archive.run("latest").id == ids[-1]
    with pytest.raises(WrongUse, match=f"did you mean .*{run.id}"):
        archive.run(run.id.replace("small", "smal"))
    with pytest.raises(WrongUse, match="did you mean coefficients"):
        run.table("coeficients")


def test_one_process_at_a_time_measures_a_lot(tmp_path: Path) -> None:
    job, archive = small_job(tmp_path), Archive(tmp_path / "archive")

    def second(*_: object) -> None:
        list(Runner(job, archive, measure=_never).all())

    with pytest.raises(OperatorNeeded, match="another process is measuring this lot"):
        list(Runner(job, archive, measure=second).all())


def test_a_key_takes_in_the_sources_of_what_its_stage_uses_and_imports_none_of_them() -> None:
    assert {"inertial.effects.third_order", "inertial.effects.covariate"} <= set(sources(CODE["fit"]))
    assert {"inertial.noise.allan", "inertial.noise"} <= set(sources(("inertial.noise",)))
    for name in ("inertial.no_such_module", "no_such_package", "inertial.counts.number_of"):
        with pytest.raises(LookupError, match=name):
            sources((name,))
    found = sources(("inertial", "schemas", "stations", "pipelines"))
    assert len(found) > 900
    for name in [*found][::9]:
        assert found[name] == Path(find_spec(name).origin), name
    code = (
        "import sys; from pipelines.archive.keys import code_hash; before = set(sys.modules); "
        "code_hash('report'); print(*(set(sys.modules) - before))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    imported = done.stdout.split()
    assert not [name for name in imported if name.split(".")[0] in {"matplotlib", "inertial", "pipelines", "scipy"}]
